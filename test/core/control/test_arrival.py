"""Arrival is predicted by the model to the moment, and measured where there is a sensor."""

from __future__ import annotations

import math

import numpy as np
import pytest
from test_previewed_loop import PERIOD_S, fast_model, settings

from benchmarks import fast_loop
from fomrc_core.control.arrival import Arrival
from fomrc_core.control.compensation_loop import CompensationLoop
from fomrc_core.control.stage_motion import StageMotion
from fomrc_core.effects.zero_order_hold import ZeroOrderHold
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.preview_inverse import PreviewInverse

TOLERANCE_UM = 0.04
STEP_UM = 4.0


def profile(n: int, duration_s: float = 0.015) -> np.ndarray:
    """A step of constant acceleration, then the same to stop."""
    since_s = PERIOD_S * np.arange(n) - 0.02
    half_s = 0.5 * duration_s
    up = 2.0 * np.clip(since_s / duration_s, 0.0, 0.5) ** 2
    down = 2.0 * np.clip((2.0 * half_s - since_s) / duration_s, 0.0, 0.5) ** 2
    return STEP_UM * np.where(since_s < half_s, up, 1.0 - down)


@pytest.mark.parametrize("preview_s", [0.0, 0.01])
def test_the_predicted_arrival_is_that_of_the_stage(preview_s):
    model = fast_model()
    if preview_s:
        preview = PreviewInverse.of(model, PERIOD_S, preview_s)
        loop = CompensationLoop(preview.core, settings(), preview=preview)
    else:
        loop = CompensationLoop(Compensator(model), settings())
    arrival = Arrival(TOLERANCE_UM)
    motion, state = StageMotion(arrival, None), model.initial_state()
    moved, arrived, said_ahead_s = [], [], 0.0
    # Long enough for the mass to ring out where nothing keeps it from ringing.
    for k, target_um in enumerate(profile(500)):
        loop.set_target(float(target_um))
        moved.append(model.advance(state, loop.tick(PERIOD_S), PERIOD_S))
        motion.after_tick(loop, k * PERIOD_S)
        arrived.append(arrival.has_arrived)
        if arrival.due_s is not None:
            said_ahead_s = max(said_ahead_s, arrival.due_s - k * PERIOD_S)
    away = np.flatnonzero(np.abs(np.array(moved) - STEP_UM) > TOLERANCE_UM)
    measured_s = PERIOD_S * (away[-1] + 1)
    predicted_s = PERIOD_S * (np.flatnonzero(~np.array(arrived))[-1] + 1)
    print(preview_s, measured_s, predicted_s, said_ahead_s)
    assert abs(predicted_s - measured_s) <= max(2e-3, 0.05 * (measured_s - 0.035))
    assert said_ahead_s >= 0.5 * preview_s


def test_ringing_that_is_left_is_seen_ahead():
    # One sample of preview is too little for a mass that swings in three, damped by 0.02.
    step = fast_loop.stepped(1e-3 * STEP_UM, preview_s=1e-3)
    assert step.measured_s > 0.02
    assert abs(step.predicted_s - step.measured_s) <= max(2e-3, 0.05 * step.measured_s)


@pytest.mark.parametrize("period_s", [1e-3, 5e-4])
def test_nothing_is_left_ringing(period_s):
    # At 1 kHz the mass swings in three samples, and hysteresis bends within them.
    step = fast_loop.stepped(1e-3 * STEP_UM, period_s)
    assert step.ringing_um <= 1e-3 * STEP_UM
    assert abs(step.predicted_s - step.measured_s) <= 2e-3


@pytest.mark.parametrize("is_held", [False, True])
def test_it_is_seen_ahead_from_a_memory_that_is_not_relaxed(is_held):
    model = fast_model()
    if is_held:
        model = model.with_effects(ZeroOrderHold(PERIOD_S))
    preview = PreviewInverse.of(model, PERIOD_S, 0.01)
    loop, arrival = CompensationLoop(preview.core, settings(), preview=preview), Arrival(1e-3 * STEP_UM)
    state, moved, arrived = model.initial_state(), [], []
    course = np.concatenate((-profile(300), -np.flip(profile(300))[:100], profile(400)))
    motion = None
    for k, target_um in enumerate(course):
        loop.set_target(float(target_um))
        moved.append(model.advance(state, loop.tick(PERIOD_S), PERIOD_S))
        if k == 395:
            motion = StageMotion(arrival, None)
        if motion is not None:
            motion.after_tick(loop, k * PERIOD_S)
        arrived.append(arrival.has_arrived)
    away = np.flatnonzero(np.abs(np.array(moved) - STEP_UM) > 1e-3 * STEP_UM)
    n_measured, n_predicted = away[-1] + 1, np.flatnonzero(~np.array(arrived))[-1] + 1
    assert n_measured > 460
    assert abs(n_predicted - n_measured) <= 2


def test_what_limits_keep_from_its_target_never_arrives():
    model = fast_model()
    preview = PreviewInverse.of(model, PERIOD_S, 0.01)
    loop = CompensationLoop(preview.core, settings(limit_v=1.0), preview=preview)
    arrival = Arrival(TOLERANCE_UM)
    motion = StageMotion(arrival, None)
    for k in range(800):
        loop.set_target(4.0 if k < 400 else 0.5)
        loop.tick(PERIOD_S)
        motion.after_tick(loop, k * PERIOD_S)
        assert not (k < 400 and arrival.has_arrived)
    assert arrival.has_arrived


def test_it_is_measured_where_there_is_a_sensor():
    arrival = Arrival(TOLERANCE_UM)
    assert arrival.is_new(1.0)
    near = [arrival.judge_measured(PERIOD_S * k, 1.0 + 0.5 * TOLERANCE_UM * (-1.0) ** k) for k in range(20)]
    assert near.index(True) == 5, "five milliseconds near it"
    assert not arrival.judge_measured(0.02, 1.0 + 2.0 * TOLERANCE_UM), "pushed away again"
    assert arrival.is_new(2.0)
    assert not arrival.has_arrived
    assert arrival.is_new(math.nan), "no target"
    assert not any(arrival.judge_measured(0.03 + PERIOD_S * k, 2.0) for k in range(20))

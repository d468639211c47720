"""The loop without topics: what it believes of the actuator is what the forward model says of its voltages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_model import MODEL, compensator_of

from fomrc_core.control.actuator_memory import aging_steps, pause_steps
from fomrc_core.control.compensation_loop import CompensationLoop, LoopSettings
from fomrc_core.control.loop_account import Activity
from fomrc_core.control.turning_points import TurningPoints
from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel

PERIOD_S = 1e-3


def loop_of(history_s: float = 60.0, slew_v_per_s: float = 20.0, limit_v: float = 5.0) -> CompensationLoop:
    limits = VoltageLimits(-limit_v, limit_v, slew_v_per_s, 0.0, 10.0)
    return CompensationLoop(compensator_of(), LoopSettings(limits, 0.2, True, PERIOD_S, history_s))


def target(n: int) -> np.ndarray:
    t = PERIOD_S * np.arange(n)
    return 1.2 * np.sin(2.3 * t) + 0.8 * np.sin(0.37 * t) + 0.1 * np.sin(17.0 * t)


def test_limited_voltages_leave_the_memory_where_the_actuator_is():
    loop = loop_of(slew_v_per_s=4.0, limit_v=0.8)
    voltages, followed = [], []
    for k, wanted in enumerate(target(6000) + 0.6 * (np.arange(6000) > 2000)):
        if k < 5000:  # after that the target is stale, and the voltage ramps down
            loop.set_target(float(wanted))
        voltages.append(loop.tick(PERIOD_S))
        followed.append(loop.followed_um)
    assert loop.counts.n_clamped > 100
    assert loop.counts.n_slewed > 20
    assert loop.activity is Activity.RAMPING
    assert voltages[-1] == 0.0
    moved = PiezoModel.from_mapping(MODEL).simulate(np.full(6000, PERIOD_S), np.array(voltages))
    np.testing.assert_allclose(followed, moved, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("changed", "history_s", "tolerance_v"),
    [
        ({"kappa_um_per_v": [18.0, 13.0, 8.0, 1.3], "saturation_v": [0.03, 0.06, 0.25]}, 1.0, 1e-12),
        ({"saturation_v": [0.1], "kappa_um_per_v": [3.0, 1.5]}, 1.0, 1e-12),
        ({"creep_order": 0.016}, 60.0, 1e-12),
        # What lies before the last two seconds is replayed in outline.
        ({"creep_order": 0.016}, 2.0, 1e-6),
    ],
    ids=["elements", "fewer elements", "creep order", "creep order, most of the past in outline"],
)
def test_swapped_model_stands_as_if_it_had_run_all_along(changed, history_s, tolerance_v):
    n = 12000
    wanted = target(n)
    new = Compensator(PiezoModel.from_mapping(MODEL | changed))
    replayed = new.run(np.full(n, PERIOD_S), wanted)
    loop = loop_of(history_s)
    voltages = []
    for k in range(n):
        if k == 8000:
            loop.swap(new)
        loop.set_target(float(wanted[k]))
        voltages.append(loop.tick(PERIOD_S))
    assert not loop.is_swapping
    assert np.max(np.abs(np.diff(voltages))) <= 20.0 * PERIOD_S + 1e-12
    np.testing.assert_allclose(voltages[-1000:], replayed[-1000:], rtol=0.0, atol=tolerance_v)


def test_turning_points_are_all_that_plays_remember():
    generator = np.random.default_rng(4)
    thresholds = np.array([0.01, 0.1, 0.5, 1.3, 4.0])
    for _ in range(50):
        values = np.cumsum(generator.standard_normal(400)) * generator.choice([0.02, 0.2, 1.0])
        points, plays = TurningPoints(), np.zeros(thresholds.size)
        for value in values:
            points.move(float(value))
            plays = np.clip(plays, value - thresholds, value + thresholds)
        np.testing.assert_array_equal(points.plays(thresholds), plays)
        assert len(points) < 60
    points = TurningPoints(capacity=16)
    for k in range(200):
        points.move((-0.99) ** k)
    assert len(points) <= 16


def test_aging_adds_up():
    for down_time_s in (0.0, 1e-4, 0.0123, 4.9, 5.0, 60.0, 86400.0):
        steps = aging_steps(down_time_s, PERIOD_S)
        assert abs(sum(steps) - down_time_s) < 1e-5 * max(down_time_s, 0.1)
        assert len(steps) < 7000


def test_a_pause_adds_up():
    for pause_s in (0.9e-3, 1e-3, 2e-3, 0.0499, 3.0, 86400.0, 1e7):
        steps = pause_steps(pause_s, PERIOD_S)
        assert sum(steps) == pytest.approx(pause_s, rel=1e-9)
        assert len(steps) < 40


@pytest.mark.parametrize("pause_s", [0.002, 0.02, 0.3, 20.0, 5000.0])
def test_held_up_after_a_jump_it_knows_where_the_actuator_crept(pause_s):
    """The voltage is held while the node is held up: the actuator creeps, and does not follow its target."""
    loop = loop_of(slew_v_per_s=5000.0)
    loop.settings = replace(loop.settings, stale_after_s=0.0)
    plant = PiezoModel.from_mapping(MODEL)
    state = plant.initial_state()
    errors_um = []
    # The truth moves by fine steps, the same in each decade of the time since it was last driven.
    fine_s = np.diff(np.concatenate([[0.0], np.geomspace(1e-6, pause_s, 2000)]))
    for k, wanted_um in enumerate([0.0] * 20 + [1.5] * 40 + [0.0] * 200):
        loop.set_target(wanted_um)
        is_late = k == 23
        if is_late:
            for step_s in fine_s:
                plant.advance(state, loop.voltage_v, float(step_s))
        voltage_v = loop.tick(pause_s + PERIOD_S if is_late else PERIOD_S)
        errors_um.append(plant.advance(state, voltage_v, PERIOD_S) - wanted_um)
    print(pause_s, np.abs(errors_um[24:]).max(), abs(errors_um[23]))
    assert np.abs(errors_um).max() < 2e-3

"""A drive that is held between samples: what it costs, what is read, and what acts behind it."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.effects.zero_order_hold import ZeroOrderHold
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.substeps import Substeps

MODEL = PiezoModel([10.0, 4.0, 7.0, 1.5], [0.02, 0.1, 0.3], 0.02, substeps=Substeps.BENDS)


def test_a_hold_costs_half_of_its_time() -> None:
    steps_s = np.full(3000, 1e-3)
    drive = np.sin(2.0 * np.pi * 3.0 * np.cumsum(steps_s))
    lag = AmplifierBandwidth(20.0)
    held = MODEL.with_effects(ZeroOrderHold(1e-3), lag).simulate(steps_s, drive)
    delayed = MODEL.with_effects(TransportDelay(0.5e-3), lag).simulate(steps_s, drive)
    plain = MODEL.with_effects(lag).simulate(steps_s, drive)
    assert np.std(held - delayed) < 0.02 * np.std(plain - delayed)


def test_a_hold_of_some_samples_makes_stairs_with_the_sample_on_the_jump_half_way() -> None:
    steps_s, drive = np.full(12, 1e-3), np.arange(1.0, 13.0)
    linear = PiezoModel([2.0], [], 0.0)
    found = linear.with_effects(ZeroOrderHold(3e-3)).simulate(steps_s, drive) / 2.0
    assert found == pytest.approx([0.5, 1.0, 1.0, 2.5, 4.0, 4.0, 5.5, 7.0, 7.0, 8.5, 10.0, 10.0])


def test_a_hold_of_each_sample_is_as_long_as_the_samples_of_a_record_are_apart() -> None:
    rng = np.random.default_rng(7)
    steps_s, drive = np.full(300, 0.4e-3), np.cumsum(rng.uniform(-1.0, 1.0, 300))
    lag = AmplifierBandwidth(300.0)
    told_at_another_rate = MODEL.with_effects(ZeroOrderHold(1e-3, per_sample=1.0), lag).simulate(steps_s, drive)
    np.testing.assert_array_equal(
        told_at_another_rate, MODEL.with_effects(ZeroOrderHold(0.4e-3), lag).simulate(steps_s, drive)
    )
    for_a_time = MODEL.with_effects(ZeroOrderHold(1e-3), lag).simulate(steps_s, drive)
    assert np.std(for_a_time - told_at_another_rate) > 0.01 * np.std(told_at_another_rate)


def test_a_hold_between_samples_is_a_hold_for_what_lags_behind_it() -> None:
    # a first-order lag of a true staircase, by the exact exponential of each hold
    step_s, tau_s = 1e-3, 2e-3
    drive = np.sin(np.arange(1, 400) * 0.15)
    output, exact, before = 0.0, [], 0.0
    for value in drive:
        output = before + (output - before) * np.exp(-step_s / tau_s)
        exact.append(output)
        before = value
    linear = PiezoModel([1.0], [], 0.0, substeps=Substeps.BENDS)
    lag = AmplifierBandwidth(1.0 / (2.0 * np.pi * tau_s))
    found = linear.with_effects(ZeroOrderHold(step_s), lag).simulate(np.full(drive.size, step_s), drive)
    ramp = linear.with_effects(lag).simulate(np.full(drive.size, step_s), drive)
    assert np.std(found - exact) < 0.1 * np.std(ramp - exact)


def test_plays_behind_a_hold_see_its_levels_and_no_voltage_between_them() -> None:
    # steps far below the thresholds, without creep: each level is what it is without a hold, and half is read of either
    steps_s, drive = np.full(9000, 1e-3), 0.3 * np.sin(np.arange(9000) * 0.0011)
    stage = PiezoModel([7.0, 4.0], [0.1], 0.0, substeps=Substeps.BENDS)
    levels = stage.simulate(steps_s, drive)
    expected = 0.5 * (np.concatenate(([0.0], levels[:-1])) + levels)
    found = stage.with_effects(ZeroOrderHold(1e-3)).simulate(steps_s, drive)
    assert found == pytest.approx(expected, abs=1e-12)

"""What only looks like a fault of the data, and is none: plates, slow levels, plays that hold the highest reading."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from fomrc_core.compute.arrays import Array
from fomrc_core.effects.base.spectra import DriveLines
from fomrc_core.records.excitation import triangle
from fomrc_core.records.plausibility import suspicions
from fomrc_core.records.quality.clipping import noisy_end
from fomrc_core.records.recording import Recording


def _loops(voltage_v: Array, gain_um_per_v: float) -> Array:
    """Return plays of three thresholds, with noise of a thousandth of the range."""
    span, moved = float(np.ptp(voltage_v)), np.zeros(voltage_v.size)
    for reach in (0.05, 0.15, 0.3):
        at = voltage_v[0]
        for k, v in enumerate(voltage_v):
            at = min(max(at, v - reach * span), v + reach * span)
            moved[k] += at / 3.0
    noise = np.random.default_rng(1).normal(0.0, 1e-3 * span, voltage_v.size)
    return np.asarray(gain_um_per_v * (moved + noise))


def _record(voltage_v: Array, gain_um_per_v: float, step_s: float = 1e-3) -> Recording:
    return Recording(step_s * np.arange(voltage_v.size), voltage_v, _loops(voltage_v, gain_um_per_v))


def _triangles(highest_v: float) -> Array:
    return triangle(highest_v, slope_v_per_s=4.0 * highest_v, n_cycles=5, rate_hz=500.0).voltage_v


@pytest.mark.parametrize(
    ("highest_v", "gain", "is_suspicious"),
    [
        (150.0, 5e-4, False),  # a plate of 0.5 nm/V
        (1000.0, 3e-4, False),
        (10.0, 100.0, False),  # a lever's millimetre, told by its command
        (150_000.0, 6e-4, True),  # mV read as V
        (150.0, 600.0, True),  # nm read as um
        (1000.0, 2e-5, True),
    ],
)
def test_gains_of_real_parts_are_believed(highest_v: float, gain: float, is_suspicious: bool) -> None:
    found = [text for text in suspicions(_record(_triangles(highest_v), gain)) if "um/V" in text]
    assert bool(found) is is_suspicious


def test_slow_sweeps_are_suspicious_and_levels_held_to_see_creep_are_none() -> None:
    slow = _record(_triangles(100.0), 0.1, step_s=0.5)
    assert any("ms or us" in text for text in suspicions(slow))
    assert not any("ms or us" in text for text in suspicions(_record(_triangles(100.0), 0.1, step_s=0.04)))
    levels_v = np.random.default_rng(2).uniform(0.0, 100.0, 15)
    held_v = np.repeat(levels_v, 140) + 0.0
    assert not any("ms or us" in text for text in suspicions(_record(held_v, 0.1, step_s=0.5)))


def test_a_play_that_holds_the_highest_reading_is_no_clipped_sensor() -> None:
    up, down = np.linspace(0.0, 100.0, 400), np.linspace(100.0, 75.0, 100)
    again = np.linspace(75.0, 95.0, 80)
    voltage_v = np.concatenate((up, down, again, again[::-1], again, np.linspace(95.0, 0.0, 380)))
    at, held = 0.0, np.zeros(voltage_v.size)
    for k, v in enumerate(voltage_v):
        at = min(max(at, v - 30.0), v)
        held[k] = at
    # a sensor's filter makes noise larger than it looks from sample to sample, and readings leave the top for a moment
    noise = lfilter([1.0], [1.0, -0.8], np.random.default_rng(3).normal(0.0, 0.02, voltage_v.size))
    assert noisy_end(Recording(1e-3 * np.arange(voltage_v.size), voltage_v, held + noise)) is None
    clipped = np.minimum(voltage_v, 90.0) + np.random.default_rng(4).normal(0.0, 0.02, voltage_v.size)
    end = noisy_end(Recording(1e-3 * np.arange(voltage_v.size), voltage_v, clipped))
    assert end is not None
    assert end.level_um == pytest.approx(90.0, abs=0.1)


def test_a_tone_higher_than_a_harmonic_can_be_is_none() -> None:
    step_s, n = 1e-3, 4000
    drive = DriveLines.of(10.0 * np.sin(2.0 * np.pi * 5.0 * step_s * np.arange(n)), step_s)
    assert drive.has(5.0)
    assert drive.may_reach(5.0, 100.0, 0.1)  # at the line itself whatever its height
    assert drive.may_reach(15.0, 0.02, 0.1)  # 3 % of the stroke of the line: hysteresis makes as much
    assert not drive.may_reach(15.0, 0.05, 0.1)
    assert drive.may_reach(50.0, 0.009, 0.1)
    assert not drive.may_reach(50.0, 0.02, 0.1)  # the tenth harmonic, 2 % of the stroke
    assert not drive.may_reach(12.5, 1e-9, 0.1)

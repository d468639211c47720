"""Noise is as large where the drive stands as where it jumps; what a model gets wrong of fast motion is not."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from scipy.signal import lfilter

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.remainder import Dependence, DrivenRecord
from fomrc_core.diagnosis.unevenness import slow_unevenness, unevenness

_N = 4000


def _drive(rng: np.random.Generator) -> Array:
    """Slow sweeps, then steps at random, then a band of noise: still and fast stretches at all voltages."""
    slow = np.sin(2.0 * np.pi * np.arange(_N // 2) / 500.0)
    steps = np.repeat(rng.uniform(-1.0, 1.0, _N // 80), 20)
    band = lfilter([0.3], [1.0, -0.7], rng.normal(size=_N // 4))
    return np.concatenate((slow, steps, band))


def _of(drive_v: Array, residual_um: Array, step_s: float = 1.0) -> DrivenRecord:
    everything = np.ones(_N, dtype=np.bool_)
    return DrivenRecord(step_s * np.arange(_N), drive_v, 3.0 * drive_v, residual_um, everything)


_KINDS = {
    "white": lambda rng, v: rng.normal(size=v.size),
    "behind a filter": lambda rng, v: lfilter([1.0], [1.0, -0.95], rng.normal(size=v.size)),
    "growing with the displacement": lambda rng, v: (1.0 + np.abs(v)) * rng.normal(size=v.size),
    "wandering": lambda rng, v: np.cumsum(rng.normal(size=v.size)),
}


@pytest.mark.parametrize("test", [unevenness, slow_unevenness])
@pytest.mark.parametrize("kind", _KINDS)
def test_noise_is_not_taken_for_an_error_of_motion(
    kind: str, test: Callable[[Sequence[DrivenRecord]], Dependence]
) -> None:
    told = []
    for seed in range(40):
        rng = np.random.default_rng([5, seed])
        drive_v = _drive(rng)
        found = test([_of(drive_v, _KINDS[kind](rng, drive_v))])
        told.append(found.p_value < 0.01 and found.share > 0.1)
    assert sum(told) <= 3  # of forty at one in a hundred: four and more happen once in a thousand


def test_an_error_in_time_that_changes_its_sign_is_seen() -> None:
    rng = np.random.default_rng(8)
    drive_v = _drive(rng)
    late = np.linspace(-0.02, 0.02, _N) * np.gradient(drive_v)
    noise = 1e-3 * rng.normal(size=_N)
    found = unevenness([_of(drive_v, late + noise)])
    assert found.p_value < 1e-3
    assert found.share > 0.3


def test_an_error_of_slow_motion_is_seen_below_the_noise_from_sample_to_sample() -> None:
    # as what creeps after each sweep, its size and sign no function of what the drive does at the time
    rng = np.random.default_rng(10)
    turns_v = rng.uniform(-1.0, 1.0, 41) * np.repeat((1.0, 0.02, 1.0, 0.02), 11)[:41]
    drive_v = np.interp(np.arange(_N) / 100.0, np.arange(41), turns_v)
    signs = np.repeat(rng.choice((-1.0, 1.0), 40), 100)
    noise = 0.01 * rng.normal(size=_N)
    wrong = 0.5 * np.cumsum(signs * np.gradient(drive_v))
    found = slow_unevenness([_of(drive_v, wrong + noise)])
    assert found.p_value < 1e-3
    assert found.share > 0.1
    assert slow_unevenness([_of(drive_v, noise)]).p_value > 0.01


def test_no_scale_is_in_it() -> None:
    rng = np.random.default_rng(9)
    drive_v = _drive(rng)
    residual_um = np.gradient(drive_v) * rng.normal(size=_N)
    small, large = (unevenness([_of(drive_v * scale, residual_um * scale**2, scale)]) for scale in (1e-4, 1e5))
    # near equal ranks are exchanged by rounding
    assert small.p_value == pytest.approx(large.p_value, rel=0.05)
    assert small.share == pytest.approx(large.share, rel=1e-3)


def test_a_drive_of_one_slope_says_nothing() -> None:
    ramp_v = np.arange(_N) / 1024.0
    assert unevenness([_of(ramp_v, np.random.default_rng(1).normal(size=_N))]).p_value == 1.0


def test_coarse_readings_are_told_from_an_error() -> None:
    # A reading of a still drive stays the same, one of a drive that moves is off by as much as the step.
    rng = np.random.default_rng(3)
    drive_v = np.round(_drive(rng), 2)
    true_um = 3.0 * drive_v + 1e-4 * rng.normal(size=_N)
    fine, coarse = (
        unevenness([_of(drive_v, step_um * np.round(true_um / step_um) - 3.0 * drive_v)]) for step_um in (1e-6, 0.5)
    )
    assert fine.p_value > 0.01
    assert coarse.p_value == 1.0
    assert slow_unevenness([_of(drive_v, 0.5 * np.round(true_um / 0.5) - 3.0 * drive_v)]).p_value == 1.0

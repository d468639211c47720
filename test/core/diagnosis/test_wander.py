"""Noise that wanders is no cause, however well a cause follows it once plays and creep have bent after it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.wander import Wander, gain_beyond_wander, wander_of
from fomrc_core.effects.sensor_nonlinearity import SensorNonlinearity
from fomrc_core.effects.thermal_drift import ThermalDrift
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import Refit, refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording

PLAIN = TrialModel(ColumnKinds.plays(np.linspace(0.0, 1.9, 12)), np.linspace(1.0, 0.1, 12), 0.02, (), ((),))
RATE_HZ = 100.0
WALK_UM, WHITE_UM = 2e-3, 3e-3  # a step of the walk, and the noise beside it
DRIFT = ThermalDrift(0.0, um_per_s=1e-4, um_per_s2=1e-6, um_per_s3=1e-9, warm_up_um=0.0, warm_up_s=1.0)


def _split(chain: TrialModel, noise_um: np.ndarray) -> DataSplit:
    drive = _drive_v()
    time_s = np.arange(drive.size) / RATE_HZ
    moved_um = predict(chain, FitRecord.of(Recording(time_s, drive, drive)), 0)
    record = Recording(time_s, drive, moved_um + noise_um)
    return split_data((record,), record, None, WHITE_UM)


def _drive_v() -> np.ndarray:
    amplitudes = (2.0, 0.7, 1.4, 0.4, 1.8, 1.0)
    return np.concatenate([triangle(a, slope_v_per_s=1.5, n_cycles=2, rate_hz=RATE_HZ).voltage_v for a in amplitudes])


def _walk(seed: int, step_um: float = WALK_UM) -> np.ndarray:
    noise, n = np.random.default_rng(seed), _drive_v().size
    return np.cumsum(noise.normal(0.0, step_um, n)) + noise.normal(0.0, WHITE_UM, n)


def _fitted(split: DataSplit, effect: ThermalDrift | SensorNonlinearity, index: int | None) -> Refit:
    return refit(PLAIN.with_cause(effect, index), split.train)


def _plain_gain(split: DataSplit, fitted: Refit) -> float:
    without = refit(PLAIN, split.train)
    return 0.5 * split.n_used * math.log(without.squared_error / fitted.squared_error)


# a walk that comes to as much as the white noise beside it only in the course of a record: what a drift leaves of it
# wanders far less than it did
@pytest.mark.parametrize("step_um", [WALK_UM, 1.5e-4])
def test_a_drift_that_follows_a_walk_gains_nothing_beyond_it(step_um):
    gains, plain = [], []
    for seed in range(12):
        split = _split(PLAIN, _walk(seed, step_um))
        fitted = _fitted(split, DRIFT, 0)
        gains.append(gain_beyond_wander(fitted.model, "thermal_drift", split))
        plain.append(_plain_gain(split, fitted))
    assert np.median(plain) > 100.0  # as independent samples it would be sure
    assert max(gains) < 10.0
    assert np.median(gains) < 3.0


def test_a_drift_beside_a_slow_walk_is_seen():
    for seed in range(4):
        split = _split(PLAIN.with_cause(replace(DRIFT, um_per_s=5e-3), 0), _walk(seed, 1.5e-4))
        fitted = _fitted(split, DRIFT, 0)
        assert gain_beyond_wander(fitted.model, "thermal_drift", split) > 10.0


def test_a_drift_far_beyond_a_walk_is_seen():
    drift = ThermalDrift(0.0, um_per_s=0.0, um_per_s2=0.0, um_per_s3=0.0, warm_up_um=3.0, warm_up_s=3.0)
    for seed in range(4):
        split = _split(PLAIN.with_cause(drift, 0), _walk(seed))
        fitted = _fitted(split, drift, 0)
        assert gain_beyond_wander(fitted.model, "thermal_drift", split) > 30.0


@pytest.mark.parametrize("seed", range(4))
def test_what_is_quick_loses_nothing_by_a_walk(seed):
    bent = SensorNonlinearity(quadratic_per_um=5e-3, cubic_per_um2=0.0)
    split = _split(PLAIN.with_cause(bent), _walk(seed))
    fitted = _fitted(split, bent, None)
    gain = gain_beyond_wander(fitted.model, "sensor_nonlinearity", split)
    # beside the white noise alone it would gain this, and a walk hides what is slow of it
    white = np.random.default_rng(seed).normal(0.0, WHITE_UM, _drive_v().size)
    assert 50.0 < gain < 1.2 * _plain_gain(_split(PLAIN.with_cause(bent), white), fitted)


@pytest.mark.parametrize("share", [0.01, 0.1, 1.0, 10.0])
def test_the_root_of_a_walk_seen_through_noise_is_that_of_theory(share):
    """Variance of a step over that of the noise q is (1 - root)^2 / root (Harvey, 1989, eq. 2.4.4 f.)."""
    noise = np.random.default_rng(3)
    n = 200_000
    values = np.cumsum(noise.normal(0.0, math.sqrt(share), n)) + noise.normal(0.0, 1.0, n)
    expected = 1.0 + 0.5 * share - math.sqrt(share + 0.25 * share**2)
    found = wander_of([values], 1)
    assert found.pole == pytest.approx(1.0, abs=1e-3)
    assert 1.0 - found.zero == pytest.approx(1.0 - expected, rel=0.35)


@pytest.mark.parametrize("pole", [0.5, 0.9, 0.99])
def test_noise_that_forgets_is_no_walk(pole):
    new = np.random.default_rng(8).normal(0.0, 1.0, 50_000)
    found = wander_of([lfilter([1.0], [1.0, -pole], new)], 1)
    assert 1.0 - found.pole == pytest.approx(1.0 - pole, rel=0.5)
    assert found.zero < 0.35  # no white noise beside it


def test_of_white_noise_nothing_is_foreseen_and_of_a_walk_alone_all_but_its_steps():
    noise = np.random.default_rng(4).normal(0.0, 1.0, 20_000)
    white, walk = wander_of([noise], 1), wander_of([np.cumsum(noise)], 1)
    assert np.std(white.innovations(noise)) == pytest.approx(np.std(noise), rel=2e-3)
    assert (walk.pole, walk.zero) == (pytest.approx(1.0, abs=1e-3), 0.0)


def test_innovations_of_many_rows_are_those_of_one_filter():
    values = np.random.default_rng(6).normal(0.0, 1.0, 100_000)
    whole = lfilter([1.0], [1.0, -0.9], np.diff(values))
    assert np.allclose(Wander(1.0, 0.9).innovations(values), whole, rtol=0.0, atol=1e-12)

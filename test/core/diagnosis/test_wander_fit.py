"""Beside noise that wanders elements and causes are fitted to what is not foreseen: they err less where nobody looked.

The truth is a sum of plays behind a lag, stepped here sample by sample, with thresholds that the model has not.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.element_weights import with_element_weights
from fomrc_core.diagnosis.wander import mean_square, unforeseen, wander_beside
from fomrc_core.diagnosis.wander_fit import beside_wander, fitted_to_innovations
from fomrc_core.effects.sensor_bandwidth import SensorBandwidth
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.fitting.linear_part import residuals
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.recording import Recording

RATE_HZ, N_SAMPLES, LAG_S = 200.0, 3000, 0.03
THRESHOLDS_V, WEIGHTS_UM_PER_V = np.array([3.1, 8.7, 17.3, 29.0]), np.array([0.02, 0.02, 0.015, 0.01])
WHITE_UM = 5e-3


def _drive_v(rng: np.random.Generator) -> np.ndarray:
    time_s = np.arange(N_SAMPLES) / RATE_HZ
    tones_hz = rng.uniform(0.2, 1.5, 4)
    drive = np.sin(2.0 * np.pi * np.multiply.outer(time_s, tones_hz) + rng.uniform(0.0, 6.0, 4)).sum(axis=1)
    return 50.0 * (drive - drive[0]) / np.max(np.abs(drive - drive[0]))


def _moved_um(drive_v: np.ndarray) -> np.ndarray:
    plays, moved = np.zeros(THRESHOLDS_V.size), np.zeros(drive_v.size)
    for k, v in enumerate(drive_v):
        plays = np.minimum(np.maximum(plays, v - THRESHOLDS_V), v + THRESHOLDS_V)
        moved[k] = 0.05 * v + plays @ WEIGHTS_UM_PER_V
    # straight between samples
    kept = np.exp(-1.0 / (RATE_HZ * LAG_S))
    mean = RATE_HZ * LAG_S * (1.0 - kept)
    return np.asarray(lfilter([1.0 - mean, mean - kept], [1.0, -kept], moved))


def _recording(rng: np.random.Generator, step_um: float) -> tuple[Recording, np.ndarray]:
    drive = _drive_v(rng)
    clean = _moved_um(drive)
    noise = np.cumsum(rng.normal(0.0, step_um, drive.size)) + rng.normal(0.0, WHITE_UM, drive.size)
    return Recording(np.arange(drive.size) / RATE_HZ, drive, clean + noise), clean


def _split(seed: int, step_um: float) -> tuple[DataSplit, Recording, np.ndarray]:
    rng = np.random.default_rng(seed)
    (train, _), (held, _), (asked, clean) = (_recording(rng, step_um) for _ in range(3))
    return split_data((train,), held, None, WHITE_UM), asked, clean


def _by_squares(split: DataSplit) -> TrialModel:
    grid = np.linspace(0.0, 40.0, 14)
    plain = TrialModel(ColumnKinds.plays(grid), np.full(grid.size, 0.01), 0.01, (SensorBandwidth(20.0),), ((),))
    return with_element_weights(refit(plain, split.train).model, split.train)


def _error_um(model: TrialModel, asked: Recording, clean_um: np.ndarray) -> float:
    return float(np.std(clean_um - predict(model.alone(0), FitRecord.of(asked), 0)))


def test_beside_a_walk_a_third_record_is_foretold_better_and_the_cause_known_better():
    errors, lags = [], []
    for seed in range(8):
        split, asked, clean = _split(seed, 5e-3)
        plain = _by_squares(split)
        quick = beside_wander(plain, split)
        errors.append([_error_um(each, asked, clean) for each in (plain, quick)])
        cutoffs_hz = [next(iter(each.effects)).cutoff_hz for each in (plain, quick)]
        lags.append(np.abs(np.log(np.array(cutoffs_hz) * 2.0 * np.pi * LAG_S)))
    by_squares, by_innovations = np.sqrt(np.mean(np.square(errors), axis=0))
    print(f"error of what is told of a third record: {1e3 * by_squares:.2f} nm, {1e3 * by_innovations:.2f} nm")
    print(f"error of the cutoff's logarithm: {np.median(lags, axis=0)}")
    assert all(after <= before for before, after in errors)
    assert by_innovations < 0.8 * by_squares
    assert np.median(lags, axis=0)[1] < 0.5 * np.median(lags, axis=0)[0]


@pytest.mark.parametrize("seed", range(3))
def test_less_is_unforeseen_and_weights_are_those_of_elements(seed):
    split, _, _ = _split(seed, 5e-3)
    plain = _by_squares(split)
    noise = wander_beside(plain, residuals(plain, split.train), split.train)
    quick = fitted_to_innovations(plain, noise, split)
    masks = [record.is_used for record in split.train]
    before, after = (mean_square(unforeseen(residuals(m, split.train), masks, noise)) for m in (plain, quick))
    assert after < before
    assert np.all(quick.weights > 0.0)


@pytest.mark.parametrize("seed", range(4))
def test_where_noise_is_white_nothing_is_lost(seed):
    """What is left is not: thresholds that the model has not leave something that goes from sample to sample."""
    split, asked, clean = _split(seed, 0.0)
    plain = _by_squares(split)
    before_um, after_um = (_error_um(each, asked, clean) for each in (plain, beside_wander(plain, split)))
    print(f"{1e3 * before_um:.2f} nm, {1e3 * after_um:.2f} nm")
    assert after_um < before_um + 0.1 * WHITE_UM

"""The noise a search goes by: what acts in one copy of a drive and not in the other is no noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.noise_beside import with_noise_beside
from fomrc_core.records.noise import known_noise
from fomrc_core.records.recording import Recording

_NOISE_UM = 1e-3
_PERIOD, _N_PERIODS = 500, 4


def _drive_v(n_once: int) -> np.ndarray:
    """Return periods of a drive, and what comes once."""
    at = 2.0 * np.pi * np.arange(_N_PERIODS * _PERIOD) / _PERIOD
    often = np.sin(at) + 0.4 * np.sin(3.0 * at + 1.0)
    once = 0.8 * np.sin(0.013 * np.arange(n_once)) * np.cos(0.0031 * np.arange(n_once))
    return np.concatenate((often, once))


def _split(once_um: np.ndarray) -> DataSplit:
    """Return records with white noise and what acts beside it."""
    voltage_v = _drive_v(once_um.size - _N_PERIODS * _PERIOD)
    at_s = 1e-3 * np.arange(voltage_v.size)
    records = [
        Recording(at_s, voltage_v, 2.0 * voltage_v + once_um + _white_um(seed, voltage_v.size)) for seed in range(2)
    ]
    return split_data((records[0],), records[1], None, known_noise(records[:1]).floor_um)


def _white_um(seed: int, n: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, _NOISE_UM, n)


def _hum_um(n: int) -> np.ndarray:
    """Return a hum of many frequencies that no period of the drive holds."""
    rng = np.random.default_rng(5)
    at = 2.0 * np.pi * np.arange(n)
    lines = zip(rng.uniform(0.01, 0.05, 12), range(12), strict=True)
    return np.asarray(0.004 * sum(np.sin(at * f + phase) for f, phase in lines))


def test_what_was_found_is_no_noise_any_more() -> None:
    hum_um = _hum_um(_N_PERIODS * _PERIOD)
    split = _split(hum_um)
    assert split.noise_um > 3.0 * _NOISE_UM, "two copies differ by it"
    left_um = _white_um(0, hum_um.size)
    assert with_noise_beside(split, (left_um,)).noise_um == pytest.approx(_NOISE_UM, rel=0.1)
    # as long as it is not found what is left says nothing else than the records did
    assert with_noise_beside(split, (hum_um + left_um,)) is split


def test_copies_that_differ_by_more_than_is_left_of_all_do_not_differ_by_noise() -> None:
    n = 24 * _PERIOD
    # in one copy alone, and no jump
    once_um = np.zeros(n)
    once_um[2 * _PERIOD : 3 * _PERIOD] = 2.0 * np.hanning(_PERIOD) * _hum_um(_PERIOD)
    split = _split(once_um)
    assert split.noise_um > 4.0 * _NOISE_UM
    told = with_noise_beside(split, (once_um + _white_um(0, n),))
    assert told.noise_um == pytest.approx(_NOISE_UM, rel=0.15)


def test_noise_that_is_known_stays_as_it_is() -> None:
    split = _split(np.zeros(_N_PERIODS * _PERIOD))
    left_um = _white_um(0, _N_PERIODS * _PERIOD)
    assert with_noise_beside(split, (left_um,)) is split
    # a model with many parameters takes a little of it
    assert with_noise_beside(split, (0.97 * left_um,)) is split
    much = replace(split, noise_um=0.5 * _NOISE_UM)
    assert with_noise_beside(much, (left_um,)) is much, "more is left than noise: nothing is asked"

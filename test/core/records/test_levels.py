"""What jumps at some moment and stays is told from what a model leaves; noise holds no levels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fomrc_core.records.quality import levels_of

_N = 2000
_ALL = np.ones(_N, dtype=np.bool_)


def _noise(seed: int, colour: float) -> np.ndarray:
    white = np.random.default_rng(seed).normal(size=_N)
    noise = np.empty(_N)
    noise[0] = white[0]
    for k in range(1, _N):
        noise[k] = colour * noise[k - 1] + white[k]
    return np.asarray(noise / np.std(noise))


@pytest.mark.parametrize("steps", [{300: 8.0}, {1400: -6.0}, {700: 40.0, 1500: -5.0}])
def test_levels_are_found_where_they_begin(steps: dict[int, float]) -> None:
    true = np.zeros(_N)
    for edge, size in steps.items():
        true[edge:] += size
    found = levels_of(true + _noise(1, 0.0), _ALL)
    assert list(np.flatnonzero(np.diff(found)) + 1) == pytest.approx(list(steps), abs=2)
    np.testing.assert_allclose(found, true - np.mean(true), atol=0.5)


@pytest.mark.parametrize("colour", [0.0, 0.6, 0.95])
def test_noise_holds_none(colour: float) -> None:
    held = [bool(np.any(levels_of(_noise(seed, colour), _ALL))) for seed in range(40)]
    assert sum(held) <= 1


def test_at_readings_that_do_not_count_it_is_that_before_them() -> None:
    true = np.where(np.arange(_N) >= 900, 10.0, 0.0)
    valid = _ALL.copy()
    valid[850:1000] = False
    found = levels_of(np.where(valid, true + 0.1 * _noise(2, 0.0), 1e6), valid)
    np.testing.assert_allclose(np.ptp(found), 10.0, atol=0.1)
    assert np.unique(found[800:1000]).size == 1


@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_levels_have_no_scale_and_no_zero_of_their_own(offset: float, scale: float) -> None:
    residual = _noise(3, 0.3) + 5.0 * (np.arange(_N) >= 1200)
    found = levels_of(residual, _ALL)
    assert np.any(found)
    rounding = 1e-9 * (abs(offset) + scale)
    np.testing.assert_allclose(levels_of(scale * residual + offset, _ALL), scale * found, atol=rounding, rtol=1e-6)

"""Noise that grows with displacement, of records whose repeats came to a part of their places only."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.compute.arrays import Array
from fomrc_core.records.noise_growth import beyond_repeats
from fomrc_core.records.recording import Recording

_RATE_HZ = 200.0
_N_SMALL, _N_LARGE = 3000, 4000


def _displacement_um() -> Array:
    """Return four equal small loops near zero and one large sweep."""
    small = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(_N_SMALL) * 4.0 / _N_SMALL)
    large = 5.0 - 5.0 * np.cos(2.0 * np.pi * np.arange(_N_LARGE) / _N_LARGE)
    return np.concatenate((small, large))


def _recorded(noise_um: Array) -> Recording:
    moved_um = _displacement_um()
    return Recording(np.arange(moved_um.size) / _RATE_HZ, 10.0 * moved_um, moved_um + noise_um)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("misfit_um", [0.0, 0.05])
def test_noise_in_proportion_to_the_displacement_is_more_than_its_repeats_show(seed: int, misfit_um: float) -> None:
    moved_um = _displacement_um()
    size_um = 0.01 * (0.2 + np.abs(moved_um) / 5.0)
    noise_um = size_um * np.random.default_rng(seed).standard_normal(moved_um.size)
    expected = np.sqrt(np.mean(size_um**2) / np.mean(size_um[:_N_SMALL] ** 2))
    # what a model gets wrong is slow, grows as well, and says nothing
    residual_um = noise_um + misfit_um * (moved_um / 5.0) ** 2
    found = beyond_repeats(_recorded(noise_um), residual_um, np.ones(moved_um.size, dtype=np.bool_))
    assert expected > 2.0
    assert found == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("seed", range(5))
def test_noise_that_is_the_same_everywhere_is_what_its_repeats_show(seed: int) -> None:
    noise_um = 0.01 * np.random.default_rng(100 + seed).standard_normal(_N_SMALL + _N_LARGE)
    assert beyond_repeats(_recorded(noise_um), noise_um, np.ones(noise_um.size, dtype=np.bool_)) == 1.0


def test_where_nothing_repeats_nothing_is_said() -> None:
    moved_um = _displacement_um()[_N_SMALL:]
    noise_um = 0.01 * moved_um * np.random.default_rng(1).standard_normal(moved_um.size)
    record = Recording(np.arange(moved_um.size) / _RATE_HZ, 10.0 * moved_um, moved_um + noise_um)
    assert beyond_repeats(record, noise_um, np.ones(moved_um.size, dtype=np.bool_)) == 1.0

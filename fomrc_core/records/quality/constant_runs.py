"""Readings that stay exactly the same: a sensor that dropped to one value, or that stuck."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.records.quality.excursions import Surroundings, are_like_steps, own_steps_um

Index = NDArray[np.int64]

_N_SAME_MIN = 3  # times a value must come back exactly to be that of a dropout
_FALSE_ALARMS = 1e-3  # a record
_ROUNDING = 1e-9  # of the range
_JUMPED_SHARE = 0.3
_N_STUCK_MIN = 5
_RELEASE = 0.5  # of what the drive did meanwhile: what comes at once when a stuck sensor reads again
# Releases of a sensor that stuck are as large as what the drive did meanwhile, here much and there little. So many of
# one size, to a factor of two, are the steps of a converter, each of which a slow drive waits for.
_N_ALIKE, _ALIKE = 8, 2.0
# Of what the drive did just before the readings are equal, in as many samples: of a sensor that sticks the readings
# went with it until then. Where they stood already, but for steps of the sensor, it is the stage that stands.
_STOOD = 0.3
_BACK = 0.5  # of the jump: how near a record is, after a dropout, to where it was, what the drive did taken out


def runs_of_same(values: Array) -> tuple[Index, Index]:
    """Return where each stretch of exactly equal values begins and ends (exclusive), single values with them."""
    edges = np.flatnonzero(values[1:] != values[:-1]) + 1
    return np.concatenate(([0], edges)), np.concatenate((edges, [values.size]))


def find_dropouts(displacement_um: Array, around: Surroundings, is_excursion: Mask) -> Mask:
    """Return the samples that jumped to a value the record has jumped to several times, shape (n_samples,).

    Args:
        displacement_um: readings [um], shape (n_samples,).
        around: the same less what follows the drive.
        is_excursion: samples already found to be excursions, whose values are tried too.
    """
    starts, stops = runs_of_same(displacement_um)
    inner = (starts > 0) & (stops < displacement_um.size)
    starts, stops = starts[inner], stops[inner]
    value, rest = displacement_um[starts], around.rest_um
    into = rest[starts] - rest[starts - 1]
    out = rest[stops - 1] - rest[stops]
    jump = np.minimum(np.abs(into), np.abs(out))
    returns = np.abs(rest[stops] - rest[starts - 1]) < _BACK * jump
    limit = np.maximum(around.least_um(starts), around.least_um(np.minimum(stops, rest.size - 1)))
    jumps = (into * out > 0.0) & (jump > limit) & returns
    told, counts = np.unique(np.concatenate((value[jumps], displacement_um[is_excursion])), return_counts=True)
    visits = np.searchsorted(np.sort(value), told, side="right") - np.searchsorted(np.sort(value), told)
    # a coarse sensor reads the same value on its way too: of a dropout most visits are jumps
    constants = told[(counts >= _N_SAME_MIN) & (counts > _JUMPED_SHARE * visits)]
    # one long stay at one value is a dropout too: no motion is exactly constant between two jumps back and forth
    long = jumps & (stops - starts >= _N_STUCK_MIN)
    told_of = long | (jumps & np.isin(value, constants))
    if np.any(told_of):
        steps = own_steps_um(around, np.concatenate((starts[told_of], stops[told_of])))
        told_of[told_of] = ~are_like_steps(jump[told_of], steps)
        long &= told_of
        constants = np.intersect1d(constants, np.concatenate((value[told_of], displacement_um[is_excursion])))
    found = np.zeros(displacement_um.size, dtype=np.bool_)
    # what is known to be the value of a dropout need not jump far
    aside = (np.abs(into) > around.floor_um) & (np.abs(out) > around.floor_um) & (into * out > 0.0)
    for start, stop in zip(*_chosen(starts, stops, long | (aside & np.isin(value, constants))), strict=True):
        found[start:stop] = True
    # several in a row are apart by their own value only
    return found | (is_excursion & np.isin(displacement_um, constants))


def find_stuck(
    voltage_v: Array, displacement_um: Array, followed_um: Array, around: Surroundings, step_um: float
) -> tuple[Mask, float]:
    """Return the samples at which the sensor stuck, shape (n_samples,), and the largest jump at a release [um].

    Either the reading makes good at once, when it comes back, what the drive did meanwhile: neither a dead zone nor a
    gap of play does so. Or the noise of the sensor is larger than its step, so that equal readings in a row are none
    of its own: as many as never come by chance, while the drive moves by more than the noise, or with a jump at the
    end in which the drive has no part, as where the stage crept on in a rest.
    """
    starts, stops = runs_of_same(displacement_um)
    length = stops - starts
    n_equal = int(np.count_nonzero(np.diff(displacement_um) == 0.0))
    # at either end of its range a sensor is clipped, which is another matter
    value = displacement_um[starts]
    inside = (value > np.min(displacement_um)) & (value < np.max(displacement_um))
    kept = (length >= _N_STUCK_MIN) & inside
    starts, stops, length = starts[kept], stops[kept], length[kept]
    found = np.zeros(displacement_um.size, dtype=np.bool_)
    if not starts.size:
        return found, 0.0
    after = np.minimum(stops, displacement_um.size - 1)
    jump = displacement_um[after] - displacement_um[stops - 1]
    went = followed_um[after] - followed_um[starts]
    last = np.abs(followed_um[after] - followed_um[stops - 1])
    fine = step_um if np.isfinite(step_um) else _finest_gap_um(displacement_um)
    limit = np.maximum(around.least_um(after), 4.0 * fine)
    is_released = (
        (np.abs(jump) > limit)
        & (jump * went > 0.0)
        & (np.abs(jump) > _RELEASE * np.abs(went))
        & (np.abs(jump) > 4.0 * last)
        & (np.abs(went) > 4.0 * last)
    )
    is_released &= ~_stood_before(displacement_um, followed_um, starts, length, limit)
    if np.any(is_released):
        steps = own_steps_um(around, after[is_released])
        is_released[is_released] = ~are_like_steps(np.abs(jump[is_released]), steps)
    if np.count_nonzero(is_released) >= _N_ALIKE:
        small, large = np.quantile(np.abs(jump[is_released]), (0.1, 0.9))
        is_released &= large > _ALIKE * small
    moved = np.array([float(np.ptp(voltage_v[a:b])) for a, b in zip(starts, stops, strict=True)]) * around.gain
    # by chance: as often as the other readings are equal to the one before
    share = (n_equal - length + 2.0) / displacement_um.size
    is_chance = displacement_um.size * share ** (length - 1.0) > _FALSE_ALARMS
    is_loose = (np.abs(jump) > limit) & (np.abs(jump) > 4.0 * last)
    is_never = (around.noise_um > fine) & ~is_chance & ((moved > 2.0 * around.floor_um) | is_loose)
    is_stuck = is_released | is_never
    for start, stop in zip(*_chosen(starts, stops, is_stuck), strict=True):
        # the first of the equal readings was a true one
        found[start + 1 : stop] = True
    return found, float(np.max(np.abs(jump[is_stuck]), initial=0.0))


def _stood_before(displacement_um: Array, followed_um: Array, starts: Index, length: Index, limit_um: Array) -> Mask:
    """Return whether readings stood while the drive went on, in as many samples before each run as it has."""
    before = np.maximum(starts - length, 0)
    went_um, moved_um = (np.abs(x_um[starts] - x_um[before]) for x_um in (followed_um, displacement_um))
    return np.asarray((went_um > limit_um) & (moved_um < _STOOD * went_um))


def _finest_gap_um(values: Array) -> float:
    """Return how finely readings are told apart: all but one in twenty of the gaps between them are wider [um]."""
    apart = np.diff(np.unique(values))
    apart = apart[apart > _ROUNDING * float(np.ptp(values))]
    return float(np.quantile(apart, 0.05)) if apart.size else 0.0


def _chosen(starts: Index, stops: Index, mask: Mask) -> tuple[Index, Index]:
    return starts[mask], stops[mask]

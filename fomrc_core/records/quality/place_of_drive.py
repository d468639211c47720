"""Excursions that befall one place or one step of the drive: a model misses them there, and no sensor is at fault.

Where an amplifier saturates, or a stage meets a stop, a model that knows of neither misses a sample or two at the tip
of each fast swing; where it knows of no delay it misses one after each step of a staircase. A sensor's faults do not
know what the drive does. So excursions are the drive's where they lie within a narrow range of what it does (where it
is, how far from the nearer of its ends, how fast it moves), more narrow than chance allows, and come more often than
not when the drive is there: readings that were late stand out only where the drive is fast, but few of those that are
fast were late.

The chance is that of a scan statistic, bounded as by Naus (J. Am. Stat. Assoc. 60 (1965) 532-538): the windows that
hold so many, each as likely as the points in it.
"""

from __future__ import annotations

import numpy as np
from scipy.special import gammaln

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.runs import Bounds, runs_of
from fomrc_core.records.quality.excursions import N_BURST_MAX

_FALSE_ALARMS = 1e-3  # a record
_LEAST_SHARE = 0.8  # of the bursts: those elsewhere may be faults
_LEAST_BURSTS = 4
_LEAST_OFTEN = 0.5  # of the times the drive is there


def made_by_drive(is_excursion: Mask, voltage_v: Array) -> Mask:
    """Return which excursions befall one place, the ends or one step of the drive too often, shape (n_samples,).

    Args:
        is_excursion: samples that are excursions, shape (n_samples,).
        voltage_v: drive [V], shape (n_samples,).
    """
    from scipy.ndimage import maximum_filter1d  # slow to import; no node that only drives needs it

    steps_v = np.abs(np.diff(voltage_v, prepend=voltage_v[:1]))
    # as far off as a burst lasts: readings may be late, and where two clocks differ early as well
    about_v = maximum_filter1d(steps_v, 2 * N_BURST_MAX + 1, mode="nearest")
    # an amplifier has an end on either side: two places, and as near to an end of what the drive does
    to_end_v = np.minimum(voltage_v - np.min(voltage_v), np.max(voltage_v) - voltage_v)
    bursts = runs_of(is_excursion)
    found: Mask = np.zeros(is_excursion.size, dtype=np.bool_)
    if bursts.shape[0] < _LEAST_BURSTS:
        return found
    likeliest = 0.0
    for done_v in (voltage_v, to_end_v, about_v):
        low_v, high_v, log_chance = _narrowest(done_v, bursts)
        is_there = (done_v >= low_v) & (done_v <= high_v)
        if log_chance < min(likeliest, np.log(_FALSE_ALARMS)) and _how_often(is_there, is_excursion) >= _LEAST_OFTEN:
            likeliest = log_chance
            found[:] = False
            for start, stop in bursts:
                # the middle of a burst: a tip is on either side of its turn
                found[start:stop] = is_there[(start + stop) // 2]
    return found


def _narrowest(done_v: Array, bursts: Bounds) -> tuple[float, float, float]:
    """Return between which values of what the drive does most bursts lie, and the logarithm of how likely by chance."""
    at_v = np.sort(done_v[(bursts[:, 0] + bursts[:, 1]) // 2])
    ordered = np.sort(done_v)
    # a value at which the drive rests is as wide as its share of the record
    below, up_to = (np.searchsorted(ordered, at_v, side=side) / ordered.size for side in ("left", "right"))
    n = at_v.size
    k = int(np.ceil(_LEAST_SHARE * n))
    width = up_to[k - 1 :] - below[: n - k + 1]
    first = int(np.argmin(width))
    log_ways = float(gammaln(n + 1) - gammaln(k + 1) - gammaln(n - k + 1)) + np.log(k)
    # the narrowest window of so many: what lies as far again beside it is of the same place
    reach = (below[first] - width[first], up_to[first + k - 1] + width[first])
    inside = at_v[(below >= reach[0]) & (up_to <= reach[1])]
    return float(inside[0]), float(inside[-1]), float(log_ways + (k - 1) * np.log(width[first]))


def _how_often(is_there: Mask, is_excursion: Mask) -> float:
    """Return the share of the times the drive is there at which an excursion comes, within a burst's length of it."""
    visits = runs_of(is_there)
    counts = np.concatenate(([0], np.cumsum(is_excursion)))
    stops = np.minimum(visits[:, 1] + N_BURST_MAX, is_excursion.size)
    return float(np.mean(counts[stops] > counts[np.maximum(visits[:, 0] - N_BURST_MAX, 0)]))

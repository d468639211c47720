"""Excursions that befall one place of the drive: they are what a model misses there, and no fault of the sensor.

Where an amplifier saturates, or a stage meets a stop, a model that knows of neither misses a sample or two at the tip
of each fast swing, and only there. A sensor's faults do not know where the drive is. The more excursions lie within a
narrow range of drive values, the less likely that is by chance (scan statistic, bounded as by Naus, J. Am. Stat.
Assoc. 60 (1965) 532-538: the windows that hold so many, each as likely as the points in it).
"""

from __future__ import annotations

import numpy as np
from scipy.special import gammaln

from fomrc_core.compute.arrays import Array, Mask

_FALSE_ALARMS = 1e-3  # a record
_LEAST_SHARE = 0.8  # of the bursts: those elsewhere may be faults
_LEAST_BURSTS = 4


def at_one_place(is_excursion: Mask, voltage_v: Array) -> Mask:
    """Return which excursions befall one place of the drive too often for chance, shape (n_samples,).

    Args:
        is_excursion: samples that are excursions, shape (n_samples,).
        voltage_v: drive [V], shape (n_samples,).
    """
    found: Mask = np.zeros(is_excursion.size, dtype=np.bool_)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], is_excursion, [False])).astype(np.int8)))
    starts, stops = edges[::2], edges[1::2]
    if starts.size < _LEAST_BURSTS:
        return found
    # the middle of a burst: a tip is on either side of its turn
    at_v = np.sort(voltage_v[(starts + stops) // 2])
    ordered = np.sort(voltage_v)
    # a value at which the drive rests is as wide as its share of the record
    below, up_to = (np.searchsorted(ordered, at_v, side=side) / ordered.size for side in ("left", "right"))
    n = at_v.size
    k = int(np.ceil(_LEAST_SHARE * n))
    width = up_to[k - 1 :] - below[: n - k + 1]
    first = int(np.argmin(width))
    log_ways = float(gammaln(n + 1) - gammaln(k + 1) - gammaln(n - k + 1)) + np.log(k)
    if log_ways + (k - 1) * np.log(width[first]) > np.log(_FALSE_ALARMS):
        return found
    # the narrowest window of so many: what lies as far again beside it is of the same place
    reach = (below[first] - width[first], up_to[first + k - 1] + width[first])
    low_v, high_v = at_v[(below >= reach[0]) & (up_to <= reach[1])][[0, -1]]
    for start, stop in zip(starts, stops, strict=True):
        found[start:stop] = low_v <= voltage_v[(start + stop) // 2] <= high_v
    return found

"""Levels of a residual, constant from one moment to the next: what pushes against a stage, or a sensor's zero, jumps.

One jump after another goes where it takes most beside the others, while each surely takes more than noise of the rest's
colour would, and a good part of what is left. Several that stand out together alone are not looked for: many levels
bend to whatever else is left.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.records.noise import autocorrelation_inflation

_MOST = 6  # jumps of a record: what comes by degrees takes several
_LEAST_GAIN = 3.0  # times the logarithm of the number of samples, in chi square: two for where, one for how far
_LEAST_SHARE = 0.03  # of what is left: less may be the model's
_SHORTEST = 25  # samples that a level is told from


def levels_of(residual_um: Array, valid: Mask) -> Array:
    """Return the levels that a residual surely holds, their mean taken out [um], shape (n_samples,); zero for none.

    Args:
        residual_um: what a model leaves of a record [um], shape (n_samples,).
        valid: readings that count, shape (n_samples,).
    """
    at = np.flatnonzero(valid)
    values = residual_um[at]
    edges: list[int] = []
    rest = values - np.mean(values)
    left = float(np.sum(rest**2))
    least = _LEAST_GAIN * float(np.log(max(values.size, 2)))
    while len(edges) < _MOST and left > 0.0:
        place = _best_place(rest, edges)
        if place is None:
            break
        more = sorted([*edges, place])
        other = values - _means(values, more)
        after = float(np.sum(other**2))
        spread = after / values.size * autocorrelation_inflation(other)
        if after > (1.0 - _LEAST_SHARE) * left or not left - after >= least * spread:
            break
        edges, rest, left = more, other, after
    if not edges:
        return np.zeros(residual_um.size)
    levels = _means(values, edges)
    # at readings that do not count it is that of the last before them
    before = np.clip(np.searchsorted(at, np.arange(residual_um.size), side="right") - 1, 0, None)
    return np.asarray((levels - np.mean(levels))[before])


def _best_place(rest: Array, edges: list[int]) -> int | None:
    """Return where one more jump takes most beside those at the edges; None where every level is too short."""
    best = 0.0, -1
    for begin, end in zip((0, *edges), (*edges, rest.size), strict=True):
        n = end - begin
        if n < 2 * _SHORTEST:
            continue
        part = rest[begin:end]
        before = np.arange(_SHORTEST, n - _SHORTEST + 1)
        sums = np.cumsum(part - np.mean(part))[before - 1]
        gains = sums**2 * n / (before * (n - before))
        place = int(np.argmax(gains))
        best = max(best, (float(gains[place]), begin + int(before[place])))
    return best[1] if best[1] >= 0 else None


def _means(values: Array, edges: list[int]) -> Array:
    bounds: NDArray[np.int64] = np.array([0, *edges, values.size], dtype=np.int64)
    means = np.add.reduceat(values, bounds[:-1]) / np.diff(bounds)
    return np.asarray(np.repeat(means, np.diff(bounds)))

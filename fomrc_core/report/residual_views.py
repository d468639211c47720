"""What a residual is looked at against: place in the loop, time at rest, frequency; and bins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from fomrc_core.records.drive import LEAST_TURN, turning_points

Array = NDArray[np.float64]

_REST_SHARE = 1e-3  # of the mean step while the drive moves: less is rest
_N_PER_BIN_MIN = 8
_SEGMENT = 4096
_LONGER = 4  # than its number of samples: an interpolated record


@dataclass(frozen=True, eq=False)
class Binned:
    """A residual in bins of something else, arrays of shape (n_bins,).

    Attributes:
        centres: mean of what it is looked at against.
        means: mean residual.
        spreads: standard deviation of the residual.
        counts: number of samples.
    """

    centres: Array
    means: Array
    spreads: Array
    counts: Array


def loop_phase_deg(voltage_v: Array) -> Array:
    """Return the place in the loop [deg], 0 to 180 rising and 180 to 360 falling, shape (n_samples,).

    Within each half it is the share of the way from one turning point of the drive to the next, so that minor
    loops and loops of any rate lie on each other; nan where the drive rests.
    """
    phase = np.full(voltage_v.size, np.nan)
    turns = turning_points(voltage_v, LEAST_TURN * float(np.ptp(voltage_v)))
    for start, stop in pairwise(turns):
        way = voltage_v[stop] - voltage_v[start]
        share = np.clip((voltage_v[start : stop + 1] - voltage_v[start]) / way, 0.0, 1.0)
        phase[start : stop + 1] = 180.0 * share + (0.0 if way > 0.0 else 180.0)
    phase[_rests(voltage_v)] = np.nan
    return phase


def time_since_motion_s(time_s: Array, voltage_v: Array) -> Array:
    """Return the time since the drive last moved [s], nan while it moves, shape (n_samples,)."""
    rests = _rests(voltage_v)
    last = np.maximum.accumulate(np.where(rests, -1, np.arange(rests.size)))
    since = np.where(last >= 0, time_s - time_s[np.maximum(last, 0)], np.nan)
    return np.asarray(np.where(rests, since, np.nan))


def rate_v_per_s(time_s: Array, voltage_v: Array) -> Array:
    """Return the rate of the drive [V/s], shape (n_samples,)."""
    return np.asarray(np.gradient(voltage_v, time_s))


def binned(against: Array, residual: Array, n_bins: int = 40, *, by_rank: bool = False) -> Binned:
    """Return the residual in bins of equal width, or of equal count, those with few samples left out.

    Args:
        against: what to look at it against, nan where it has no value, shape (n_samples,).
        residual: shape (n_samples,).
        n_bins: how many bins.
        by_rank: bins of equal count.
    """
    known = np.isfinite(against)
    x, y = against[known], residual[known]
    if x.size < _N_PER_BIN_MIN or float(np.ptp(x)) == 0.0:
        return Binned(np.empty(0), np.empty(0), np.empty(0), np.empty(0))
    shares = np.linspace(0.0, 1.0, n_bins + 1)
    edges = np.unique(np.quantile(x, shares) if by_rank else x.min() + np.ptp(x) * shares)
    bins = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, edges.size - 2)
    counts = np.bincount(bins, minlength=edges.size - 1)
    kept = counts >= _N_PER_BIN_MIN
    divisor = np.maximum(counts, 1)
    means = np.bincount(bins, y, edges.size - 1) / divisor
    squares = np.bincount(bins, (y - means[bins]) ** 2, edges.size - 1) / divisor
    centres = np.bincount(bins, x, edges.size - 1) / divisor
    return Binned(centres[kept], means[kept], np.sqrt(squares[kept]), counts[kept].astype(np.float64))


def amplitude_density(time_s: Array, residual: Array) -> tuple[Array, Array]:
    """Return frequency [Hz] and amplitude density [unit/sqrt(Hz)] of a residual.

    Unequal steps are interpolated to their median; the mean is removed and frequency zero left out.
    """
    step_s = float(np.median(np.diff(time_s)))
    # a pause does not make a record of seconds one of millions of samples
    step_s = max(step_s, float(time_s[-1] - time_s[0]) / (_LONGER * time_s.size))
    n = int(np.floor((time_s[-1] - time_s[0]) / step_s + 0.5)) + 1
    even = np.interp(time_s[0] + step_s * np.arange(n), time_s, residual)
    frequency_hz, power = welch(even, fs=1.0 / step_s, nperseg=min(n, max(n // 4, 256), _SEGMENT), detrend="constant")
    return np.asarray(frequency_hz[1:]), np.sqrt(np.asarray(power[1:]))


def envelope(time_s: Array, values: Array, n_points: int = 3000) -> tuple[Array, Array]:
    """Return a curve with few points that looks the same: the least and greatest value of each stretch."""
    index = extreme_samples([values], n_points)
    return time_s[index], values[index]


def extreme_samples(curves: Sequence[Array], n_points: int) -> NDArray[np.intp]:
    """Return which samples to show of curves over one time: where each is least and greatest in each stretch.

    Args:
        curves: one or more, of shape (n_samples,).
        n_points: about how many samples to return, all of them where there are no more.
    """
    size = curves[0].size
    if size <= n_points:
        return np.arange(size)
    n_each = int(np.ceil(size / max(1, n_points // (2 * len(curves)))))
    n = size // n_each * n_each
    blocks = [values[:n].reshape(-1, n_each) for values in curves]
    within = np.column_stack([place for block in blocks for place in (block.argmin(axis=1), block.argmax(axis=1))])
    index = np.unique((within + n_each * np.arange(n // n_each)[:, None]).ravel())
    return np.concatenate((index, np.arange(n, size)))


def _rests(voltage_v: Array) -> NDArray[np.bool_]:
    moved = np.abs(np.diff(voltage_v)) > _REST_SHARE * _typical_step(voltage_v)
    return ~np.concatenate((moved[:1], moved))


def _typical_step(voltage_v: Array) -> float:
    """Return the mean step of the drive while it moves [V]."""
    steps = np.abs(np.diff(voltage_v))
    moving = steps[steps > 1e-9 * float(np.ptp(voltage_v))]
    return float(np.mean(moving)) if moving.size else 1.0

"""Where a drive repeats itself: stretches that come back sample for sample, at any place and any lag.

The drive is reduced to the samples at which it crosses a level of a grid; each such event is described by the
levels at a few later samples, on several time scales, and events of equal description that follow one another
propose a lag. Runs of events that propose the same lag are diagonals of a dot plot; each is verified on the samples
themselves and extended as far as they agree. Rests propose nothing, for they cross no level, and do not end a
diagonal. Where there are very many events only some are kept, chosen by their own content so that both copies keep
the same ones (Schleimer, Wilkerson & Aiken, "Winnowing: local algorithms for document fingerprinting", SIGMOD 2003).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.pulse import beat

Index = NDArray[np.int64]

# Levels per range of the drive. The coarse grid is blind to read-back noise up to 1e-3 of the range (a description
# of 8 samples survives in both copies with 40 % chance); the finer ones see loops that are small within the range.
_GRIDS = (2**6, 2**10, 2**14)
_N_DESCRIBED = 8
_N_EVENTS_MAX = 250_000
_N_PROPOSALS = 64
# An event may miss its partner, for noise put one of the 8 samples over a level: with the 40 % above, 16 events in
# a row miss in 3 of 10 000 places.
_LONGEST_MISS = 16
_N_PERIOD_MIN = 4
_N_SETTLED_MIN = 32
_ROUNDING = 1e-9
# Read-back noise may be this share of the drive's range in the stretch; at 0.1 % what the actuator makes of it
# is proportional to it, and is taken out of the displacement by regression.
_MISMATCH_MAX = 1e-3
_MISMATCH_CORRELATION = 0.5
_N_SIGMA = 6.0


@dataclass(frozen=True)
class Repeat:
    """A stretch of a drive that comes back.

    Attributes:
        start: first sample of the stretch.
        stop: sample after its last one.
        period_samples: lag at which it comes back: samples ``start`` to ``stop`` equal samples
            ``start + period_samples`` to ``stop + period_samples``; one longer than its lag holds several periods.
        settled: first sample of the stretch at which its highest and its lowest voltage have both been passed: from
            there the memory of hysteresis is that of the copy (wiping-out property of Prandtl-Ishlinskii and Preisach
            operators), but for plays that the stretch moves in neither copy.
        mismatch_v: rms difference of the two copies [V]; zero but for rounding where the drive was not read back.
    """

    start: int
    stop: int
    period_samples: int
    settled: int
    mismatch_v: float

    @property
    def n_periods(self) -> float:
        """Number of periods from the first sample to the end of the last copy."""
        return 1.0 + (self.stop - self.start) / self.period_samples


def find_repeats(voltage_v: Array) -> tuple[Repeat, ...]:
    """Return the stretches in which the drive repeats itself, longest first, none over another.

    A stretch has to pass its highest and its lowest voltage and still go on for 32 samples, or it says nothing of
    noise: what comes before carries the hysteresis of another past.

    Args:
        voltage_v: drive [V], evenly sampled, shape (n_samples,); commanded or read back.

    Returns:
        The repeats; none where there are none. Time n log n: about 1 s for 10^6 samples.
    """
    v = np.asarray(voltage_v, dtype=np.float64)
    if v.size < 2 * _N_SETTLED_MIN or float(np.ptp(v)) == 0.0:
        return ()
    found: list[Repeat] = []
    for n_levels in _GRIDS:
        verified = [_verified(v, *proposal) for proposal in _proposals(v, n_levels, found)]
        for repeat in sorted((r for r in verified if r is not None), key=lambda r: r.start - r.stop):
            if not any(_overlap(repeat, other) for other in found):
                found.append(repeat)
    return tuple(sorted(found, key=lambda r: r.start - r.stop))


def _proposals(v: Array, n_levels: int, found: list[Repeat]) -> list[tuple[int, int, int]]:
    """Return the (first, last, lag) of diagonals that look longest, at most a fixed number of them."""
    low, span = float(np.min(v)), float(np.ptp(v))
    # the golden ratio: no level falls on a value of a drive that moves in even steps
    levels = np.floor((v - low) * (n_levels / span) + 0.6180339887).astype(np.int64)
    events = np.flatnonzero(levels[1:] != levels[:-1]) + 1
    for repeat in found:
        outside = (events < repeat.start) | (events >= repeat.stop + repeat.period_samples)
        events = events[outside]
    keep = -(-events.size // _N_EVENTS_MAX)
    if keep > 1:
        events = events[_hashed(levels[events - 1], levels[events]) % np.uint64(keep) == 0]
    if events.size < 2:
        return []
    ranks = np.arange(events.size)
    diagonals: list[tuple[int, int, int, int]] = []
    step = 1
    while _N_DESCRIBED * step < v.size // 2:
        diagonals += _diagonals(levels, events, ranks, step)
        step *= 4
    longest = sorted(diagonals, key=lambda d: d[0], reverse=True)[:_N_PROPOSALS]
    fullest = sorted(diagonals, key=lambda d: d[1] - d[2], reverse=True)[: _N_PROPOSALS // 2]
    return sorted({(first, last, lag) for _, last, first, lag in (*longest, *fullest)}, key=lambda d: d[0] - d[1])


def _diagonals(levels: Index, events: Index, ranks: Index, step: int) -> list[tuple[int, int, int, int]]:
    """Return (number of events, last, first, lag) of runs of events that propose one lag."""
    inside = events + (_N_DESCRIBED - 1) * step < levels.size
    at, rank = events[inside], ranks[inside]
    described = [levels[at + k * step] for k in range(_N_DESCRIBED)]
    moves = np.max(described, axis=0) - np.min(described, axis=0) >= 2
    name = _hashed(*described, levels[at - 1])[moves]
    at, rank = at[moves], rank[moves]
    order = np.argsort(name, kind="stable")
    name, at, rank = name[order], at[order], rank[order]
    lag = at[1:] - at[:-1]
    proposes = (name[1:] == name[:-1]) & (lag >= _N_PERIOD_MIN)
    first, rank, lag = at[:-1][proposes], rank[:-1][proposes], lag[proposes]
    if not lag.size:
        return []
    order = np.lexsort((first, lag))
    first, rank, lag = first[order], rank[order], lag[order]
    breaks = np.flatnonzero((lag[1:] != lag[:-1]) | (rank[1:] - rank[:-1] > _LONGEST_MISS))
    starts, stops = np.concatenate(([0], breaks + 1)), np.concatenate((breaks, [lag.size - 1]))
    counts = stops - starts + 1
    long = np.argsort(counts, kind="stable")[::-1][:_N_PROPOSALS]
    far = np.argsort(first[stops] - first[starts], kind="stable")[::-1][:_N_PROPOSALS]
    chosen = np.union1d(long, far)
    return [(int(counts[i]), int(first[stops[i]]), int(first[starts[i]]), int(lag[starts[i]])) for i in chosen]


def _hashed(*columns: Index) -> NDArray[np.uint64]:
    """Return one number for each row: a multiplicative hash of its values."""
    value = np.zeros(columns[0].size, dtype=np.uint64)
    for column in columns:
        value = (value ^ column.astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
        value ^= value >> np.uint64(29)
    return value


def _verified(v: Array, first: int, last: int, lag: int) -> Repeat | None:
    """Return the stretch around a proposed diagonal in which the two copies agree; None where they do not."""
    beat("comparisons")
    stop = min(last + 1, v.size - lag)
    if stop - first < 2:
        return None
    difference = v[first + lag : stop + lag] - v[first:stop]
    span = float(np.ptp(v[first : stop + lag]))
    rounding = _ROUNDING * float(np.max(np.abs(v[first : stop + lag])))
    mismatch = 1.4826 * float(np.median(np.abs(difference)))
    if mismatch > _MISMATCH_MAX * span:
        return None
    tolerance = max(_N_SIGMA * mismatch, rounding)
    start, stop = _extended(v, lag, (first + stop) // 2, tolerance)
    if stop - start < _N_SETTLED_MIN:
        return None
    same, copy = v[start:stop], v[start + lag : stop + lag]
    mismatch = float(np.sqrt(np.mean((copy - same) ** 2)))
    if mismatch > rounding and not _is_read_back(copy - same, mismatch, float(np.ptp(same))):
        return None
    reach = max(2.0 * tolerance, rounding)
    once = same[: lag + 1]
    settled = start + max(
        int(np.argmax(once >= np.max(same) - reach)),
        int(np.argmax(once <= np.min(same) + reach)),
    )
    # the two turns have to be turns of the drive, not of its noise
    if float(np.ptp(same)) < 20.0 * tolerance or stop - settled < _N_SETTLED_MIN:
        return None
    return Repeat(start, stop, lag, settled, mismatch)


def _is_read_back(difference: Array, mismatch_v: float, span_v: float) -> bool:
    """Return whether two copies differ by read-back noise: small, and new at each sample, as a drift is not."""
    if mismatch_v > _MISMATCH_MAX * span_v:
        return False
    centred = difference - np.mean(difference)
    power = float(np.dot(centred, centred))
    return power == 0.0 or float(np.dot(centred[1:], centred[:-1])) < _MISMATCH_CORRELATION * power


def _extended(v: Array, lag: int, middle: int, tolerance: float) -> tuple[int, int]:
    """Return the stretch about a sample over which the drive equals itself a lag later."""
    n = v.size - lag
    middle = min(middle, n - 1)
    stop, block = middle, 1024
    while stop < n:
        end = min(stop + block, n)
        differs = np.abs(v[stop + lag : end + lag] - v[stop:end]) > tolerance
        if differs.any():
            stop += int(np.argmax(differs))
            break
        stop, block = end, 2 * block
    start, block = middle, 1024
    while start > 0:
        begin = max(start - block, 0)
        differs = np.abs(v[begin + lag : start + lag] - v[begin:start]) > tolerance
        if differs.any():
            start -= int(np.argmax(differs[::-1]))
            break
        start, block = begin, 2 * block
    return start, stop


def _overlap(one: Repeat, other: Repeat) -> bool:
    return one.start < other.stop + other.period_samples and other.start < one.stop + one.period_samples

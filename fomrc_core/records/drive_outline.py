"""Which samples of a drive are kept where a record is thinned: one in each bin, its turns and jumps among them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.compiled import compiled

Index = NDArray[np.int64]

# Of the kept samples: those that only follow the drive have no reading of their own, and noise is told from readings
# side by side.
_MOST_ADDED = 0.04
# Of the range of the drive: from what a creep of some hundredths makes invisible to what counts as a turn.
_FINEST, _COARSEST = 1e-4, 0.02
_N_PENDING = 128  # halves of an interval still to be looked at: its logarithm would do


@dataclass(frozen=True, eq=False)
class DriveOutline:
    """The samples kept of a drive.

    Attributes:
        n_in_bin: samples of a bin, odd.
        samples: those kept, rising, shape (n_kept,): the first of the record, then one a bin, and those added.
        bin_of: bin each stands for, -1 for one that only follows the drive, shape (n_kept,).
        tolerance_v: furthest the drive is from straight lines between them [V].
    """

    n_in_bin: int
    samples: Index
    bin_of: Index
    tolerance_v: float

    @property
    def n_bins(self) -> int:
        """Number of bins."""
        return int(np.max(self.bin_of)) + 1


def drive_outline(time_s: Array, voltage_v: Array, n_in_bin: int) -> DriveOutline | None:
    """Return the samples to keep; None where the drive moves too fast for bins as long.

    A play remembers extremes only, so between kept samples the drive may bend, but it may not turn or jump: there the
    kept sample of a bin is moved to the turn, and others are added.

    Args:
        time_s: sample times [s], shape (n_samples,).
        voltage_v: drive [V], shape (n_samples,).
        n_in_bin: samples of a bin, odd.
    """
    n_bins = voltage_v.size // n_in_bin
    range_v = float(np.ptp(voltage_v))
    tolerance_v = _FINEST * range_v
    while tolerance_v <= _COARSEST * range_v:
        centres = np.arange(n_bins, dtype=np.int64) * n_in_bin + n_in_bin // 2
        kept = np.zeros(voltage_v.size, dtype=np.bool_)
        kept[centres] = True
        kept[0] = True
        _mark_bends(time_s, voltage_v, kept, tolerance_v)
        centres = _moved_to_bends(kept, centres, n_in_bin)
        kept[:] = False
        kept[centres] = True
        kept[0] = True
        _mark_bends(time_s, voltage_v, kept, tolerance_v)
        samples = np.flatnonzero(kept)
        if samples.size - n_bins <= max(_MOST_ADDED * n_bins, 1.0):
            bin_of = np.full(samples.size, -1, dtype=np.int64)
            bin_of[np.searchsorted(samples, centres)] = np.arange(n_bins)
            return DriveOutline(n_in_bin, samples, bin_of, tolerance_v)
        tolerance_v *= 2.0
    return None


def _moved_to_bends(kept: Mask, centres: Index, n_in_bin: int) -> Index:
    """Return the kept sample of each bin, moved to the first bend in it."""
    bends = np.flatnonzero(kept)
    bins = bends // n_in_bin
    inside = (bins < centres.size) & (bends > 0)
    bends, bins = bends[inside], bins[inside]
    is_bend = bends != centres[bins]
    moved = centres.copy()
    # written from the last to the first: the first bend of a bin stays
    moved[bins[is_bend][::-1]] = bends[is_bend][::-1]
    found: Index = moved
    return found


@compiled
def _mark_bends(time_s: Array, voltage_v: Array, kept: Mask, tolerance_v: float) -> None:
    """Mark the samples furthest from straight lines between marked ones (Douglas and Peucker), until none is far."""
    lefts, rights = np.empty(_N_PENDING, dtype=np.int64), np.empty(_N_PENDING, dtype=np.int64)
    begin = 0
    for end in range(1, voltage_v.size):
        if not kept[end]:
            continue
        lefts[0], rights[0] = begin, end
        n_pending = 1
        begin = end
        while n_pending > 0:
            n_pending -= 1
            left, right = lefts[n_pending], rights[n_pending]
            slope = (voltage_v[right] - voltage_v[left]) / (time_s[right] - time_s[left])
            furthest, at = tolerance_v, -1
            for k in range(left + 1, right):
                off = abs(voltage_v[k] - voltage_v[left] - slope * (time_s[k] - time_s[left]))
                if off > furthest:
                    furthest, at = off, k
            if at >= 0 and n_pending + 2 <= _N_PENDING:
                kept[at] = True
                lefts[n_pending], rights[n_pending] = left, at
                lefts[n_pending + 1], rights[n_pending + 1] = at, right
                n_pending += 2

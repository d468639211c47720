"""Faults of the clock that its stamps show: samples that are missing, and steps that are not all alike."""

from __future__ import annotations

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.records.quality.faults import DataFault, FaultKind

_GAP = 1.5  # median steps: a sample is missing
_GAP_SHARE_MAX = 0.02  # where more steps are long the clock is uneven
_UNEVEN = 1e-3  # rms of the steps in median steps: less is the last digit of a stamp


def clock_faults(time_s: Array) -> tuple[DataFault, ...]:
    """Return what is wrong with stamps [s], shape (n_samples,); nothing of it is masked.

    A model takes steps of any length, the drive straight between samples, so the samples themselves are sound.
    """
    steps = np.diff(time_s)
    relative = steps / float(np.median(steps))
    long = np.flatnonzero(relative > _GAP)
    found, nothing = [], np.zeros(0)
    if 0 < long.size <= max(_GAP_SHARE_MAX * steps.size, 1.0):
        found.append(DataFault(FaultKind.GAPS, long + 1, time_s[long + 1], float(np.max(relative)), False, nothing))
        relative = np.delete(relative, long)
    uneven = float(np.sqrt(np.mean((relative - 1.0) ** 2)))
    # stamps of few digits jitter by their last one
    digits = 4e-16 * float(np.max(np.abs(time_s))) / float(np.median(steps))
    if uneven > max(_UNEVEN, digits):
        at = np.flatnonzero(np.abs(steps / float(np.median(steps)) - 1.0) > uneven) + 1
        found.append(DataFault(FaultKind.UNEVEN_CLOCK, at, time_s[at], uneven, False, nothing))
    return tuple(found)

"""Whether what befell records came with their beginnings: then it is no event, but what went before them.

A load comes when it comes. What the model gets wrong of the first way of the drive, as a loop that begins in another
state than it knows, looks like one soon after the start, and in every record. How near to their beginnings moments
that have nothing to do with them would come by chance is known at any scale (Fisher, 1932).
"""

from __future__ import annotations

import math

import numpy as np

from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.trial_model import TrialModel

_BY_CHANCE = 0.01  # how seldom moments without a reason come as near to the beginnings, all together
_MOVED = 1e-3  # of the drive's range: before it has gone so far no memory acts


def comes_with_the_start(model: TrialModel, split: DataSplit, cause: str) -> bool:
    """Return whether a cause that comes at a moment does so soon after the beginnings of all records it was found in.

    One record alone says nothing, for some moment it must be, nor does one in which the drive still rests.

    Args:
        model: with the cause, followed in the held-out records as well.
        split: records.
        cause: its name.
    """
    records = dict(enumerate(split.train)) | {part.index: part.record for part in (*split.held, *split.report)}
    shares = []
    for index, found in model.found():
        if index not in records or found.name != cause or not found.moved_moments:
            continue
        moment_s, record = float(getattr(found, found.moved_moments[0])), records[index]
        if not _has_moved(record, moment_s):
            return False
        shares.append(min(max(moment_s / float(np.ptp(record.time_s)), 1e-9), 1.0))
    if len(shares) < 2:
        return False
    less = -sum(math.log(share) for share in shares)
    chance = math.exp(-less) * sum(less**k / math.factorial(k) for k in range(len(shares)))
    return chance < _BY_CHANCE


def _has_moved(record: FitRecord, until_s: float) -> bool:
    """Return whether the drive has moved by the first sample after a moment."""
    last = int(np.searchsorted(record.time_s - record.time_s[0], until_s, side="right"))
    return float(np.ptp(record.voltage_v[: last + 1])) > _MOVED * float(np.ptp(record.voltage_v))

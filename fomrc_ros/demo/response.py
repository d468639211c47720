"""How a stage answered, judged on what arrived: samples taken while the machine stood still say nothing of the stage.

Target, compensator and stage are processes that tick on their own. Where one of them is not given a processor for
some ticks, the stage is behind the target for no fault of the compensation. Such a stall shows in the times of what
the process sent, and in how long it waited for a processor; its samples are left out of the figures of merit, not
out of the record.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.records.residual import nonlinearity_percent, normalised_percent, rms

# More than three ticks of 2 ms. At 1.2 um/s the target moves 8 nm in that time, half of what figure 16
# allows (0.65 % of 2.4 um is 16 nm).
STALL_S = 7e-3
# Until the stage is back on the target: a tick of each process, and the transport between them.
_RECOVERY_S = 5e-3
# Less says too little to judge by: of the samples that arrived, and of the range of the target.
_LEAST_SHARE = 0.1
_LEAST_RANGE = 0.9


class Verdict(Enum):
    """What came of an experiment."""

    MET = "met"
    MISSED = "missed"
    NOT_JUDGED = "not judged"


@dataclass(frozen=True, eq=False)
class Response:
    """How a stage answered; arrays of shape (n_samples,).

    Attributes:
        time_s: times of measurement, by the stage's stamps, from the first target on [s].
        desired_um: desired displacement at these times [um].
        measured_um: measured displacement [um].
        is_judged: samples taken while no process stood still.
        duration_s: how long the experiment took [s].
        stalled_s: for how much of it some process stood still or waited for a processor [s].
        longest_stall_s: the longest stretch of that [s].
    """

    time_s: Array
    desired_um: Array
    measured_um: Array
    is_judged: Mask
    duration_s: float
    stalled_s: float
    longest_stall_s: float

    @property
    def judged_share(self) -> float:
        """Which share of the samples that arrived is judged; 0 where none arrived."""
        return float(np.mean(self.is_judged)) if self.is_judged.size else 0.0

    @property
    def can_be_judged(self) -> bool:
        """Whether enough is left to judge by: samples, and most of the range of the target."""
        if self.judged_share < _LEAST_SHARE:
            return False
        return float(np.ptp(self.desired_um[self.is_judged])) >= _LEAST_RANGE * float(np.ptp(self.desired_um))

    @property
    def nrmse_percent(self) -> float:
        """100 RMSE over the range of the desired displacement; NaN where nothing can be judged."""
        if not self.can_be_judged:
            return float("nan")
        error_um = rms((self.measured_um - self.desired_um)[self.is_judged])
        return normalised_percent(error_um, [self.desired_um])

    @property
    def nonlinearity_percent(self) -> float:
        """Largest deviation from the best straight line, of the largest displacement; NaN where none can be told."""
        if not self.can_be_judged:
            return float("nan")
        return nonlinearity_percent(self.desired_um[self.is_judged], self.measured_um[self.is_judged])

    def verdict(self, percent: float, allowed_percent: float) -> Verdict:
        """Return whether one of its figures of merit is within what is allowed."""
        if not self.can_be_judged:
            return Verdict.NOT_JUDGED
        return Verdict.MET if percent <= allowed_percent else Verdict.MISSED


def percent_or_not(percent: float) -> str:
    """Return a figure of merit as people read it, also where none could be judged."""
    return Verdict.NOT_JUDGED.value if math.isnan(percent) else f"{percent:.2f} %"


def response_of(sent: Array, seen: Array, waited: Array, others_s: Sequence[Array] = ()) -> Response:
    """Return the response of a stage.

    Args:
        sent: time [s] and value [um] of each target, shape (n_targets, 2).
        seen: the stage's stamp [s] and displacement [um] of each measurement that arrived, shape (n_measurements, 2).
        waited: when it was looked [s], and how long some process had waited for a processor since the last look [s],
            shape (n_looks, 2).
        others_s: when signs of life of other processes arrived [s], each of shape (n_signs,).
    """
    begin_s, end_s = float(sent[0, 0]), float(sent[-1, 0])
    inside = (seen[:, 0] >= begin_s) & (seen[:, 0] <= end_s)
    time_s, measured_um = seen[inside, 0], seen[inside, 1]
    silences = [_silences(times_s, begin_s, end_s) for times_s in (sent[:, 0], time_s, *others_s)]
    stalls = _merged(np.vstack([*silences, _waits(waited, begin_s, end_s)]))
    lengths_s = stalls[:, 1] - stalls[:, 0]
    # in a stall is who comes after the last begin, and before its end
    place = np.searchsorted(stalls[:, 0], time_s, side="left") - 1
    ends_s = np.concatenate((stalls[:, 1], [-np.inf]))[place]
    return Response(
        time_s - begin_s,
        np.interp(time_s, sent[:, 0], sent[:, 1]),
        measured_um,
        time_s > ends_s + _RECOVERY_S,
        end_s - begin_s,
        float(np.sum(lengths_s)),
        float(np.max(lengths_s, initial=0.0)),
    )


def _silences(times_s: Array, begin_s: float, end_s: float) -> Array:
    """Return begin and end [s] of the stretches in which nothing came, shape (n_stalls, 2)."""
    within = np.sort(times_s[(times_s >= begin_s) & (times_s <= end_s)])
    ticks = np.concatenate(([begin_s], within, [end_s]))
    is_long = np.diff(ticks) > STALL_S
    return np.column_stack((ticks[:-1][is_long], ticks[1:][is_long]))


def _waits(waited: Array, begin_s: float, end_s: float) -> Array:
    """Return begin and end [s] of the looks in which some process waited long, shape (n_stalls, 2)."""
    looked_s, waits_s = waited[:, 0], waited[:, 1]
    # a wait is counted when it ends: it may have begun before the last look
    begun_s = np.minimum(np.concatenate(([begin_s], looked_s[:-1])), looked_s - waits_s)
    is_long = waits_s > STALL_S
    stretches: Array = np.column_stack((begun_s[is_long], looked_s[is_long]))
    return stretches.clip(begin_s, end_s)


def _merged(stalls: Array) -> Array:
    """Return the stretches in order, those that overlap joined."""
    joined: list[list[float]] = []
    for begin_s, end_s in stalls[np.argsort(stalls[:, 0])].tolist():
        if joined and begin_s <= joined[-1][1]:
            joined[-1][1] = max(joined[-1][1], end_s)
        else:
            joined.append([begin_s, end_s])
    return np.array(joined).reshape(-1, 2)

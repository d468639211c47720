"""What records are like for which terms are offered that follow what no cause explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fomrc_core.effects.base.covariates import Covariate

_N_LAGS = 6  # offered, from one sample to a third of the record, in even ratios
_LONGEST_LAG = 1.0 / 3.0
_N_MEMORIES = 9  # from half a sample to what hardly fades in a record
_SHORTEST_MEMORY, _LONGEST_MEMORY = 0.5, 3.0  # of a sample, of the record
_SHORTEST_SWING, _LONGEST_SWING = 3.0, 0.05  # samples, of the record: twenty swings of it tell it from memory
_SWING_RATIO = 1.5  # of periods offered one after the other: within what a damped swing answers to


@dataclass(frozen=True)
class TermScales:
    """What the records are like that terms are offered for.

    Attributes:
        span_um: largest displacement of them [um].
        step_s: sample period [s].
        duration_s: length of the longest [s].
        columns: middle and half the range of each signal that all of them have, in its unit.
        drive_period_v: period of the voltage with which what is left comes back [V]; None where it does not.
        ringing_hz: frequencies at which the rate of what is left has most power [Hz].
    """

    span_um: float
    step_s: float
    duration_s: float
    columns: Mapping[Covariate, tuple[float, float]]
    drive_period_v: float | None = None
    ringing_hz: tuple[float, ...] = ()

    @property
    def lags_s(self) -> list[float]:
        """Return the time constants that are offered [s]."""
        longest_s = max(_LONGEST_LAG * self.duration_s, 2.0 * self.step_s)
        return [float(t) for t in np.geomspace(self.step_s, longest_s, _N_LAGS)]

    @property
    def memories_s(self) -> list[float]:
        """Return the time constants of linear memory that are offered [s]: beyond a record's end it is an integral."""
        longest_s = max(_LONGEST_MEMORY * self.duration_s, 2.0 * self.step_s)
        return [float(t) for t in np.geomspace(_SHORTEST_MEMORY * self.step_s, longest_s, _N_MEMORIES)]

    @property
    def swings_s(self) -> list[float]:
        """Return the periods of swings that are offered [s]."""
        shortest_s = _SHORTEST_SWING * self.step_s
        longest_s = max(_LONGEST_SWING * self.duration_s, 2.0 * shortest_s)
        n_periods = 1 + int(np.ceil(np.log(longest_s / shortest_s) / np.log(_SWING_RATIO)))
        return [float(t) for t in np.geomspace(shortest_s, longest_s, n_periods)]

"""What records are like for which terms are offered that follow what no cause explains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fomrc_core.effects.base.covariates import Covariate

_N_LAGS = 6  # offered, from one sample to a third of the record, in even ratios
_LONGEST_LAG = 1.0 / 3.0


@dataclass(frozen=True)
class TermScales:
    """What the records are like that terms are offered for.

    Attributes:
        span_um: largest displacement of them [um].
        step_s: sample period [s].
        duration_s: length of the longest [s].
        columns: middle and half the range of each signal that all of them have, in its unit.
    """

    span_um: float
    step_s: float
    duration_s: float
    columns: Mapping[Covariate, tuple[float, float]]

    @property
    def lags_s(self) -> list[float]:
        """Return the time constants that are offered [s]."""
        longest_s = max(_LONGEST_LAG * self.duration_s, 2.0 * self.step_s)
        return [float(t) for t in np.geomspace(self.step_s, longest_s, _N_LAGS)]

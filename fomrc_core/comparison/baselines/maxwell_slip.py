"""Maxwell-slip (parallel Iwan) model, equations (1)-(2): springs and sliders alone, the voltage as the force.

Every element slips somewhere; beyond the last threshold the force stays and the displacement would be
undefined. So the last element is given a breakaway force beyond the record. Goldfarb and Celanovic 1997
(reference 12); Al-Bender, Lampaert and Swevers 2004 (reference 17).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from fomrc_core.comparison.baselines.mrc import FittedStops, fitted_stops
from fomrc_core.comparison.baselines.rival import Rival, TrainingRecord


@dataclass(frozen=True)
class MaxwellSlip(Rival):
    """Springs with sliders in parallel.

    Args:
        n_elements: number of elements.
    """

    n_elements: int = 8
    name: str = field(default="Maxwell-slip", init=False)
    publication: str = field(default="Maxwell; Goldfarb and Celanovic 1997; Al-Bender et al. 2004", init=False)

    def fit(self, records: Sequence[TrainingRecord]) -> FittedStops:
        """Return the rival fitted on the voltage."""
        return fitted_stops(records, self.n_elements - 1, has_last=False)

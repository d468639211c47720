"""Maxwell resistive capacitor without creep, equations (15)-(17): Goldfarb and Celanovic 1997, reference 13.

Fitted where it is linear, on the voltage: ``u = sum_i (1/kappa_i) stop_i(x) + x / kappa_{n+1}`` over a grid
of thresholds, weights not negative. Its forward direction is a Prandtl-Ishlinskii operator (reference 6),
so as a model it is the classical one of these with another fit; both are in the comparison since both are
in the paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fomrc_core.comparison.baselines.prandtl_ishlinskii import PlaySum, plays
from fomrc_core.comparison.baselines.rival import FittedRival, Rival, TrainingRecord
from fomrc_core.compute.least_squares import non_negative_fit
from fomrc_core.errors import ParameterError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FittedStops(FittedRival):
    """A sum of stops of the displacement gives the voltage; its closed-form inverse gives the displacement.

    Attributes:
        thresholds_um: kappa_i u_S,i [um], ascending, shape (n,).
        compliance_v_per_um: 1 / kappa_i [V/um], shape (n,).
        last_v_per_um: 1 / kappa_{n+1} [V/um].
    """

    thresholds_um: Array
    compliance_v_per_um: Array
    last_v_per_um: float

    @property
    def n_parameters(self) -> int:
        """Thresholds and compliances of the elements, and that of the last where there is one."""
        return 2 * int(self.thresholds_um.size) + (1 if self.last_v_per_um > 0.0 else 0)

    def _voltage_of_displacement(self) -> PlaySum:
        # stop_r = identity - play_r. Without element n + 1 the widest element is taken as never saturating:
        # its threshold lies beyond the record, and past it no displacement would belong to a voltage.
        total = float(self.compliance_v_per_um.sum()) + self.last_v_per_um
        n = self.thresholds_um.size if self.last_v_per_um > 0.0 else self.thresholds_um.size - 1
        return PlaySum(np.append(0.0, self.thresholds_um[:n]), np.append(total, -self.compliance_v_per_um[:n]))

    def simulate(self, steps_s: Array, voltage_v: Array) -> Array:
        """Return the displacement [um], shape (n_samples,)."""
        return self._voltage_of_displacement().inverted().forward(voltage_v)

    def invert(self, steps_s: Array, desired_um: Array) -> Array:
        """Return the drive [V], shape (n_samples,)."""
        return self._voltage_of_displacement().forward(desired_um)


def fitted_stops(records: Sequence[TrainingRecord], n_thresholds: int, has_last: bool) -> FittedStops:
    """Return the stops fitted on the voltage, with or without the element that never saturates.

    Args:
        records: to fit on.
        n_thresholds: size of the grid of thresholds; those not needed come out with no weight.
        has_last: whether there is an element n + 1.

    Raises:
        ParameterError: no element is determined.
    """
    largest = max(float(np.ptp(r.displacement_um[r.is_scored])) for r in records)
    # A stop wider than half the range never saturates on the record's loops: there its threshold is unknown.
    reach = 0.45 * largest
    thresholds = reach * (np.arange(1, n_thresholds + 1) / n_thresholds) ** 1.5
    if not has_last:
        thresholds = np.append(thresholds, 1.5 * largest)
    columns, targets = [], []
    for record in records:
        x = record.displacement_um - record.displacement_um[0]
        stops = x[:, None] - plays(np.ascontiguousarray(x), thresholds)
        basis = np.column_stack([stops, x]) if has_last else stops
        columns.append(record.centred(basis))
        targets.append(record.centred(record.voltage_v))
    weights = non_negative_fit(columns, targets)
    compliance, last = (weights[:-1], float(weights[-1])) if has_last else (weights, 0.0)
    kept = compliance > 0.0
    if not (last > 0.0 or (not has_last and compliance[-1] > 0.0)):
        raise ParameterError(
            "record does not determine the element that carries on",
            where="stops",
            allowed="a record whose voltage rises with displacement",
        )
    return FittedStops(thresholds[kept], compliance[kept], last)


@dataclass(frozen=True)
class MaxwellResistiveCapacitor(Rival):
    """The paper's model without creep.

    Args:
        n_thresholds: size of the grid of thresholds.
    """

    n_thresholds: int = 16
    name: str = field(default="MRC without creep", init=False)
    publication: str = field(default="Goldfarb and Celanovic 1997; this form (15)-(17)", init=False)

    def fit(self, records: Sequence[TrainingRecord]) -> FittedStops:
        """Return the rival fitted on the voltage."""
        return fitted_stops(records, self.n_thresholds, has_last=True)

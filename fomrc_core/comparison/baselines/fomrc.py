"""The FOMRC model of this project in the dress of a rival, so that the same comparison scores it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fomrc_core.comparison.baselines.rival import FittedRival, Rival, TrainingRecord
from fomrc_core.identification.convex import identify
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.recording import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FittedFomrc(FittedRival):
    """A model of this project.

    Attributes:
        model: the model.
    """

    model: PiezoModel

    @property
    def n_parameters(self) -> int:
        """Gains, saturation voltages, the creep order and the parameters of every effect."""
        total = 2 * self.model.n_elements + 2
        for effect in self.model.effects:
            for name, value in effect.to_mapping().items():
                # Lists are weights on a grid that is laid, not fitted; the grid itself is not counted.
                if not isinstance(value, list):
                    total += 1
                elif name in effect.linear_parameters:
                    total += int(np.count_nonzero(value))
        return total

    def simulate(self, steps_s: Array, voltage_v: Array) -> Array:
        """Return the displacement [um], shape (n_samples,)."""
        return self.model.simulate(steps_s, voltage_v)

    def invert(self, steps_s: Array, desired_um: Array) -> Array:
        """Return the drive [V], shape (n_samples,)."""
        return Compensator(self.model).run(steps_s, desired_um)


@dataclass(frozen=True)
class Fomrc(Rival):
    """The model of the paper, identified by the convex route.

    Args:
        n_elements: number of saturating elements.
    """

    n_elements: int = 10
    name: str = field(default="FOMRC", init=False)
    publication: str = field(default="Liu, Shan, Gabbert and Qi 2013", init=False)

    def fit(self, records: Sequence[TrainingRecord]) -> FittedFomrc:
        """Return the identified model."""
        return FittedFomrc(identify([measured_part(r) for r in records], n_elements=self.n_elements).model)


def measured_part(record: TrainingRecord) -> Recording:
    """Return the record without what was put before it."""
    part = slice(record.n_before, None)
    return Recording(np.cumsum(record.steps_s[part]), record.voltage_v[part], record.displacement_um[part])

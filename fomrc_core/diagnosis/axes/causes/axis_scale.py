"""An axis moves, or is measured, by a factor: a wrong sensitivity, a wrong gain, or a wrong sign."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.diagnosis.axes.cause import AxesCause, AxesEvidence
from fomrc_core.diagnosis.axes.causes.mixing import inputs_mixed, outputs_mixed
from fomrc_core.model.axes import AxesModel


@dataclass(frozen=True, eq=False)
class AxisScale(AxesCause):
    """Factor 1 + value on one sensor or one drive.

    Attributes:
        axis: which, from 0.
        is_drive: whether on the drive's side.
    """

    name: ClassVar[str] = "axis_scale"
    meaning: ClassVar[str] = "An axis's sensor or amplifier has another gain, or the other sign, than the model."
    signature: ClassVar[str] = "the residual of one axis is a share of its displacement, the same at all frequencies"
    experiment: ClassVar[str] = "step each axis by itself and compare with a ruler that is known"

    axis: int = 0
    is_drive: bool = False

    @property
    def kind(self) -> str:
        """Whether the sign or the scale is wrong."""
        return "sign" if self.values[0] < -1.0 else "scale"

    @classmethod
    def trials(cls, evidence: AxesEvidence) -> list[AxesCause]:
        """Return each sensor and each drive."""
        model = evidence.model
        sensors: list[AxesCause] = [cls(np.zeros(1), o) for o in range(model.n_outputs)]
        return sensors + [cls(np.zeros(1), i, True) for i in range(model.n_inputs)]

    def applied(self, model: AxesModel) -> AxesModel:
        """Return the model with the factor."""
        factor = np.ones(model.n_inputs if self.is_drive else model.n_outputs)
        factor[self.axis] += self.values[0]
        return inputs_mixed(model, np.diag(factor)) if self.is_drive else outputs_mixed(model, np.diag(factor))

    def parameters(self, model: AxesModel) -> Mapping[str, float | str | list[float]]:
        """Return axis, side and factor [1]."""
        return {
            "axis": float(self.axis + 1),
            "side": "drive" if self.is_drive else "sensor",
            "factor": float(1.0 + self.values[0]),
        }

    def is_plausible(self) -> bool:
        """Return whether the axis moves at all: a factor of nothing is a dead axis."""
        return abs(1.0 + float(self.values[0])) > 0.02

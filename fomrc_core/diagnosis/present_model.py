"""The model a search has come to, and what of the training records it leaves: what every candidate is compared with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import Tangent, residuals, squared_error, tangent
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.noise import autocorrelation_inflation


@dataclass(frozen=True, eq=False)
class PresentModel:
    """The present model on the records it was fitted to.

    Attributes:
        model: the model.
        records: the records.
        directions: tangent of its linear part.
        noise_um: noise floor [um].
    """

    model: TrialModel
    records: tuple[FitRecord, ...]
    directions: Tangent
    noise_um: float

    @classmethod
    def of(cls, model: TrialModel, split: DataSplit) -> PresentModel:
        """Return the model on the training records."""
        return cls(model, split.train, tangent(model, split.train), split.noise_um)

    @cached_property
    def residuals_um(self) -> tuple[Array, ...]:
        """Measured minus predicted, offset removed [um], per record."""
        return residuals(self.model, self.records)

    @cached_property
    def clear_um(self) -> tuple[Array, ...]:
        """The residuals less what the linear part could explain of them [um], per record."""
        return self.directions.remove(self.records, self.residuals_um)

    @cached_property
    def predicted_um(self) -> tuple[Array, ...]:
        """Predicted displacement [um], jumps alone divided, per record."""
        return tuple(predict(self.model, record, i, is_coarse=True) for i, record in enumerate(self.records))

    @property
    def squared_error(self) -> float:
        """Sum of squares of the residuals over the used samples [um^2]."""
        return squared_error(self.records, self.residuals_um)


def residual_inflation(residuals_um: tuple[Array, ...], records: tuple[FitRecord, ...]) -> float:
    """Return by how much the correlation of what is left [um] widens standard errors, in the worst of the records."""
    return max(autocorrelation_inflation(v[r.is_used]) for v, r in zip(residuals_um, records, strict=True))

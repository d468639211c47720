"""The model a search has come to, and what of the training records it leaves: what every candidate is compared with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.least_squares import gram_of, whitening_of
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.free_parameters import free_parameters
from fomrc_core.fitting.joint_fit import effect_directions
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
        """The residuals less what the model, moved, could explain of them [um], per record."""
        return self.nuisance.remove(self.records, self.residuals_um)

    @cached_property
    def predicted_um(self) -> tuple[Array, ...]:
        """Predicted displacement [um], jumps alone divided, per record."""
        return tuple(predict(self.model, record, i, is_coarse=True) for i, record in enumerate(self.records))

    @cached_property
    def nuisance(self) -> Tangent:
        """Every direction in which the model can move, those of its effects behind those of the linear part.

        What a further cause explains must be told from what the present ones could, moved beside it (Rao, 1948:
        large sample tests of statistical hypotheses concerning several parameters).
        """
        return with_effects(self.directions, self.model, self.records)

    @property
    def squared_error(self) -> float:
        """Sum of squares of the residuals over the used samples [um^2]."""
        return squared_error(self.records, self.residuals_um)


def with_effects(directions: Tangent, model: TrialModel, records: tuple[FitRecord, ...]) -> Tangent:
    """Return the directions of the linear part with those of the effects of a model behind them."""
    free = free_parameters(model)
    if not free:
        return directions
    added = effect_directions(model, free, records)
    columns = tuple(np.column_stack(pair) for pair in zip(directions.columns, added, strict=True))
    return Tangent(columns, whitening_of(gram_of((c, r.is_used) for c, r in zip(columns, records, strict=True))))


def residual_inflation(residuals_um: tuple[Array, ...], records: tuple[FitRecord, ...]) -> float:
    """Return by how much the correlation of what is left [um] widens standard errors, in the worst of the records."""
    return max(autocorrelation_inflation(v[r.is_used]) for v, r in zip(residuals_um, records, strict=True))

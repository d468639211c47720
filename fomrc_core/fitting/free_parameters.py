"""What a joint fit moves: the numbers of every cause that are not held, each by a coordinate of its own."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from fomrc_core.effects import Parameter
from fomrc_core.effects.base.cause import Cause
from fomrc_core.fitting.trial_model import TrialModel

Array = NDArray[np.float64]

_LOG_DIFFERENCE = 5e-4  # of a logarithm: small beside its curvature, large beside the rounding of a simulation
_SCALED_DIFFERENCE = 5e-3  # of a parameter's own unit
# Of the stroke: what a difference should move the displacement by, so that rounding (1e-16) and bending are as far
# away; within a factor of it any will do, and of nothing at all the size is guessed.
_SHARE_OF_DIFFERENCE, _FAR, _NO_SHARE = 1e-5, 1e3, 1e-14


@dataclass(frozen=True)
class FreeParameter:
    """One parameter of one cause that a refit moves.

    Attributes:
        cause: name of the cause.
        index: the record it belongs to; None for the actuator.
        spec: the parameter.
        scale: step unit of a parameter that is not moved by its logarithm.
    """

    cause: str
    index: int | None
    spec: Parameter
    scale: float

    def get(self, trial: TrialModel) -> float:
        """Return the parameter's value in a model."""
        return float(getattr(self.cause_in(trial), self.spec.name))

    def cause_in(self, trial: TrialModel) -> Cause:
        """Return the cause the parameter belongs to."""
        return next(cause for cause in trial.causes_in(self.index) if cause.name == self.cause)

    def set(self, trial: TrialModel, value: float) -> TrialModel:
        """Return the model with the parameter at a value."""
        return trial.with_cause(replace(self.cause_in(trial), **{self.spec.name: value}), self.index)

    def coordinate(self, value: float) -> float:
        """Return what the refit moves for a value."""
        return math.log(value) if self.spec.is_log else value / self.scale

    def value(self, coordinate: float) -> float:
        """Return the value of a coordinate, within the parameter's bounds."""
        value = math.exp(min(coordinate, 300.0)) if self.spec.is_log else coordinate * self.scale
        return min(max(value, self.spec.lower), self.spec.upper)

    @property
    def difference(self) -> float:
        """Coordinate step of the difference quotient."""
        return self.spec.difference or (_LOG_DIFFERENCE if self.spec.is_log else _SCALED_DIFFERENCE)

    def resized_difference(self, trial: TrialModel, share: float) -> float:
        """Return by how much a difference that moves the displacement by this share of its stroke must be resized.

        A parameter has no unit of its own where it stands at zero, and one in proportion to which the displacement
        changes says nothing of it: what it moves must be above rounding and below what bends. Only a parameter in
        which the response is linear may be moved farther than its own difference.

        Args:
            trial: the model.
            share: largest change of the displacement over its range [1].
        """
        is_linear = self.spec.name in self.cause_in(trial).linear_parameters
        is_far = share > _SHARE_OF_DIFFERENCE * _FAR or (is_linear and share < _SHARE_OF_DIFFERENCE / _FAR)
        return _SHARE_OF_DIFFERENCE / max(share, _NO_SHARE) if is_far and not self.spec.is_log else 1.0


def free_parameters(trial: TrialModel) -> tuple[FreeParameter, ...]:
    """Return what a refit moves: every number of every cause that is not held.

    Held are lists (their weights belong to the linear part), what a cause holds itself, and a linear parameter
    that stands at zero or a limit that stands where nothing reaches it.
    """
    n_records = max(len(trial.record_effects), len(trial.starts))
    found: list[FreeParameter] = []
    for index in (None, *range(n_records)):
        for cause in trial.causes_in(index):
            free = cause.free_names()
            for spec in cause.parameters:
                if spec.name in free:
                    scale = cause.scale_of(spec.name, float(getattr(cause, spec.name)))
                    found.append(FreeParameter(cause.name, index, spec, scale))
    return tuple(found)


def with_coordinates(trial: TrialModel, free: tuple[FreeParameter, ...], coordinates: Array) -> TrialModel:
    """Return the model with the free parameters at these coordinates."""
    placed = zip(free, coordinates.tolist(), strict=True)
    # every change of a cause is checked, and most causes have more than one parameter
    for (_, index), of_cause in groupby(placed, key=lambda pair: (pair[0].cause, pair[0].index)):
        moved = list(of_cause)
        values = {parameter.spec.name: parameter.value(coordinate) for parameter, coordinate in moved}
        trial = trial.with_cause(replace(moved[0][0].cause_in(trial), **values), index)
    return trial

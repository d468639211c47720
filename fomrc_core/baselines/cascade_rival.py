"""A rival made of a hysteresis operator that is linear in its weights, with creep in cascade behind it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fomrc_core.baselines.creep_cascade import NO_CREEP, CreepCascade, lag, linear_creep, logarithmic_creep
from fomrc_core.baselines.nonnegative import nonnegative_weights
from fomrc_core.baselines.rival import FittedRival, Rival, TrainingRecord

Array = NDArray[np.float64]
CreepKind = Literal["none", "logarithmic", "linear"]
_CREEP_WORDS = {"none": "", "logarithmic": " + log creep", "linear": " + LTI creep"}
_N_ALTERNATIONS = 6


class HysteresisOperator(ABC):
    """A hysteresis operator with its weights known."""

    @property
    @abstractmethod
    def n_parameters(self) -> int:
        """Number of weights that are not zero."""

    @abstractmethod
    def forward(self, voltage_v: Array) -> Array:
        """Return the displacement [um], shape (n_samples,)."""

    @abstractmethod
    def inverse(self, desired_um: Array) -> Array:
        """Return the voltage [V], shape (n_samples,)."""


class HysteresisFamily(ABC):
    """A hysteresis operator linear in weights that are not negative, before its weights are known."""

    name: str
    publication: str

    @abstractmethod
    def columns(self, voltage_v: Array) -> Array:
        """Return what each weight multiplies [um per weight], shape (n_samples, n_weights)."""

    @abstractmethod
    def operator(self, weights: Array) -> HysteresisOperator:
        """Return the operator with these weights."""

    @abstractmethod
    def scaled_to(self, records: Sequence[TrainingRecord]) -> HysteresisFamily:
        """Return the family with its thresholds laid over the voltages of the records."""


@dataclass(frozen=True, eq=False)
class FittedCascade(FittedRival):
    """Hysteresis with creep behind it."""

    hysteresis: HysteresisOperator
    creep: CreepCascade

    @property
    def n_parameters(self) -> int:
        """Weights that are not zero, and gains of the creep."""
        return self.hysteresis.n_parameters + self.creep.n_parameters

    def simulate(self, steps_s: Array, voltage_v: Array) -> Array:
        """Return the displacement [um], shape (n_samples,)."""
        return self.creep.apply(steps_s, self.hysteresis.forward(np.ascontiguousarray(voltage_v)))

    def invert(self, steps_s: Array, desired_um: Array) -> Array:
        """Return the drive [V], shape (n_samples,)."""
        return self.hysteresis.inverse(self.creep.undo(steps_s, desired_um))


@dataclass(frozen=True)
class CascadeRival(Rival):
    """A hysteresis family with one kind of creep.

    Args:
        family: the hysteresis.
        creep: none, logarithmic or linear.
    """

    family: HysteresisFamily
    creep: CreepKind = "none"

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the family and its creep."""
        return self.family.name + _CREEP_WORDS[self.creep]

    @property
    def publication(self) -> str:  # type: ignore[override]
        """Where the family was published."""
        return self.family.publication

    def fit(self, records: Sequence[TrainingRecord]) -> FittedCascade:
        """Return the rival fitted: weights and creep gains by turns, each a convex problem."""
        family = self.family.scaled_to(records)
        columns = [family.columns(r.voltage_v) for r in records]
        targets = [r.centred(r.displacement_um) for r in records]
        creep: CreepCascade = NO_CREEP
        for _ in range(1 if self.creep == "none" else _N_ALTERNATIONS):
            crept = [r.centred(creep.apply(r.steps_s, c)) for r, c in zip(records, columns, strict=True)]
            weights = nonnegative_weights(crept, targets)
            if self.creep != "none":
                moved = [c @ weights for c in columns]
                creep = fitted_creep(self.creep, records, moved, targets)
        return FittedCascade(family.operator(weights), creep)


def fitted_creep(
    kind: CreepKind, records: Sequence[TrainingRecord], moved: Sequence[Array], targets: Sequence[Array]
) -> CreepCascade:
    """Return the creep whose output best fits the targets, hysteresis output given.

    Args:
        kind: logarithmic or linear.
        records: for their steps and what is scored.
        moved: output of the hysteresis per record [um], shape (n_samples,).
        targets: centred displacement of the scored samples per record [um].
    """
    shape = linear_creep(np.ones(3)) if kind == "linear" else logarithmic_creep(1.0)
    parts = []
    for record, h in zip(records, moved, strict=True):
        h_column = np.ascontiguousarray(h[:, None])
        lags = [lag(h_column, record.steps_s, tau) for tau in shape.time_constants_s]
        basis = np.hstack(lags) if kind == "linear" else np.sum(lags, axis=0)
        parts.append(record.centred(np.hstack([h_column, basis])))
    gains = nonnegative_weights(parts, targets)
    if gains[0] <= 0.0:
        return NO_CREEP
    relative = gains[1:] / gains[0]
    return linear_creep(relative) if kind == "linear" else logarithmic_creep(float(relative[0]))

"""A rival made of a hysteresis operator that is linear in its weights, with creep in cascade behind it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fomrc_core.comparison.baselines.creep_cascade import NO_CREEP, CreepCascade, lag, linear_creep, logarithmic_creep
from fomrc_core.comparison.baselines.rival import FittedRival, Rival, TrainingRecord
from fomrc_core.compute.least_squares import non_negative_fit
from fomrc_core.compute.pulse import beat

Array = NDArray[np.float64]
CreepKind = Literal["none", "logarithmic", "linear"]
_CREEP_WORDS = {"none": "", "logarithmic": " + log creep", "linear": " + LTI creep"}
_N_ALTERNATIONS = 5


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
        if self.creep == "none":
            weights = non_negative_fit([r.centred(c) for r, c in zip(records, columns, strict=True)], targets)
            return FittedCascade(family.operator(weights), NO_CREEP)
        lags = [lagged_columns(self.creep, r, c) for r, c in zip(records, columns, strict=True)]
        creep: CreepCascade = NO_CREEP
        for _ in range(_N_ALTERNATIONS):
            gains = creep_gains(self.creep, creep)
            crept = [_crept(r, c, gains, own) for r, c, own in zip(records, columns, lags, strict=True)]
            weights = non_negative_fit(crept, targets)
            parts = [
                r.centred(np.column_stack([c @ weights, *(part @ weights for part in own)]))
                for r, c, own in zip(records, columns, lags, strict=True)
            ]
            creep = fitted_creep(self.creep, parts, targets)
        return FittedCascade(family.operator(weights), creep)


def _crept(record: TrainingRecord, columns: Array, gains: Array, lags: Sequence[Array]) -> Array:
    """Return the columns with what has crept of each, centred."""
    crept = columns.copy()
    for gain, part in zip(gains, lags, strict=True):
        crept += gain * part
        beat("lags", 0)  # still at it
    return record.centred(crept)


def lagged_columns(kind: CreepKind, record: TrainingRecord, columns: Array) -> list[Array]:
    """Return what each free gain of the creep multiplies, for every column, each shape (n_samples, n_columns)."""
    shape = linear_creep(np.ones(3)) if kind == "linear" else logarithmic_creep(1.0)
    every = np.ascontiguousarray(columns)
    lags = []
    for tau in shape.time_constants_s:
        lags.append(lag(every, record.steps_s, float(tau)))
        beat("lags")
    if kind == "linear":
        return lags
    together = lags[0]
    for other in lags[1:]:
        together += other
        beat("lags", 0)  # still at it
    return [together]


def creep_gains(kind: CreepKind, creep: CreepCascade) -> Array:
    """Return the free gains of the creep: three for linear, one for logarithmic."""
    if creep.gains.size == 0:
        return np.zeros(3 if kind == "linear" else 1)
    return creep.gains if kind == "linear" else creep.gains[:1]


def fitted_creep(kind: CreepKind, parts: Sequence[Array], targets: Sequence[Array]) -> CreepCascade:
    """Return the creep whose output best fits the targets, hysteresis output given.

    Args:
        kind: logarithmic or linear.
        parts: per record, centred: output of the hysteresis, then what each free gain multiplies [um].
        targets: per record, centred displacement [um].
    """
    gains = non_negative_fit(parts, targets)
    if gains[0] <= 0.0:
        return NO_CREEP
    relative = gains[1:] / gains[0]
    return linear_creep(relative) if kind == "linear" else logarithmic_creep(float(relative[0]))

"""Whether causes are the same in a record that was not learned from: their parameters, fitted to each, agree.

What acts in a stage has one size whatever the drive; what stands in for it takes the size that each record asks for.
So the parameters are fitted once more, to held-out data alone, and both fits are compared as two samples of one
stage are (Chow, 1960: tests of equality between sets of coefficients; Peters, Buehlmann and Meinshausen, 2016: causal
inference by invariant prediction).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.least_squares import chi_squared
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.held_out_score import SURE
from fomrc_core.diagnosis.judgement import Judgement
from fomrc_core.diagnosis.present_model import residual_inflation
from fomrc_core.diagnosis.untaught import with_untaught
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.free_parameters import FreeParameter
from fomrc_core.fitting.joint_fit import Refit, refit
from fomrc_core.fitting.trial_model import TrialModel

# Of a parameter's value: what a grid of plays and the parts of steps may move it by from one record to another, beside
# what noise does.
_ALIKE = 0.02
_N_ITERATIONS = 30  # it begins where the training data left it, and is compared at rest


@dataclass(frozen=True)
class ParameterTwice:
    """One parameter as it was learned, and as held-out data alone have it.

    Attributes:
        cause: whose it is.
        parameter: its name.
        learned: its value as learned.
        held_out: its value as held-out data alone have it.
        relative_error: standard error of the difference over the value, what may differ without a reason in it [1].
        n_errors: how far apart they are in standard errors [1].
    """

    cause: str
    parameter: str
    learned: float
    held_out: float
    relative_error: float
    n_errors: float


@dataclass(frozen=True)
class Constancy:
    """How far the parameters of held-out data are from those that were learned.

    Attributes:
        gain: by how much parameters of their own make these data likelier than those that were learned, in log
            likelihood, half of one off for each (Akaike, 1974).
        parameters: those that can be compared; none where nothing is known of them in one of the records.
    """

    gain: float = 0.0
    parameters: tuple[ParameterTwice, ...] = ()

    @property
    def is_broken(self) -> bool:
        """Whether held-out data surely ask for other parameters."""
        return self.gain > SURE

    def of_cause(self, cause: str) -> tuple[ParameterTwice, ...]:
        """Return the parameters of one cause."""
        return tuple(pair for pair in self.parameters if pair.cause == cause)

    def sentence(self) -> str:
        """Return in words what differs most."""
        worst = max(self.parameters, key=lambda pair: pair.n_errors)
        return (
            f"{worst.cause} asks for another {worst.parameter} in held-out data, {worst.held_out:.4g} where "
            f"{worst.learned:.4g} was learned ({worst.n_errors:.1f} standard errors apart): what acts is not that alone"
        )


def constancy(model: TrialModel, final: Refit, split: DataSplit) -> Constancy:
    """Return how far held-out data alone are from the parameters that were learned, in the worst of their records.

    Args:
        model: the final model, what belongs to single records fitted to those that are held out as well.
        final: its joint refit to the training records.
        split: records.
    """
    learned = _Estimate.of(final, split.train)
    found = []
    # blocks of a record that was learned from would say the same again
    for part in (part for part in split.held if part.index >= len(split.train) and learned.free):
        try:
            alone = with_untaught(model.alone(part.index), part.untaught_v)
            other = refit(alone, (part.record,), n_iterations=_N_ITERATIONS)
        except ParameterError:
            continue
        found.append(_compared(learned, _Estimate.of(other, (part.record,))))
    return max(found, key=lambda each: each.gain, default=Constancy())


def unless_inconstant(judgement: Judgement, found: Constancy) -> Judgement:
    """Return the judgement, what is left no noise where the causes found are surely not the same held out.

    Noise it may be and pass for it; but a model that needs other numbers for another drive has not got the cause.
    """
    if not found.is_broken:
        return judgement
    return replace(judgement, is_noise=False, reasons=(*judgement.reasons, found.sentence()))


@dataclass(frozen=True, eq=False)
class _Estimate:
    """Parameters of the actuator's effects from one fit: values, and their covariance, by logarithms where so moved."""

    free: tuple[FreeParameter, ...]
    values: Array
    covariance: Array

    @classmethod
    def of(cls, fitted: Refit, records: tuple[FitRecord, ...]) -> _Estimate:
        shared = [k for k, parameter in enumerate(fitted.free) if parameter.index is None]
        free = tuple(fitted.free[k] for k in shared)
        if not free:
            return cls((), np.zeros(0), np.zeros((0, 0)))
        covariance = fitted.covariance(records, residual_inflation(fitted.residual, records))
        per_coordinate = np.array([1.0 if p.spec.is_log else p.scale for p in free])
        values = np.array([math.log(p.get(fitted.model)) if p.spec.is_log else p.get(fitted.model) for p in free])
        own = covariance[np.ix_(shared, shared)] * np.outer(per_coordinate, per_coordinate)
        return cls(free, values, own)

    def place(self, parameter: FreeParameter) -> int | None:
        """Return where a parameter stands, None where it is not free here or nothing is known of it."""
        for k, own in enumerate(self.free):
            if (own.cause, own.spec.name) == (parameter.cause, parameter.spec.name):
                return k if np.isfinite(self.covariance[k, k]) else None
        return None


def _compared(learned: _Estimate, other: _Estimate) -> Constancy:
    pairs = [(learned.place(parameter), other.place(parameter)) for parameter in learned.free]
    at = np.array([mine for mine, its in pairs if mine is not None and its is not None], dtype=np.int64)
    its = np.array([its for mine, its in pairs if mine is not None and its is not None], dtype=np.int64)
    if not at.size:
        return Constancy()
    free = [learned.free[k] for k in at]
    mine, others = learned.values[at], other.values[its]
    size = np.where([p.spec.is_log for p in free], 1.0, np.maximum(np.abs(mine), np.abs(others)))
    known = size > 0.0
    size = np.where(known, size, 1.0)
    covariance = learned.covariance[np.ix_(at, at)] + other.covariance[np.ix_(its, its)] + np.diag((_ALIKE * size) ** 2)
    error = np.sqrt(np.diag(covariance))
    n_errors = (others - mine) / error
    told = tuple(
        ParameterTwice(
            p.cause,
            p.spec.name,
            _value(p, mine[k]),
            _value(p, others[k]),
            float(error[k] / size[k]),
            float(abs(n_errors[k])),
        )
        for k, p in enumerate(free)
        if known[k]
    )
    return Constancy(0.5 * (chi_squared(others - mine, covariance) - len(free)), told)


def _value(parameter: FreeParameter, estimate: float) -> float:
    return math.exp(estimate) if parameter.spec.is_log else float(estimate)

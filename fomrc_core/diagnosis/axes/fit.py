"""A cause of several axes fitted to records: Gauss-Newton by differences on the simulated displacements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.gauss_newton import Linearized, descend
from fomrc_core.compute.least_squares import NormalEquations, normal_equations, variances_of
from fomrc_core.diagnosis.axes.cause import AxesCause
from fomrc_core.diagnosis.axes.records import AxesRecord
from fomrc_core.diagnosis.held_out_score import HeldOutScore, held_out_score
from fomrc_core.errors import ParameterError
from fomrc_core.model.axes import AxesModel
from fomrc_core.records.noise import autocorrelation_inflation

_STEP = 1e-5  # of values of order one: a simulation resolves 1e-12
_N_STEPS = 10
_STILL = 1e-4  # relative gain of a step below which it ends
# Of what a cause takes off the squared error. Where modes are lightly damped, a coupling shifts them by about as
# much as it couples them; where it does not act, its companions do all that is done.
_MOST_BY_COMPANIONS = 0.8
_HOPELESS = 0.01  # gain in the logarithm of the squared error that two steps must have brought: an eighth of a finding
_SCREENED = 0.005  # the same of what the first step promises, below which none is taken


@dataclass(frozen=True, eq=False)
class Residuals:
    """What a model leaves of the records, as a share of each displacement's rms.

    Attributes:
        records: the records.
        relative: of each record, (n_samples, n_outputs) [1].
    """

    records: Sequence[AxesRecord]
    relative: tuple[Array, ...]

    @classmethod
    def of(cls, model: AxesModel, records: Sequence[AxesRecord]) -> Residuals:
        """Return what the model leaves; raises ParameterError where it cannot be simulated."""
        return cls(records, tuple(record.relative_residual(model) for record in records))

    @cached_property
    def squared_error(self) -> float:
        """Sum of squares of the samples learnt from."""
        found = (float(np.sum(e[r.is_learnt] ** 2)) for r, e in zip(self.records, self.relative, strict=True))
        return float(sum(found))

    @cached_property
    def held(self) -> list[Array]:
        """Samples judged on, a stretch for each record and output."""
        pairs = zip(self.records, self.relative, strict=True)
        return [column for r, e in pairs if np.any(r.is_held) for column in e[r.is_held].T]

    def log_excess(self, model_error: float) -> float:
        """Return the logarithm of what is left on samples judged on over the floor, mean squares.

        No cause can gain more.

        Args:
            model_error: of the model when it was identified [1]; the floor where it is above the noise.
        """
        pairs = [(r, int(r.is_held.sum())) for r in self.records]
        floor = sum(n * float(np.sum(np.maximum(r.noise_um / r.scale_um, model_error) ** 2)) for r, n in pairs)
        left = float(sum(np.sum(column**2) for column in self.held))
        return math.log(max(left, 1e-300) / max(floor, 1e-300))

    @cached_property
    def n_independent(self) -> float:
        """Number of samples learnt from, each counted as often as it is independent of its neighbours."""
        total = 0.0
        for record, error in zip(self.records, self.relative, strict=True):
            seen = error[record.is_learnt]
            total += sum(seen.shape[0] / autocorrelation_inflation(column) for column in seen.T if column.size)
        return total


@dataclass(frozen=True, eq=False)
class FittedCause:
    """A cause where it fits best.

    Attributes:
        cause: with its values.
        model: the present model changed by it.
        residuals: what that leaves.
        score: on samples not learnt from, beside the present model.
        learnt_log_gain: logarithm of the ratio of squared errors on those learnt from [1].
        standard_errors: of the values, (n_values,).
        is_plausible: whether its values are what its name says, and not what comes along with it does the work.
    """

    cause: AxesCause
    model: AxesModel
    residuals: Residuals
    score: HeldOutScore
    learnt_log_gain: float
    standard_errors: Array
    is_plausible: bool

    @property
    def n_free(self) -> int:
        """Number of values."""
        return int(self.cause.values.size)


@dataclass(frozen=True, eq=False)
class _Point:
    cause: AxesCause
    model: AxesModel
    residuals: Residuals

    @property
    def squared_error(self) -> float:
        return self.residuals.squared_error


@dataclass(frozen=True, eq=False)
class _Trial:
    """A cause at the values a fit begins with, and what its first step promises.

    Attributes:
        point: where it begins.
        equations: of the first step; None of a cause without values.
        promised: squared error after that step, were the residual linear.
    """

    point: _Point
    equations: NormalEquations | None
    promised: float


def best_fit(trials: Sequence[AxesCause], model: AxesModel, before: Residuals) -> FittedCause | None:
    """Return the best of some trials of one form of one cause, fitted to what a model leaves.

    All are tried by their first step; the one that promises most is fitted.

    Args:
        trials: with the values to begin at.
        model: the present model.
        before: what it leaves.

    Returns:
        The fit, or None where no trial promises anything.
    """
    found: list[_Trial] = []
    for cause in trials:
        start = _point_at(cause, cause.values, model, before)
        if start is None:
            continue
        equations = _equations(start, model) if cause.values.size else None
        promised = start.squared_error - (0.0 if equations is None else equations.explained)
        found.append(_Trial(start, equations, promised))
    best = min(found, key=lambda trial: trial.promised, default=None)
    if best is None or best.promised > math.exp(-_SCREENED) * before.squared_error:
        return None
    return _fitted(best, model, before)


def _point_at(cause: AxesCause, values: Array, model: AxesModel, before: Residuals) -> _Point | None:
    moved = replace(cause, values=values)
    try:
        changed = moved.applied(model)
        return _Point(moved, changed, Residuals.of(changed, before.records))
    except ParameterError:
        return None


def _fitted(trial: _Trial, model: AxesModel, before: Residuals) -> FittedCause:
    records, first = before.records, trial.point

    def linearize(point: _Point) -> Linearized[_Point]:
        known = trial.equations if point is first else None
        equations = _equations(point, model) if known is None else known
        return Linearized(
            equations,
            lambda step: _point_at(point.cause, point.cause.values + step, model, before),
            point.cause.longest_step,
        )

    def is_hopeless(n_done: int, point: _Point) -> bool:
        return n_done == 2 and point.squared_error > (1.0 - _HOPELESS) * before.squared_error

    point, errors = first, np.zeros(0)
    if first.cause.values.size:
        descent = descend(first, linearize, n_iterations=_N_STEPS, least_gain=_STILL, is_hopeless=is_hopeless)
        point = descent.point
        variance = point.squared_error / max(point.residuals.n_independent, 1.0)
        gram = descent.linearized.equations.gram
        n_used = sum(int(r.is_learnt.sum()) * r.displacement_um.shape[1] for r in records)
        errors = np.sqrt(variance * variances_of(gram * (point.residuals.n_independent / n_used)))
    score = held_out_score(before.held, point.residuals.held)
    gain = math.log(max(before.squared_error, 1e-300) / max(point.squared_error, 1e-300))
    is_plausible = point.cause.is_plausible()
    companions = point.cause.companions()
    if is_plausible and companions is not None and point.squared_error < before.squared_error:
        alone = Residuals.of(companions.applied(model), records).squared_error
        taken = before.squared_error - point.squared_error
        is_plausible = before.squared_error - alone < _MOST_BY_COMPANIONS * taken
    return FittedCause(point.cause, point.model, point.residuals, score, gain, errors, is_plausible)


def _equations(point: _Point, model: AxesModel) -> NormalEquations:
    moved = []
    for k in range(point.cause.values.size):
        values = point.cause.values.copy()
        values[k] += _STEP
        found = _point_at(point.cause, values, model, point.residuals)
        moved.append(point.residuals if found is None else found.residuals)
    rows: list[tuple[Array, Array, Mask]] = []
    for r, record in enumerate(point.residuals.records):
        here = point.residuals.relative[r]
        columns = np.stack([((here - other.relative[r]) / _STEP).ravel() for other in moved], axis=1)
        used = np.repeat(record.is_learnt, here.shape[1])
        rows.append((columns, here.ravel(), used))
    return normal_equations(rows)

"""Fit the Maxwell elements of a model on its forward error, with an analytic Jacobian: equation (34).

Moved are the logarithms of slope, weights and thresholds, so that they stay positive, and the creep order; the
offset of each record is taken out. Elements and play form are the same model (hysteresis.py), so this is (34).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.gauss_newton import Linearized, descend
from fomrc_core.compute.least_squares import normal_equations
from fomrc_core.fitting.fit_record import FitRecord, shortest_time
from fomrc_core.fitting.linear_part import MAX_ORDER, MIN_ORDER, centred, order_slope, record_columns, residuals
from fomrc_core.fitting.linear_part import squared_error as squared_error_of
from fomrc_core.fitting.play_columns import THRESHOLD_SLOPE, ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.operators.hysteresis import OperatorSum

Starts = tuple[Prehistory | None, ...]

_N_ITERATIONS = 60  # it comes to rest in ten to thirty
# In units of the noise variance: a step that lowers the sum of squares by less moves no parameter by more than a
# thirtieth of its standard error.
_LEAST_GAIN = 1e-2
_LONGEST_LOG_STEP = 1.0  # a slope says nothing of a value several times smaller or larger


@dataclass(frozen=True, eq=False)
class FittedElements:
    """Elements fitted on the forward error.

    Attributes:
        form: slope, thresholds [V] and weights [um/V] of the play form.
        order: creep order [1].
        squared_error: sum of squares over the used samples [um^2].
        information: J^T J of (log slope, log weights, log thresholds, order), shape (2 n + 2, 2 n + 2).
        n_iterations: iterations taken.
        is_converged: whether it came to rest.
    """

    form: OperatorSum
    order: float
    squared_error: float
    information: Array
    n_iterations: int
    is_converged: bool


@dataclass(frozen=True, eq=False)
class _Point:
    """Coordinates: log slope, log weights, log thresholds, order; with what they leave of each record [um]."""

    coordinates: Array
    residuals_um: tuple[Array, ...]
    squared_error: float


def trial_of(form: OperatorSum, order: float, records: tuple[FitRecord, ...], starts: Starts) -> TrialModel:
    """Return a play form with creep as a model of records under fit, without effects.

    Args:
        form: slope, thresholds [V] and weights [um/V].
        order: creep order [1].
        records: what it is a model of.
        starts: what went before each record.
    """
    one = TrialModel.of_play_form(form, order)
    nothing = tuple(() for _ in records)
    return replace(one, record_effects=nothing, starts=starts, shortest_time_s=shortest_time(records))


def fit_elements(form: OperatorSum, order: float, records: tuple[FitRecord, ...], starts: Starts) -> FittedElements:
    """Return the play form that fits best near the given one, with as many plays.

    Args:
        form: where to start; slope, weights and thresholds above zero.
        order: creep order to start at [1].
        records: what to fit.
        starts: how each record begins.
    """
    n = form.thresholds.size
    logs = np.log(np.concatenate(([form.slope], form.weights, form.thresholds)))
    longest = np.append(np.full(logs.size, _LONGEST_LOG_STEP), MAX_ORDER - MIN_ORDER)

    def trial_at(coordinates: Array) -> TrialModel:
        slope, weights, thresholds = np.split(np.exp(coordinates[:-1]), [1, 1 + n])
        form = OperatorSum(float(slope[0]), thresholds, weights)
        return trial_of(form, float(coordinates[-1]), records, starts)

    def point_at(coordinates: Array) -> _Point:
        left = residuals(trial_at(coordinates), records)
        return _Point(coordinates, left, squared_error_of(records, left))

    def stepped(coordinates: Array) -> _Point:
        return point_at(np.append(coordinates[:-1], np.clip(coordinates[-1], MIN_ORDER, MAX_ORDER)))

    def linearize(point: _Point) -> Linearized[_Point]:
        trial = trial_at(point.coordinates)
        equations = normal_equations(
            (centred(_jacobian(trial, record, i), record.is_used), left, record.is_used)
            for i, (record, left) in enumerate(zip(records, point.residuals_um, strict=True))
        )
        return Linearized(equations, lambda step: stepped(point.coordinates + step), longest)

    descent = descend(
        point_at(np.append(logs, order)),
        linearize,
        n_iterations=_N_ITERATIONS,
        least_gain=_LEAST_GAIN / sum(int(np.count_nonzero(r.is_used)) for r in records),
    )
    best = trial_at(descent.point.coordinates)
    return FittedElements(
        best.operator(),
        best.creep_order,
        descent.point.squared_error,
        descent.linearized.equations.gram,
        descent.n_iterations,
        descent.is_converged,
    )


def _jacobian(trial: TrialModel, record: FitRecord, index: int) -> Array:
    """Return the displacement for a unit change of each coordinate [um], shape (n_samples, 2 n + 2)."""
    thresholds, n = trial.columns.thresholds_v[1:], trial.weights.size - 1
    slopes = ColumnKinds(thresholds, np.full(n, -np.inf), np.full(n, THRESHOLD_SLOPE))
    both = replace(trial, columns=trial.columns.joined(slopes), weights=np.append(trial.weights, np.zeros(n)))
    columns = record_columns(both, record, index) * np.append(trial.weights, trial.weights[1:] * thresholds)
    return np.column_stack((columns, order_slope(trial, record, index)))

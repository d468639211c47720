"""Polish a play form on the forward error: Levenberg-Marquardt with an analytic Jacobian, equation (34).

Moved are the logarithms of slope, weights and thresholds, so that they stay positive, and the creep order; the
offset of each record is taken out. Elements and play form are the same model (hysteresis.py), so this is (34).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.least_squares import normal_equations
from fomrc_core.fitting.fit_record import FitRecord, shortest_time
from fomrc_core.fitting.linear_part import centred, record_columns
from fomrc_core.fitting.play_columns import THRESHOLD_SLOPE, ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.operators.hysteresis import OperatorSum

Array = NDArray[np.float64]

_ORDER_STEP = 1e-4
_MAX_ORDER = 1.0  # what a model may have
_CONVERGED = 1e-6


@dataclass(frozen=True, eq=False)
class Polished:
    """A polished play form.

    Attributes:
        form: slope, thresholds [V] and weights [um/V].
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


Starts = tuple[Prehistory | None, ...]


def play_form_response(form: OperatorSum, order: float, record: FitRecord, start: Prehistory | None) -> Array:
    """Return the displacement [um] of a play form with creep, offset not included, shape (n_samples,)."""
    return predict(_trial(form, order, record, start), record, 0)


def _trial(form: OperatorSum, order: float, record: FitRecord, start: Prehistory | None) -> TrialModel:
    return replace(TrialModel.of_play_form(form, order, start=start), shortest_time_s=shortest_time((record,)))


def polish(
    form: OperatorSum, order: float, records: tuple[FitRecord, ...], starts: Starts, n_iterations: int = 25
) -> Polished:
    """Return the play form that fits best near the given one.

    Args:
        form: where to start.
        order: creep order to start at [1].
        records: what to fit.
        starts: how each record begins.
        n_iterations: iterations at most.
    """
    n = form.thresholds.size
    x = np.concatenate(([np.log(form.slope)], np.log(form.weights), np.log(form.thresholds), [order]))
    left, error = _residual(x, n, records, starts)
    damping, is_converged, iteration = 1e-3, False, 0
    hessian = np.eye(x.size)
    for iteration in range(1, n_iterations + 1):  # noqa: B007 - the count is part of the result
        equations = normal_equations(
            (centred(_jacobian(x, n, record, start), record.is_used), residual, record.is_used)
            for record, start, residual in zip(records, starts, left, strict=True)
        )
        hessian, gradient = equations.gram, equations.moment
        scale = np.sqrt(np.maximum(np.diag(hessian), 1e-12 * float(np.max(np.diag(hessian)))))
        is_better = False
        while damping < 1e8:
            scaled = hessian / scale[:, None] / scale[None, :] + damping * np.eye(x.size)
            step = np.clip(np.linalg.solve(scaled, gradient / scale) / scale, -1.0, 1.0)
            trial = x + step
            trial[-1] = np.clip(trial[-1], 0.0, _MAX_ORDER)
            trial_left, trial_error = _residual(trial, n, records, starts)
            if trial_error < error:
                is_better = True
                break
            damping *= 8.0
        if not is_better:
            is_converged = True
            break
        gain = (error - trial_error) / error
        x, left, error = trial, trial_left, trial_error
        damping = max(damping / 8.0, 1e-9)
        if gain < _CONVERGED:
            is_converged = True
            break
    return Polished(_form_of(x, n), float(x[-1]), error, hessian, iteration, is_converged)


def _form_of(x: Array, n: int) -> OperatorSum:
    order = np.argsort(x[1 + n : 1 + 2 * n], kind="stable")
    return OperatorSum(float(np.exp(x[0])), np.exp(x[1 + n : 1 + 2 * n])[order], np.exp(x[1 : 1 + n])[order])


def _residual(x: Array, n: int, records: tuple[FitRecord, ...], starts: Starts) -> tuple[tuple[Array, ...], float]:
    form = _form_of(x, n)
    left = tuple(
        centred(r.measured_um - play_form_response(form, float(x[-1]), r, s), r.is_used)
        for r, s in zip(records, starts, strict=True)
    )
    return left, float(sum(np.dot(v[r.is_used], v[r.is_used]) for v, r in zip(left, records, strict=True)))


def _jacobian(x: Array, n: int, record: FitRecord, start: Prehistory | None) -> Array:
    slope, weights, thresholds, order = np.exp(x[0]), np.exp(x[1 : 1 + n]), np.exp(x[1 + n : 1 + 2 * n]), float(x[-1])
    form = OperatorSum(float(slope), thresholds, weights)
    trial = _trial(form, order, record, start)
    slopes = ColumnKinds(thresholds, np.full(n, -np.inf), np.full(n, THRESHOLD_SLOPE))
    both = replace(trial, columns=trial.columns.joined(slopes), weights=np.append(trial.weights, np.zeros(n)))
    columns = record_columns(both, record, 0)
    columns *= np.concatenate(([slope], weights, weights * thresholds))
    step = _ORDER_STEP if order + _ORDER_STEP <= _MAX_ORDER else -_ORDER_STEP
    now = play_form_response(form, order, record, start)
    ahead = play_form_response(form, order + step, record, start)
    return np.column_stack((columns, (ahead - now) / step))

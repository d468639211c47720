"""Joint refit of effects and linear part: Gauss-Newton in the effects, the linear part projected out.

The residual is always that of the exact chain. Directions of the linear part are taken once per refit (they change
little), those of the effects by differences, so an iteration costs one simulation per free parameter.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.least_squares import normal_equations, product
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.base_fit import rebased
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.free_parameters import FreeParameter, free_parameters, with_coordinates
from fomrc_core.fitting.linear_part import (
    Tangent,
    centred,
    moved,
    residuals,
    squared_error,
    tangent,
)
from fomrc_core.fitting.trial_model import TrialModel, predict

Array = NDArray[np.float64]

_CONVERGED = 3e-5
_LARGEST_DAMPING = 1e6
_LONGEST_LOG_STEP = 1.0  # a slope says nothing of a value several times smaller or larger
_RESCAN_WIDTHS = (5e-4, 4e-5, 4e-6)
_MOST_DIFFERENCES = 4  # tried for a direction, until one is neither rounding nor bent
_PATIENCE = 4  # iterations before a start may be given up


@dataclass(frozen=True, eq=False)
class Refit:
    """Result of a joint refit.

    Attributes:
        model: the fitted model.
        squared_error: sum of squares over the used samples [um^2].
        free: the parameters moved.
        directions: displacement per coordinate of each, linear part removed, per record (n_samples, n_free).
        residual: measured minus predicted [um] per record.
        is_converged: whether it came to rest within the iterations.
    """

    model: TrialModel
    squared_error: float
    free: tuple[FreeParameter, ...]
    directions: tuple[Array, ...]
    residual: tuple[Array, ...]
    is_converged: bool

    def standard_errors(
        self, records: tuple[FitRecord, ...], inflation: float
    ) -> dict[tuple[str, int | None, str], float]:
        """Return the standard error of each free parameter, noise correlation counted by ``inflation``."""
        if not self.free:
            return {}
        used = [d[r.is_used] for d, r in zip(self.directions, records, strict=True)]
        information = sum(d.T @ d for d in used)
        n = sum(d.shape[0] for d in used)
        covariance = np.linalg.pinv(information) * self.squared_error / n * inflation
        errors = {}
        for k, free in enumerate(self.free):
            per_coordinate = free.get(self.model) if free.spec.is_log else free.scale
            errors[(free.cause, free.index, free.spec.name)] = abs(per_coordinate) * math.sqrt(
                max(float(covariance[k, k]), 0.0)
            )
        return errors


def _directions(
    chain: TrialModel,
    free: tuple[FreeParameter, ...],
    coordinates: Array,
    records: tuple[FitRecord, ...],
    base: tuple[Array, ...],
    executor: Executor | None = None,
) -> tuple[Array, ...]:
    parts = [np.zeros((r.time_s.size, len(free))) for r in records]
    stroke_um = max(float(np.ptp(values)) for values in base)

    def fill(k: int) -> None:
        parameter = free[k]
        step = parameter.difference
        for _ in range(_MOST_DIFFERENCES):
            shifted = coordinates.copy()
            shifted[k] += step
            if parameter.coordinate(parameter.value(shifted[k])) - coordinates[k] < 0.5 * step:
                step = -step
                shifted[k] = coordinates[k] + step
            try:
                other = with_coordinates(chain, free, shifted)
                changes = {
                    i: predict(other, record, i) - base[i]
                    for i, record in enumerate(records)
                    if parameter.index in (None, i)
                }
            except ParameterError:
                return
            if not changes:
                return  # it belongs to a record that is not among these
            factor = parameter.resized_difference(chain, max(float(np.ptp(c)) for c in changes.values()) / stroke_um)
            if factor == 1.0:
                break
            step = abs(step) * factor
        for i, change in changes.items():
            parts[i][:, k] = centred(change / step, records[i].is_used)

    filled: Iterable[None] = map(fill, range(len(free))) if executor is None else executor.map(fill, range(len(free)))
    for _ in filled:
        pass
    return tuple(parts)


def refit(
    chain: TrialModel,
    records: tuple[FitRecord, ...],
    space: Tangent | None = None,
    n_iterations: int = 12,
    free: tuple[FreeParameter, ...] | None = None,
    is_linear_free: bool = True,
    hopeless_um2: float = math.inf,
    executor: Executor | None = None,
) -> Refit:
    """Return the chain with effects and linear part fitted together.

    Args:
        chain: where to start.
        records: what to fit.
        space: tangent of the linear part; computed at the start where not given.
        n_iterations: iterations at most.
        free: parameters to move; all that are not held by default.
        is_linear_free: whether the directions of the linear part may be taken anew.
        hopeless_um2: a start whose sum of squares is still above this after some iterations is given up.
        executor: simulates the parameters' directions side by side where given; not one this call runs in.
    """
    # Many arguments: what the search knows beforehand saves it most of the work; who only fits leaves them out.
    free = free_parameters(chain) if free is None else free
    space = tangent(chain, records) if space is None else space
    coordinates = np.array([p.coordinate(p.get(chain)) for p in free])
    chain, left, error = _linear_part_first(chain, records, space)
    is_log = np.array([p.spec.is_log for p in free], dtype=np.bool_)
    damping, is_converged, is_space_old = 1e-3, False, bool(free) and is_linear_free
    projected: tuple[Array, ...] = tuple(np.zeros((r.time_s.size, 0)) for r in records)
    for iteration in range(n_iterations):
        if iteration >= _PATIENCE and error > hopeless_um2:
            break
        # the offset is taken out of every direction, so the residual stands for the prediction
        base = tuple(r.measured_um - v for r, v in zip(records, left, strict=True))
        raw = _directions(chain, free, coordinates, records, base, executor)
        projected = _removed(space, records, raw)
        clear = space.remove(records, left)
        equations = normal_equations((d, s, r.is_used) for d, s, r in zip(projected, clear, records, strict=True))
        is_better = False
        while damping < _LARGEST_DAMPING:
            step = _damped_step(equations.gram, equations.moment, damping) if free else np.zeros(0)
            step = np.where(is_log, np.clip(step, -_LONGEST_LOG_STEP, _LONGEST_LOG_STEP), step)
            rest = tuple(s - d @ step for s, d in zip(left, raw, strict=True))
            change = space.solve(records, rest)
            try:
                trial = moved(with_coordinates(chain, free, coordinates + step), change)
                trial_left = residuals(trial, records)
                trial_error = squared_error(records, trial_left)
            except ParameterError:
                trial_error = np.inf
            if trial_error < error:
                is_better = True
                break
            damping = max(damping, 1e-4) * 8.0
            if not free:
                break
        if not is_better and is_space_old:
            # a large effect turns the directions of the linear part: take them anew before giving up
            space, is_space_old, damping = tangent(chain, records), False, 1e-3
            continue
        if not is_better:
            is_converged = True
            break
        is_space_old = is_linear_free
        gain = (error - trial_error) / error
        chain, left, error = trial, trial_left, trial_error
        coordinates = np.array([p.coordinate(p.get(chain)) for p in free])
        damping = max(damping / 6.0, 1e-7)
        if gain < _CONVERGED:
            is_converged = True
            break
    return Refit(chain, error, free, projected, left, is_converged)


def fit_until_still(chain: TrialModel, records: tuple[FitRecord, ...], executor: Executor | None = None) -> Refit:
    """Return the joint refit with plays and directions chosen anew, until it moves no more."""
    fitted = refit(rebased(chain, records), records, executor=executor)
    chain = _scanned_again(fitted.model, records)
    return refit(rebased(chain, records), records, n_iterations=8, executor=executor)


def _scanned_again(chain: TrialModel, records: tuple[FitRecord, ...]) -> TrialModel:
    """Return the chain with what derivatives do not find scanned beside all that was found since."""
    for effect in chain.effects:
        if effect.is_scanned:
            parameter = FreeParameter(effect.name, None, effect.parameter(effect.main_parameter), 1.0)
            chain = scan(chain, records, tangent(chain, records), parameter, _RESCAN_WIDTHS)
    return chain


def _linear_part_first(
    chain: TrialModel, records: tuple[FitRecord, ...], space: Tangent
) -> tuple[TrialModel, tuple[Array, ...], float]:
    """Return the chain with its linear part moved to where the effects are, its residual and error."""
    left = residuals(chain, records)
    error = squared_error(records, left)
    for _ in range(2):
        trial = moved(chain, space.solve(records, left))
        try:
            trial_left = residuals(trial, records)
        except ParameterError:
            break
        trial_error = squared_error(records, trial_left)
        if not trial_error < error:
            break
        is_done = trial_error > 0.99 * error
        chain, left, error = trial, trial_left, trial_error
        if is_done:
            break
    return chain, left, error


def _removed(space: Tangent, records: tuple[FitRecord, ...], raw: tuple[Array, ...]) -> tuple[Array, ...]:
    moment = sum(product(c, s, r.is_used) for c, r, s in zip(space.columns, records, raw, strict=True))
    coefficients = space.whitening @ (space.whitening.T @ moment)
    return tuple(s - c @ coefficients for s, c in zip(raw, space.columns, strict=True))


def _damped_step(hessian: Array, gradient: Array, damping: float) -> Array:
    scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    scaled = hessian / scale[:, None] / scale[None, :] + damping * np.eye(scale.size)
    step = np.linalg.lstsq(scaled, gradient / scale, rcond=1e-12)[0] / scale
    # a coordinate that does not act has no scale of its own
    return np.asarray(np.where(np.diag(hessian) > 1e-20, step, 0.0))


def scan(
    chain: TrialModel,
    records: tuple[FitRecord, ...],
    space: Tangent,
    parameter: FreeParameter,
    widths: tuple[float, ...] = (1.5e-3, 1e-4, 1e-5),
    n_points: int = 31,
) -> TrialModel:
    """Return the chain with one parameter at the best of ever finer grids about its value.

    For responses that jump with the parameter, where a derivative says nothing.

    Args:
        chain: where to start.
        records: what to fit.
        space: tangent of the linear part.
        parameter: what to scan.
        widths: half widths of the grids relative to the value.
        n_points: points of each grid.
    """
    best_error = np.inf
    for width in widths:
        centre = parameter.get(chain)
        for share in np.linspace(-width, width, n_points):
            value = centre * (1.0 + float(share))
            trial = parameter.set(chain, value)
            error = squared_error(records, space.remove(records, residuals(trial, records)))
            if error < best_error:
                best_error, chain = error, trial
    return chain

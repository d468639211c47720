"""Joint refit of effects and linear part: Gauss-Newton in the effects, the linear part projected out.

The residual is always that of the exact chain. Directions of the linear part are taken once per refit (they change
little), those of the effects by differences, so an iteration costs one simulation per free parameter: a coarser one
where the residual's divides the bends. What a direction misses of itself a fit that has come to rest misses of its
standard error.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.gauss_newton import Linearized, descend
from fomrc_core.compute.least_squares import covariance_of, gram_of, normal_equations, product
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
from fomrc_core.fitting.trial_model import TrialModel, predict_passing, stage_of
from fomrc_core.model.simulation import Before, Passage

Array = NDArray[np.float64]

_LEAST_GAIN = 3e-5  # of the sum of squares: a model is told from another by a hundred times as much
_LONGEST_LOG_STEP = 1.0  # a slope says nothing of a value several times smaller or larger
_AS_LIKELY = 1.0  # in log likelihood: what the best of a few values gains by chance
_RESCAN_WIDTHS = ((0.1, 21), (0.01, 21), (0.001, 21))  # of ``scan``, where all that was found since has moved little
_MOST_DIFFERENCES = 4  # tried for a direction, until one is neither rounding nor bent
_PATIENCE = 4  # iterations before a start may be given up
_N_LINEAR_STEPS = 2  # the columns are linear but for the creep order, which hardly moves
_HARDLY_LESS = 0.99
_STILL = 1e-3  # in the logarithm of the sum of squares: what tells models apart is thirty times as much


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
        last_log_gain: logarithm of the ratio of the sums of squares before and after its last step [1].
    """

    model: TrialModel
    squared_error: float
    free: tuple[FreeParameter, ...]
    directions: tuple[Array, ...]
    residual: tuple[Array, ...]
    is_converged: bool
    last_log_gain: float = 0.0

    def standard_errors(
        self, records: tuple[FitRecord, ...], inflation: float
    ) -> dict[tuple[str, int | None, str], float]:
        """Return the standard error of each free parameter; inf for one the records say nothing of.

        Args:
            records: what was fitted.
            inflation: by how much the noise varies more than if it were white.
        """
        if not self.free:
            return {}
        variances = np.diag(self.covariance(records, inflation))
        errors = {}
        for free, variance in zip(self.free, variances, strict=True):
            per_coordinate = free.get(self.model) if free.spec.is_log else free.scale
            errors[(free.cause, free.index, free.spec.name)] = abs(per_coordinate) * math.sqrt(variance)
        return errors

    def covariance(self, records: tuple[FitRecord, ...], inflation: float) -> Array:
        """Return the covariance of the coordinates of the free parameters, shape (n_free, n_free).

        Args:
            records: what was fitted.
            inflation: by how much the noise varies more than if it were white.
        """
        gram = gram_of((d, r.is_used) for d, r in zip(self.directions, records, strict=True))
        n = sum(int(np.count_nonzero(r.is_used)) for r in records)
        return np.asarray(covariance_of(gram) * self.squared_error / n * inflation)


def _directions(
    chain: TrialModel,
    free: tuple[FreeParameter, ...],
    coordinates: Array,
    records: tuple[FitRecord, ...],
    runs: Sequence[tuple[Array, Passage]],
    executor: Executor | None = None,
) -> tuple[Array, ...]:
    # Many arguments: a model, where it stands in what it moves, and what it gives there.
    parts = [np.zeros((r.time_s.size, len(free))) for r in records]
    # measured: a trial whose drive never comes through stands still
    stroke_um = max(float(np.ptp(r.measured_um[r.is_used])) for r in records)

    def fill(k: int) -> None:
        parameter = free[k]
        step = parameter.difference
        # what comes before the cause in the chain is what it was
        since = stage_of(parameter.cause_in(chain))
        for _ in range(_MOST_DIFFERENCES):
            if parameter.coordinate(parameter.value(coordinates[k] + step)) - coordinates[k] < 0.5 * step:
                step = -step
            try:
                other = parameter.set(chain, parameter.value(float(coordinates[k] + step)))
                changes = {
                    i: predict_passing(other, record, i, is_coarse=True, before=Before(passage, since))[0] - base
                    for i, (record, (base, passage)) in enumerate(zip(records, runs, strict=True))
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


def effect_directions(
    trial: TrialModel, free: tuple[FreeParameter, ...], records: tuple[FitRecord, ...]
) -> tuple[Array, ...]:
    """Return displacement per coordinate of these parameters [um], offset removed, per record (n_samples, n_free).

    Zero in a record that is not the parameter's own.

    Args:
        trial: the model.
        free: parameters of its effects.
        records: the records.
    """
    coordinates = np.array([p.coordinate(p.get(trial)) for p in free])
    return _directions(trial, free, coordinates, records, _coarse_runs(trial, records))


def _coarse_runs(trial: TrialModel, records: tuple[FitRecord, ...]) -> list[tuple[Array, Passage]]:
    return [predict_passing(trial, record, i, is_coarse=True) for i, record in enumerate(records)]


@dataclass(frozen=True, eq=False)
class _Point:
    """Where a refit stands.

    Attributes:
        chain: the model there.
        coordinates: of its free parameters, shape (n_free,).
        residuals_um: measured minus predicted, per record.
        squared_error: their sum of squares [um^2].
        space: directions of the linear part, taken there or at a former point.
        is_space_old: whether they were taken at a former point.
    """

    chain: TrialModel
    coordinates: Array
    residuals_um: tuple[Array, ...]
    squared_error: float
    space: Tangent
    is_space_old: bool


@dataclass(frozen=True, eq=False)
class _Linearized(Linearized[_Point]):
    """The sum of squares in the free parameters alone, the linear part following them.

    Attributes:
        directions: displacement per coordinate, linear part removed, per record (n_samples, n_free).
    """

    directions: tuple[Array, ...] = ()


def refit(
    chain: TrialModel,
    records: tuple[FitRecord, ...],
    space: Tangent | None = None,
    *,
    n_iterations: int = 12,
    free: tuple[FreeParameter, ...] | None = None,
    hopeless_um2: float = math.inf,
    executor: Executor | None = None,
) -> Refit:
    """Return the chain with effects and linear part fitted together.

    Args:
        chain: where to start.
        records: what to fit.
        space: directions of the linear part, computed at the start where not given; with no column that moves, the
            linear part is held.
        n_iterations: iterations at most.
        free: parameters to move; all that are not held by default.
        hopeless_um2: a start whose sum of squares is still above this after some iterations is given up.
        executor: simulates the parameters' directions side by side where given; not one this call runs in.
    """
    # Many arguments: what the search knows beforehand saves it most of the work; who only fits leaves them out.
    free = free_parameters(chain) if free is None else free
    space = tangent(chain, records) if space is None else space
    is_linear_free = bool(np.any(space.whitening))
    longest = np.array([_LONGEST_LOG_STEP if p.spec.is_log else math.inf for p in free])

    def point_at(trial: TrialModel, left_um: tuple[Array, ...], directions: Tangent, is_old: bool) -> _Point:
        coordinates = np.array([p.coordinate(p.get(trial)) for p in free])
        return _Point(trial, coordinates, left_um, squared_error(records, left_um), directions, is_old)

    def linearize(point: _Point) -> _Linearized:
        runs = _coarse_runs(point.chain, records) if free else []
        raw = _directions(point.chain, free, point.coordinates, records, runs, executor)
        projected = _removed(point.space, records, raw)
        clear = point.space.remove(records, point.residuals_um)
        equations = normal_equations((d, s, r.is_used) for d, s, r in zip(projected, clear, records, strict=True))

        def stepped(step: Array) -> _Point | None:
            rest = tuple(s - d @ step for s, d in zip(point.residuals_um, raw, strict=True))
            try:
                trial = with_coordinates(point.chain, free, point.coordinates + step)
                trial = moved(trial, point.space.solve(records, rest))
                return point_at(trial, residuals(trial, records), point.space, is_linear_free)
            except ParameterError:
                return None

        followed = point.squared_error - squared_error(records, clear)
        return _Linearized(equations, stepped, longest, followed, point.is_space_old, projected)

    def renew(point: _Point) -> _Point | None:
        # a large effect turns the directions of the linear part: take them anew before giving up
        if not point.is_space_old:
            return None
        return replace(point, space=tangent(point.chain, records), is_space_old=False)

    descent = descend(
        point_at(*_linear_part_first(chain, records, space), space, bool(free) and is_linear_free),
        linearize,
        n_iterations=n_iterations,
        least_gain=_LEAST_GAIN,
        renew=renew,
        is_hopeless=lambda n_done, point: n_done >= _PATIENCE and point.squared_error > hopeless_um2,
    )
    found = descent.point
    directions = descent.linearized.directions
    return Refit(
        found.chain,
        found.squared_error,
        free,
        directions,
        found.residuals_um,
        descent.is_converged,
        descent.last_log_gain,
    )


def fit_until_still(chain: TrialModel, records: tuple[FitRecord, ...], executor: Executor | None = None) -> Refit:
    """Return the joint refit with plays and directions chosen anew, until it moves no more."""
    left_um = residuals(chain, records)
    before_um2 = squared_error(records, left_um)
    fitted = refit(rebased(chain, records, left_um), records, executor=executor)
    is_still = fitted.is_converged and abs(math.log(before_um2 / fitted.squared_error)) < _STILL
    if is_still and not any(effect.is_scanned for effect in chain.effects):
        return fitted  # with what has not moved the same plays would be chosen once more
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
) -> tuple[TrialModel, tuple[Array, ...]]:
    """Return the chain with its linear part moved to where the effects are, and what it leaves of each record [um]."""
    left = residuals(chain, records)
    error = squared_error(records, left)
    for _ in range(_N_LINEAR_STEPS):
        trial = moved(chain, space.solve(records, left))
        try:
            trial_left = residuals(trial, records)
        except ParameterError:
            break
        trial_error = squared_error(records, trial_left)
        if not trial_error < error:
            break
        is_done = trial_error > _HARDLY_LESS * error
        chain, left, error = trial, trial_left, trial_error
        if is_done:
            break
    return chain, left


def _removed(space: Tangent, records: tuple[FitRecord, ...], raw: tuple[Array, ...]) -> tuple[Array, ...]:
    moment = sum(product(c, s, r.is_used) for c, r, s in zip(space.columns, records, raw, strict=True))
    coefficients = space.whitening @ (space.whitening.T @ moment)
    return tuple(s - c @ coefficients for s, c in zip(raw, space.columns, strict=True))


def scan(
    chain: TrialModel,
    records: tuple[FitRecord, ...],
    space: Tangent,
    parameter: FreeParameter,
    widths: tuple[tuple[float, int], ...] = ((0.6, 61), (0.02, 21), (0.002, 21)),
) -> TrialModel:
    """Return the chain with one parameter, a period over the drive [V], at the best of ever finer grids about it.

    For responses that jump with the parameter, where a derivative says nothing. How closely a period must be known, and
    how closely a spectrum over the drive knows it, is a matter of how many of them the drive goes through: a step of
    which there are forty has to be known to a thousandth, one of a few thousand to some millionths.

    Where the response jumps the sum of squares is flat between two jumps, and which end of that is the least is chance:
    the mean of what is likely is the nearest to the truth (Pitman, 1939), and of other records misses the fewest jumps.

    Args:
        chain: where to start.
        records: what to fit.
        space: tangent of the linear part.
        parameter: what to scan.
        widths: of each grid, the half width in periods over the range of the drive, and its points.
    """
    best_error = np.inf
    range_v = max(parameter.get(chain), *(float(np.ptp(record.voltage_v)) for record in records))
    n_used = sum(int(np.count_nonzero(record.is_used)) for record in records)

    def error_of(trial: TrialModel) -> float:
        return squared_error(records, space.remove(records, residuals(trial, records)))

    for width, n_points in widths:
        centre = parameter.get(chain)
        periods = np.linspace(-width, width, n_points)
        trials = [parameter.set(chain, centre / (1.0 + float(p) * centre / range_v)) for p in periods]
        errors = np.array([error_of(trial) for trial in trials])
        best = int(np.argmin(errors))
        if errors[best] < best_error:
            best_error, chain = float(errors[best]), trials[best]
        if not best_error > 0.0:
            continue
        likely = np.exp(-0.5 * n_used * np.log(errors / errors[best]))
        mean = float(periods @ likely / np.sum(likely))
        middle = parameter.set(chain, centre / (1.0 + mean * centre / range_v))
        # two places far apart may be as likely, and what is between them not
        if 0.5 * n_used * math.log(error_of(middle) / best_error) < _AS_LIKELY:
            chain = middle
    return chain

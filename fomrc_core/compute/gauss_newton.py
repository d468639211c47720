"""Damped Gauss-Newton on a sum of squares (Levenberg, 1944; Marquardt, 1963): the one descent of all fits.

A fit says what a point is, how the residual is linearized about it, and where a step leads; the damping is here.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.least_squares import NormalEquations
from fomrc_core.compute.pulse import beat

# Added to the diagonal of the Gram matrix of unit directions. The first is small beside the directions that the data
# determine, so that the first step is nearly Gauss-Newton's; the largest makes a step of a millionth of the steepest
# descent, below what a simulation resolves; the least keeps directions that the data do not determine in bounds.
_FIRST_DAMPING = 1e-3
_LARGEST_DAMPING = 1e6
_LEAST_DAMPING = 1e-7
# After a refusal the damping rises from here on: below, the matrix is the same to three digits.
_FELT_DAMPING = 1e-4
# Of the least gain: a step that promises less, after one was refused, is rounding.
_PROMISED = 1e-2
# After a first refusal, and twice as much after each further one (Nielsen, 1999: Damping parameter in Marquardt's
# method): where many follow one another the right damping is far away.
_RAISED_BY, _LOWERED_BY = 8.0, 6.0
# Of the largest power: a direction that changes the residual by a ten billionth of the strongest does not act.
_IDLE = 1e-20


class Point(Protocol):
    """Where a fit stands."""

    @property
    def squared_error(self) -> float:
        """Sum of squares there."""


PointT = TypeVar("PointT", bound=Point)
AnyPointT = TypeVar("AnyPointT", bound=Point, contravariant=True)


@dataclass(frozen=True, eq=False)
class Linearized(Generic[PointT]):
    """A sum of squares about a point.

    Attributes:
        equations: of the step that would be best were the residual linear in it.
        stepped: where a step, shape (n_coordinates,), leads; None where nothing is.
        longest_step: longest step of each coordinate to either side, shape (n_coordinates,); inf for any.
        further_gain: by how much any step lowers the sum of squares beside, by what follows the coordinates.
        is_old: whether what follows the coordinates is taken along directions of a former point.
    """

    equations: NormalEquations
    stepped: Callable[[Array], PointT | None]
    longest_step: Array
    further_gain: float = 0.0
    is_old: bool = False

    def promised(self, step: Array) -> float:
        """Return by how much a step lowers the sum of squares, were the residual linear."""
        along = float(step @ self.equations.moment)
        return self.further_gain + 2.0 * along - float(step @ self.equations.gram @ step)


LinearizedT = TypeVar("LinearizedT", bound=Linearized)  # type: ignore[type-arg]


@dataclass(frozen=True, eq=False)
class Descent(Generic[PointT, LinearizedT]):
    """What a descent came to.

    Attributes:
        point: the best point met.
        linearized: the last linearization, about the point before the last step.
        n_iterations: linearizations made.
        is_converged: whether it came to rest within the iterations allowed.
        last_log_gain: logarithm of the ratio of the sums of squares before and after the last step; 0 where none was
            found.
    """

    point: PointT
    linearized: LinearizedT
    n_iterations: int
    is_converged: bool
    last_log_gain: float = 0.0


class Trail(Protocol[AnyPointT]):
    """Where a descent has come to, kept so that it goes on there where it was cut short."""

    @property
    def begun(self) -> tuple[int, float] | None:
        """Linearizations made before ``start``, and the damping there; None where it is the first point."""

    def note(self, point: AnyPointT, n_done: int, damping: float) -> None:
        """Take down a point from which so many linearizations later the descent goes on with this damping."""


def descend(
    start: PointT,
    linearize: Callable[[PointT], LinearizedT],
    *,
    n_iterations: int,
    least_gain: float,
    renew: Callable[[PointT], PointT | None] = lambda point: None,
    is_hopeless: Callable[[int, PointT], bool] = lambda n_done, point: False,
    trail: Trail[PointT] | None = None,
) -> Descent[PointT, LinearizedT]:
    """Return the least sum of squares that damped Gauss-Newton steps lead to.

    Each step is that of the normal equations with their diagonal raised; a step that does not lower the error is
    refused and the diagonal raised further.

    Args:
        start: where to begin.
        linearize: the residual about a point.
        n_iterations: linearizations at most, 1 or more.
        least_gain: a step that lowers the error by a smaller share of it is the last.
        renew: asked where no step lowers the error: the same point with a better linearization, None where there is
            none.
        is_hopeless: whether to give up at a point, asked with the number of linearizations made.
        trail: told each point on the way; where it has begun already, ``start`` is the last point it was told.

    Raises:
        ValueError: no iterations allowed.
    """
    if n_iterations < 1:
        raise ValueError(f"n_iterations: {n_iterations}, allowed: 1 or more")
    # Many arguments: what a fit may say of its descent, all but four with a default.
    n_before, damping = (trail.begun if trail is not None else None) or (0, _FIRST_DAMPING)
    point = start
    linearized = linearize(point)
    for n_done in range(n_before + 1, n_iterations + 1):
        beat("steps of fits")
        better, damping = _better(point, linearized, damping, least_gain * point.squared_error)
        if better is None:
            renewed = renew(point)
            if renewed is None:
                return Descent(point, linearized, n_done, True)
            point, damping, last_log_gain = renewed, _FIRST_DAMPING, 0.0
        else:
            gain = (point.squared_error - better.squared_error) / point.squared_error
            last_log_gain = -math.log1p(-gain) if gain < 1.0 else math.inf
            point, damping = better, max(damping / _LOWERED_BY, _LEAST_DAMPING)
            if gain < least_gain:
                return Descent(point, linearized, n_done, True, last_log_gain)
        if n_done == n_iterations or is_hopeless(n_done, point):
            break
        if trail is not None:
            trail.note(point, n_done, damping)
        linearized = linearize(point)
    return Descent(point, linearized, n_done, False, last_log_gain)


def _better(
    point: PointT, linearized: Linearized[PointT], damping: float, least_gain: float
) -> tuple[PointT | None, float]:
    """Return the first point with a lesser error that ever more damped steps lead to, and its damping.

    After a refusal a step that promises next to nothing is not tried: the point is as good as the minimum. The first is
    tried in any case, for where the residual bends a step may gain more than it promises. Where no step at all, with
    what follows along old directions, leaves more than the point does, damping comes to that: new directions are asked.
    """
    is_refused = False
    raised_by = _RAISED_BY
    while damping < _LARGEST_DAMPING:
        whole = damped_step(linearized.equations, damping)
        step = np.clip(whole, -linearized.longest_step, linearized.longest_step)
        # a step that was cut short is no longer that of the normal equations
        is_whole = bool(np.all(step == whole))
        if is_refused and is_whole and linearized.promised(step) < _PROMISED * least_gain:
            break
        trial = linearized.stepped(step)
        if trial is not None and trial.squared_error < point.squared_error:
            return trial, damping
        if not step.size:  # nothing that damping could shorten
            break
        if linearized.is_old and not is_refused:
            still = linearized.stepped(np.zeros(step.size))
            if still is None or still.squared_error >= point.squared_error:
                break
        damping, is_refused = max(damping, _FELT_DAMPING) * raised_by, True
        raised_by *= 2.0
    return None, damping


def damped_step(equations: NormalEquations, damping: float) -> Array:
    """Return the step of the normal equations, each direction taken in its own unit and damped alike."""
    power = np.diag(equations.gram)
    acts = power > _IDLE * float(np.max(power, initial=0.0))
    # a direction that does not act has no unit of its own, and stays where it is
    scale = np.sqrt(np.where(acts, power, math.inf))
    scaled = equations.gram / scale[:, None] / scale[None, :] + damping * np.eye(scale.size)
    return np.asarray(np.linalg.solve(scaled, equations.moment / scale) / scale)

"""Linear least squares over several records: normal equations, their solution, and weights that are not negative.

Each record gives columns of shape (n_samples, n_columns) and one target of shape (n_samples,), of which some samples
are used. The sum over the records of |columns w - target|^2 is least where gram w = moment.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.pulse import beat

# Directions whose power is below this share of the largest are rounding: the Gram matrix of unit columns has an
# error of some machine epsilons (2.2e-16) times the number of columns (a hundred and more).
RANK_TOLERANCE = 1e-13
# A column with less than this share of the largest power (a share of 1e-10 in size) does not move.
_STILL = 1e-20
# What is left of a column beside others, with less than this share of its power, is mostly rounding of the Gram matrix.
_ALIKE = 1e-11
# Added to the diagonal of a Gram matrix of unit columns so that its Cholesky factor exists; well above its rounding
# error, and moves a weight that the records determine by this share only.
_RIDGE = 1e-11
# Active set changes allowed for each column; as a rule a few suffice.
_CHANGES_PER_COLUMN = 50
_ROWS_TOGETHER = 1 << 12  # rows reduced to a triangle before it is told: some tenths of a second for 300 columns


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """gram w = moment.

    Attributes:
        gram: sum of columns^T columns over the used samples of all records, shape (n_columns, n_columns).
        moment: sum of columns^T target, shape (n_columns,), or (n_columns, n_targets) of several targets.
    """

    gram: Array
    moment: Array

    def of(self, chosen: NDArray[np.int64]) -> NormalEquations:
        """Return the equations of some of the weights, the others held at zero."""
        return NormalEquations(self.gram[np.ix_(chosen, chosen)], self.moment[chosen])

    def without(self, n_first: int) -> NormalEquations:
        """Return the equations of the other weights, the first ones following them (Schur complement)."""
        reduced = whitening_of(self.gram[:n_first, :n_first]).T
        shared, own = reduced @ self.gram[:n_first, n_first:], reduced @ self.moment[:n_first]
        gram = self.gram[n_first:, n_first:] - gram_of([(shared, np.ones(shared.shape[0], dtype=np.bool_))])
        return NormalEquations(gram, self.moment[n_first:] - shared.T @ own)

    @property
    def explained(self) -> float:
        """What the weights that fit best take off the sum of squares."""
        return float(np.sum((whitening_of(self.gram).T @ self.moment) ** 2))

    def taken_one_by_one(self, n_most: int) -> list[int]:
        """Return weights in the order in which each takes most off the sum of squares beside those before it.

        Orthogonal least squares (Chen, Billings and Luo, Int. J. Control 50 (1989) 1873): what was taken is projected
        out of all others. It ends where none takes anything, or all that is left of a column is rounding.

        Args:
            n_most: number of weights at most.
        """
        gram, moment = self.gram.copy(), self.moment.copy()
        power = np.diag(self.gram)
        may = power > _STILL * np.max(power, initial=0.0)
        taken: list[int] = []
        while len(taken) < n_most:
            left = np.diag(gram)
            may = may & (left > _ALIKE * power)
            gains = np.where(may, moment**2 / np.where(may, left, 1.0), 0.0)
            best = int(np.argmax(gains)) if gains.size else -1
            if best < 0 or not gains[best] > 0.0:
                break
            taken.append(best)
            may[best] = False
            share = gram[:, best] / gram[best, best]
            moment -= share * moment[best]
            gram -= np.outer(share, gram[best])
        return taken

    def solution(self) -> Array:
        """Return the weights of either sign that fit best, shape of the moment; the shortest where several do."""
        whitening = whitening_of(self.gram)
        return np.asarray(whitening @ (whitening.T @ self.moment))


def normal_equations(records: Iterable[tuple[Array, Array, Mask]]) -> NormalEquations:
    """Return the normal equations of records, each given as (columns, target, is_used).

    The records may come from a generator: the columns of one are held at a time.

    Raises:
        ValueError: no records.
    """
    gram: Array | None = None
    moment: Array | None = None
    for columns, target, is_used in records:
        own_gram, own_moment = product(columns, columns, is_used), product(columns, target, is_used)
        beat("simulations", 0)  # still at it
        gram = own_gram if gram is None else gram + own_gram
        moment = own_moment if moment is None else moment + own_moment
    if gram is None or moment is None:
        raise ValueError("normal equations of no records")
    return NormalEquations(gram, moment)


def rows_without(records: Iterable[tuple[Array, Array]], n_first: int) -> tuple[Array, Array]:
    """Return (columns, target) that the other weights must fit, the first ones following them.

    By orthogonal triangles, one record at a time, where a Gram matrix would lose the digits in which columns that are
    much alike differ (vector fitting). The columns have shape (n_other or fewer, n_other), the target (n_other or
    fewer,); their least squares is that of the records.

    Args:
        records: each (columns, target), of shapes (n_samples, n_columns) and (n_samples,).
        n_first: number of weights eliminated.

    Raises:
        ValueError: no records.
    """
    triangle: Array | None = None
    for columns, target in records:
        rows = np.column_stack((columns, target))
        triangle = np.asarray(np.linalg.qr(rows if triangle is None else np.vstack((triangle, rows)), mode="r"))
    if triangle is None:
        raise ValueError("rows of no records")
    return triangle[n_first:-1, n_first:-1], triangle[n_first:-1, -1]


def shortest_weights(columns: Array, target: Array) -> Array:
    """Return the weights of either sign that fit best, the shortest where several do, shape (n_columns,).

    From the columns themselves, by singular values, where the Gram matrix would lose digits.
    """
    size = np.linalg.norm(columns, axis=0)
    scale = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.lstsq(columns / scale, target, rcond=None)[0] / scale)


def gram_of(records: Iterable[tuple[Array, Mask]]) -> Array:
    """Return the sum of columns^T columns of records, each given as (columns, is_used), (n_columns, n_columns)."""
    return normal_equations((columns, columns[:, 0], is_used) for columns, is_used in records).gram


def product(columns: Array, signals: Array, is_used: Mask) -> Array:
    """Return columns^T signals over the used samples; the signals have shape (n_samples,) or (n_samples, n_signals)."""
    # zeroing the one signal costs nothing beside copying the used rows of all columns
    masked = signals if np.all(is_used) else np.where(is_used if signals.ndim == 1 else is_used[:, None], signals, 0.0)
    if signals is columns:
        columns = masked  # the same on both sides: half of a symmetric product is enough
    # few signals beside many columns: twice as fast from this side
    return np.asarray(columns.T @ masked if signals.ndim == 1 else (masked.T @ columns).T)


def whitening_of(gram: Array, tolerance: float = RANK_TOLERANCE) -> Array:
    """Return W with W W^T the pseudo-inverse of the Gram matrix, weak directions left out.

    Shape (n_columns, rank); columns^T columns = gram makes columns W orthonormal.

    Args:
        gram: shape (n_columns, n_columns).
        tolerance: directions of unit columns with a smaller share of the largest power are left out; those that are
            rounding unless given.
    """
    power = np.diag(gram)
    # a column that does not move (a knee the drive never reaches) takes no part
    scale = np.where(power > _STILL * np.max(power), 1.0 / np.sqrt(np.maximum(power, 1e-300)), 0.0)
    values, vectors = np.linalg.eigh(gram * scale[:, None] * scale[None, :])
    kept = values > tolerance * values[-1]
    return np.asarray(scale[:, None] * vectors[:, kept] / np.sqrt(values[kept]))


def variances_of(gram: Array) -> Array:
    """Return the diagonal of the inverse of a Gram matrix: variances of weights for targets of variance 1.

    Weights of columns that cannot be told apart are as uncertain as rounding lets them be told, those of columns
    that do not move are without end (inf). Shape (n_columns,).
    """
    return np.array(np.diag(covariance_of(gram)))


def covariance_of(gram: Array) -> Array:
    """Return the inverse of a Gram matrix: covariance of weights for targets of variance 1, as ``variances_of`` is.

    Of columns that do not move the variance is without end (inf), and nothing is said beside it (0). Shape
    (n_columns, n_columns).
    """
    power = np.diag(gram)
    moves = power > _STILL * float(np.max(power, initial=0.0))
    if not np.any(moves):
        return np.diag(np.full(power.size, np.inf))
    scale = np.sqrt(np.where(moves, power, np.inf))
    values, vectors = np.linalg.eigh(gram / scale[:, None] / scale[None, :])
    inverse = (vectors / np.maximum(values, RANK_TOLERANCE * np.max(values, initial=0.0))) @ vectors.T
    covariance = inverse / scale[:, None] / scale[None, :]
    return np.asarray(covariance + np.diag(np.where(moves, 0.0, np.inf)))


def chi_squared(apart: Array, covariance: Array) -> float:
    """Return apart' covariance^-1 apart: by how much values differ, in what they may differ by.

    Args:
        apart: differences, shape (n,).
        covariance: of the differences, positive definite, shape (n, n).
    """
    error = np.sqrt(np.diag(covariance))
    return float(apart / error @ np.linalg.solve(covariance / np.outer(error, error), apart / error))


def non_negative_weights(gram: Array, moment: Array) -> Array:
    """Return the non-negative weights that fit best, from the Gram matrix and the moments, shape (n_columns,).

    Convex: no start values, no local minima.
    """
    power = np.diag(gram)
    # a column that does not move gets no weight
    scale = np.where(power > _STILL * float(np.max(power)), np.sqrt(np.maximum(power, 1e-300)), np.inf)
    scaled = gram / scale[:, None] / scale[None, :]
    lower = np.linalg.cholesky(scaled + _RIDGE * np.eye(scale.size))
    target = solve_triangular(lower, moment / scale, lower=True)
    return _solved(lower.T, target) / scale


def signed_weights(gram: Array, moment: Array, is_positive: Mask) -> Array:
    """Return the weights that fit best, those marked not negative, the others of either sign, shape (n_columns,)."""
    # a weight of either sign is the difference of two that are not negative
    free = np.flatnonzero(~is_positive)
    signs = np.concatenate((np.ones(moment.size), -np.ones(free.size)))
    order = np.concatenate((np.arange(moment.size), free))
    both = non_negative_weights(gram[np.ix_(order, order)] * signs[:, None] * signs[None, :], moment[order] * signs)
    weights: Array = both[: moment.size].copy()
    weights[free] -= both[moment.size :]
    return weights


def non_negative_fit(columns: Sequence[Array], targets: Sequence[Array]) -> Array:
    """Return w >= 0 that minimises the sum of |columns w - target|^2, shape (n_columns,).

    From the columns themselves, where the Gram matrix would lose digits: columns that are much alike, or errors to
    many decades.

    Args:
        columns: per record, shape (n_samples, n_columns).
        targets: per record, shape (n_samples,).
    """
    triangle = _triangle([np.column_stack(pair) for pair in zip(columns, targets, strict=True)])
    beat("fits of weights")
    matrix, target = triangle[:, :-1], triangle[:, -1]
    scale: Array = np.linalg.norm(matrix, axis=0)
    scale[scale <= 1e-12 * scale.max(initial=0.0)] = np.inf  # columns the record never moves
    return _solved(matrix / scale, target) / scale


def _triangle(parts: Sequence[Array]) -> Array:
    """Return the triangular factor of the rows of all parts: it holds all that matters of them, and is small.

    Many rows are taken in one block after the other, each together with the factor of those before.
    """
    stacked = np.vstack(parts)
    triangle: Array = np.asarray(np.linalg.qr(stacked[:_ROWS_TOGETHER], mode="r"))
    for first in range(_ROWS_TOGETHER, len(stacked), _ROWS_TOGETHER):
        beat("fits of weights", 0)  # still at it
        block = stacked[first : first + _ROWS_TOGETHER]
        triangle = np.asarray(np.linalg.qr(np.vstack((triangle, block)), mode="r"))
    return triangle


def _solved(matrix: Array, target: Array) -> Array:
    from scipy.optimize import nnls  # slow to import; a model that is only run needs none

    weights, _ = nnls(matrix, target, maxiter=_CHANGES_PER_COLUMN * matrix.shape[1])
    return np.asarray(weights)

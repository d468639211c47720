"""How sure a least-squares fit is, where what it leaves is not alike everywhere, and what it left out was chosen by it.

    cov w = (J^T J)^-1 (sum_c J_c^T e_c e_c^T J_c) (J^T J)^-1,      e_c = (1 - H_c)^(-1/2) r_c

over clusters c of rows, residuals r, H_c = J_c (J^T J)^-1 J_c^T. Within a cluster they may be of any size and go
together in any way, clusters are independent. The root of 1 - H_c undoes how much a fit draws its own residuals to
zero: unbiased where they are alike (White, Econometrica 48 (1980) 817-838; Bell and McCaffrey, Survey Methodology 28
(2002) 169-181).

A weight that was left out because it gained too little would have stayed with other residuals, and have moved the rest
by b = (J^T J)^-1 J^T j of it. Of variance v, and in only beyond t standard deviations, it adds b^2 v g(t) to theirs,
g(t) = 2 (t phi(t) + 1 - Phi(t)): the variance of a pretest estimator (Judge and Bock, The statistical implications of
pre-test and Stein-rule estimators, 1978, chapter 3), one left out at a time.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.least_squares import gram_of, whitening_of

# Of 1: a cluster that a fit meets exactly whatever it holds has no residual to judge by; no more than a hundredfold
# variance is made of it.
_LEAST_LEFT = 0.01
_DETERMINED = 1e-6  # of a weight, that may lie in directions the data do not determine
# Of its power, what of a weight left out the others do not make up for. With less it is one of them by another name,
# which the few steps of a descent damped by as much (gauss_newton.py) do not follow from zero.
_OF_ITS_OWN = 1e-3


@dataclass(frozen=True, eq=False)
class Selection:
    """What of the columns was fitted, and what it took to be.

    Attributes:
        is_kept: columns fitted to the end, shape (n_columns,); the others were left out for gaining too little.
        least_gain: of the sum of squares by one of them, from which on it would have been kept.
    """

    is_kept: Mask
    least_gain: float


def undetermined(gram: Array) -> Mask:
    """Return which weights lie in directions that the data do not determine, shape (n_weights,).

    Args:
        gram: J^T J of all rows, shape (n_weights, n_weights).
    """
    # the columns of a whitening are directions of unit columns, but for their length
    directions = whitening_of(gram) * np.sqrt(np.diag(gram))[:, None]
    directions /= np.linalg.norm(directions, axis=0)
    return np.asarray(np.sum(directions**2, axis=1) < 1.0 - _DETERMINED)


def clustered_covariance(gram: Array, clusters: Iterable[tuple[Array, Array]], selection: Selection) -> Array:
    """Return the covariance of the weights kept, inf on the diagonal of those not determined, (n_kept, n_kept).

    Args:
        gram: J^T J of all rows and columns, shape (n_columns, n_columns).
        clusters: blocks of many clusters at once: columns, shape (n_clusters, n_rows, n_columns), and residuals,
            shape (n_clusters, n_rows).
        selection: which columns were kept, and why others were not.
    """
    kept, left_out = np.flatnonzero(selection.is_kept), np.flatnonzero(~selection.is_kept)
    own = gram[np.ix_(kept, kept)]
    whitening = whitening_of(own)
    moved = whitening @ (whitening.T @ gram[np.ix_(kept, left_out)])  # of those kept, by one of those left out
    scores, power = [], np.zeros(left_out.size)
    for columns, rest in clusters:
        unit = columns[:, :, kept] @ whitening
        values, vectors = np.linalg.eigh(np.eye(rest.shape[1]) - np.einsum("cip,cjp->cij", unit, unit))
        along = np.einsum("cij,ci->cj", vectors, rest) / np.sqrt(np.maximum(values, _LEAST_LEFT))
        free = np.einsum("cij,cj->ci", vectors, along)
        scores.append(np.einsum("cip,ci->cp", unit, free))
        weighed = np.einsum("cip,ci->cp", columns, free)
        power += np.sum((weighed[:, left_out] - weighed[:, kept] @ moved) ** 2, axis=0)
    stacked = np.concatenate(scores)
    meat = gram_of([(stacked, np.ones(stacked.shape[0], dtype=np.bool_))])
    found = whitening @ meat @ whitening.T
    of_its_own = np.diag(gram)[left_out] - np.einsum("ij,ij->j", gram[np.ix_(kept, left_out)], moved)
    told = (of_its_own > _OF_ITS_OWN * np.diag(gram)[left_out]) & (power > 0.0)
    size, moved = of_its_own[told], moved[:, told]
    beyond = np.sqrt(selection.least_gain * size / power[told])
    share = 2.0 * (beyond * np.exp(-0.5 * beyond**2) / np.sqrt(2.0 * np.pi) + ndtr(-beyond))
    found = found + (moved * (share * power[told] / size**2)) @ moved.T
    is_open = undetermined(own)
    found[is_open, is_open] = np.inf
    return np.asarray(found)

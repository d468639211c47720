"""How sure a least-squares fit is, where what it leaves is not alike everywhere: the sandwich covariance.

    cov w = (J^T J)^-1 (sum_c J_c^T e_c e_c^T J_c) (J^T J)^-1,      e_c = (1 - H_c)^(-1/2) r_c

over clusters c of rows, residuals r, H_c = J_c (J^T J)^-1 J_c^T. Within a cluster they may be of any size and go
together in any way, clusters are independent. The root of 1 - H_c undoes how much a fit draws its own residuals to
zero: unbiased where they are alike (White, Econometrica 48 (1980) 817-838; Bell and McCaffrey, Survey Methodology 28
(2002) 169-181).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.least_squares import gram_of, whitening_of

# Of 1: a cluster that a fit meets exactly whatever it holds has no residual to judge by; no more than a hundredfold
# variance is made of it.
_LEAST_LEFT = 0.01
_DETERMINED = 1e-6  # of a weight, that may lie in directions the data do not determine


def undetermined(gram: Array) -> Mask:
    """Return which weights lie in directions that the data do not determine, shape (n_weights,).

    Args:
        gram: J^T J of all rows, shape (n_weights, n_weights).
    """
    # the columns of a whitening are directions of unit columns, but for their length
    directions = whitening_of(gram) * np.sqrt(np.diag(gram))[:, None]
    directions /= np.linalg.norm(directions, axis=0)
    return np.asarray(np.sum(directions**2, axis=1) < 1.0 - _DETERMINED)


def clustered_covariance(gram: Array, clusters: Iterable[tuple[Array, Array]]) -> Array:
    """Return the covariance of weights fitted by least squares, inf on the diagonal of those not determined.

    Args:
        gram: J^T J of all rows, shape (n_weights, n_weights).
        clusters: blocks of many clusters at once: columns, shape (n_clusters, n_rows, n_weights), and residuals,
            shape (n_clusters, n_rows).
    """
    whitening = whitening_of(gram)
    scores = []
    for columns, left in clusters:
        unit = columns @ whitening
        rest = np.eye(left.shape[1]) - np.einsum("cip,cjp->cij", unit, unit)
        values, vectors = np.linalg.eigh(rest)
        along = np.einsum("cij,ci->cj", vectors, left) / np.sqrt(np.maximum(values, _LEAST_LEFT))
        scores.append(np.einsum("cip,ci->cp", unit, np.einsum("cij,cj->ci", vectors, along)))
    stacked = np.concatenate(scores)
    meat = gram_of([(stacked, np.ones(stacked.shape[0], dtype=np.bool_))])
    found = whitening @ meat @ whitening.T
    is_open = undetermined(gram)
    found[is_open, is_open] = np.inf
    return np.asarray(found)

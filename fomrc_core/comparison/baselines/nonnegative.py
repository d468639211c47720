"""Weights that are not negative, by least squares over several records."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Array = NDArray[np.float64]


def nonnegative_weights(columns: Sequence[Array], targets: Sequence[Array]) -> Array:
    """Return w >= 0 that minimises the sum of |columns w - target|^2, shape (n_columns,).

    Args:
        columns: per record, shape (n_samples, n_columns).
        targets: per record, shape (n_samples,).
    """
    stacked = np.vstack([np.column_stack(pair) for pair in zip(columns, targets, strict=True)])
    # The triangular factor holds all that matters, and is small.
    triangle: Array = np.asarray(np.linalg.qr(stacked, mode="r"))
    matrix, target = triangle[:, :-1], triangle[:, -1]
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale <= 1e-12 * scale.max(initial=0.0)] = np.inf  # columns the record never moves
    weights, _ = nnls(matrix / scale, target, maxiter=50 * matrix.shape[1])
    found: Array = weights / scale
    return found

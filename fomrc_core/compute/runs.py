"""Where a condition holds without a break."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Bounds: TypeAlias = NDArray[np.int64]
"""First and one past the last sample of each run, shape (n_runs, 2)."""


def runs_of(mask: ArrayLike) -> Bounds:
    """Return the runs in which a mask, shape (n_samples,), is true, in order, shape (n_runs, 2)."""
    is_true = np.concatenate(([False], np.asarray(mask, dtype=np.bool_), [False]))
    return np.asarray(np.flatnonzero(is_true[1:] != is_true[:-1]).reshape(-1, 2), dtype=np.int64)

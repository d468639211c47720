"""Creep with its whole past: the exact batch form that the fast operator of ``creep.py`` is measured against.

For an input that is linear between samples and rose linearly from zero over the first step, (18)-(19) give

    x_k = sum_j (y_j - y_{j-1}) / dt_j
          * ((t_k - t_{j-1})^(alpha+1) - (t_k - t_j)^(alpha+1)) / Gamma(alpha + 2),

product integration: exact for such an input, with no memory cut and no modes. Cost grows with the square of
the number of samples, or as N log N for uniform steps.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from fomrc_core.errors import ParameterError
from fomrc_core.operators.creep import check_order

Array = NDArray[np.float64]


def creep_full_memory(order: float, values: Array, steps_s: Array) -> Array:
    """Return ``I^alpha`` of the values, (18)-(19), from the whole past, shape (n_samples,).

    Args:
        order: alpha [1], 0 to 1.
        values: input, linear between samples, shape (n_samples,).
        steps_s: step that leads to each sample [s], > 0, any lengths, shape (n_samples,).

    Raises:
        ParameterError: order out of range, shapes that do not fit, a step that is not positive.
    """
    order = check_order(order, "order")
    y = np.asarray(values, dtype=np.float64)
    dt = np.asarray(steps_s, dtype=np.float64)
    if y.ndim != 1 or y.shape != dt.shape or y.size == 0:
        raise ParameterError(
            "steps_s and values do not fit",
            where="values",
            value=(dt.shape, y.shape),
            allowed="two arrays of one shape (n_samples,)",
        )
    if not np.all(dt > 0.0):
        raise ParameterError("step is not positive", where="steps_s", value=float(np.min(dt)), allowed="> 0 s")
    changes = np.diff(y, prepend=0.0)
    if np.all(dt == dt[0]):
        index = np.arange(1, y.size + 1, dtype=np.float64)
        weights = dt[0] ** order / math.gamma(order + 2.0) * _power_drop(order, index, np.ones(y.size))
        return np.asarray(fftconvolve(changes, weights)[: y.size])
    ends = np.cumsum(dt)
    slopes = changes / (dt * math.gamma(order + 2.0))
    result = np.empty(y.size)
    for k in range(y.size):
        since_start = (ends[k] - ends[: k + 1]) + dt[: k + 1]
        result[k] = np.dot(slopes[: k + 1], _power_drop(order, since_start, dt[: k + 1]))
    return result


def _power_drop(order: float, time: Array, step: Array) -> Array:
    # time^(a+1) - (time - step)^(a+1) without cancellation; the last step of all has time == step
    with np.errstate(divide="ignore"):
        shrink = np.log1p(-np.minimum(step / time, 1.0))
    return np.asarray(time ** (order + 1.0) * -np.expm1((order + 1.0) * shrink))

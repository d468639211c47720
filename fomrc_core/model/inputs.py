"""What a model or a compensator may be given: steps longer than nothing, values that are finite."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import ParameterError

Array = NDArray[np.float64]


def check_step(step_s: float, value: float, name: str) -> None:
    """Raise ParameterError unless a step [s] is positive and finite and the value that ends it finite."""
    if not 0.0 < step_s < math.inf:
        raise ParameterError("step is not positive", where="step_s", value=step_s, allowed="> 0 s, finite")
    if not -math.inf < value < math.inf:
        raise ParameterError("value is not finite", where=name, value=value, allowed="finite numbers")


def checked_inputs(steps_s: Array, values: Array, name: str) -> tuple[Array, Array]:
    """Return steps [s] and values as contiguous arrays of one shape (n_samples,); ParameterError for what is unfit.

    Args:
        steps_s: step that leads to each sample [s].
        values: drive [V] or desired displacement [um].
        name: what the values are called in the message.
    """
    steps = np.ascontiguousarray(steps_s, dtype=np.float64)
    inputs = np.ascontiguousarray(values, dtype=np.float64)
    if steps.ndim != 1 or steps.shape != inputs.shape or steps.size == 0:
        raise ParameterError(
            "steps_s and input do not fit",
            where=name,
            value=(steps.shape, inputs.shape),
            allowed="two arrays of one shape (n_samples,)",
        )
    is_bad = ~((steps > 0.0) & (steps < np.inf))
    if np.any(is_bad):
        k = int(np.argmax(is_bad))
        value = float(steps[k])
        raise ParameterError(f"step {k} is not positive", where="steps_s", value=value, allowed="> 0 s, finite")
    if not np.all(np.isfinite(inputs)):
        raise ParameterError("value is not finite", where=name, allowed="finite numbers")
    return steps, inputs

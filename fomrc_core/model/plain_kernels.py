"""Hysteresis and creep stepped without numba: the kernels' arithmetic, laid out for plain Python.

Loops over the entries of an array cost plain Python fifty times as much. Here some ten plays go through a list; a
step of creep, linear in modes, former and present input, is one product with a matrix made once for a step length;
views and names are local to a closure. Agrees with the kernels to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fomrc_core.operators import creep, hysteresis

Array = NDArray[np.float64]
Stepper = Callable[..., float]


class PlainKernels:
    """Steppers of one packed state, hysteresis block at 0, creep block at ``at_creep``; it moves on in place.

    Args:
        packed: packed state; the steppers hold views of it.
        at_creep: where the creep block begins.

    Attributes:
        forward: (voltage [V], step [s], displacement beside the elements [um]) -> displacement [um], play form.
        inverse: (displacement [um], step [s]) -> voltage [V], stop form.
        Both return NaN, and make no step, for input that is not fit.
    """

    __slots__ = ("forward", "inverse", "packed")

    def __init__(self, packed: Array, at_creep: int) -> None:
        self.packed = packed
        self.forward = _forward_stepper(packed, at_creep)
        self.inverse = _inverse_stepper(packed, at_creep)


def _hysteresis_views(packed: Array) -> tuple[float, list[tuple[int, float, float]], Array]:
    n_plays, first = int(packed[hysteresis.N_PLAYS]), hysteresis.HEADER
    thresholds, weights, plays = packed[first : first + 3 * n_plays].reshape(3, n_plays)
    elements = list(zip(range(n_plays), thresholds.tolist(), weights.tolist(), strict=True))
    return float(packed[hysteresis.SLOPE]), elements, plays


def _creep_matrix(packed: Array, at_creep: int, is_inverse: bool) -> Array:
    # Rows: the modes after the step, then the output. Columns: the modes, the former input, what is given now.
    header = packed[at_creep : at_creep + creep.HEADER]
    n_modes = int(header[creep.N_MODES])
    arrays = packed[at_creep + creep.HEADER :][: 7 * n_modes].reshape(7, n_modes)
    matrix = np.zeros((n_modes + 1, n_modes + 2))
    matrix[:n_modes, :n_modes] = np.diag(arrays[creep.DECAY])
    matrix[:n_modes, -2] = arrays[creep.FROM_PREVIOUS]
    history = np.concatenate((arrays[creep.WEIGHTED_DECAY], [header[creep.HELD_WEIGHT], 0.0]))
    given = np.concatenate((np.zeros(n_modes + 1), [1.0]))
    if is_inverse:
        matrix[-1] = (given - history) / header[creep.CURRENT_WEIGHT]
        matrix[:n_modes] += arrays[creep.FROM_CURRENT][:, None] * matrix[-1]
    else:
        matrix[-1] = history + header[creep.CURRENT_WEIGHT] * given
        matrix[:n_modes, -1] = arrays[creep.FROM_CURRENT]
    return matrix


def _creep_stepper(packed: Array, at_creep: int, is_inverse: bool) -> Stepper:
    n_modes, first = int(packed[at_creep + creep.N_MODES]), at_creep + creep.HEADER
    header = packed[at_creep:first]
    modes = packed[first + creep.MODE * n_modes : first + (creep.MODE + 1) * n_modes]
    before, after = np.zeros(n_modes + 2), np.zeros(n_modes + 1)
    modes_before, modes_after = before[:n_modes], after[:n_modes]
    at_previous, at_given, at_step = creep.PREVIOUS, n_modes + 1, creep.CACHED_STEP
    matrix, matrix_step = np.zeros((n_modes + 1, n_modes + 2)), 0.0

    def step(given: float, step_s: float) -> float:
        nonlocal matrix, matrix_step
        if step_s != matrix_step:
            if header[at_step] != step_s:
                creep.prepare_step(packed, at_creep, step_s)
            matrix, matrix_step = _creep_matrix(packed, at_creep, is_inverse), step_s
        modes_before[:] = modes
        before[n_modes] = header[at_previous]
        before[at_given] = given
        matrix.dot(before, after)
        modes[:] = modes_after
        output = after.item(n_modes)
        header[at_previous] = output if is_inverse else given
        return output

    return step


def _forward_stepper(packed: Array, at_creep: int) -> Stepper:
    slope, elements, plays = _hysteresis_views(packed)
    integrate, infinity = _creep_stepper(packed, at_creep, is_inverse=False), math.inf

    def forward(voltage_v: float, step_s: float, beside_um: float = 0.0) -> float:
        if not (0.0 < step_s < infinity and -infinity < voltage_v < infinity):
            return math.nan
        at, moved = plays.tolist(), slope * voltage_v
        for j, threshold, weight in elements:
            play = at[j]
            if play < voltage_v - threshold:
                at[j] = play = voltage_v - threshold
            elif play > voltage_v + threshold:
                at[j] = play = voltage_v + threshold
            moved += weight * play
        plays[:] = at
        return integrate(moved + beside_um, step_s)

    return forward


def _inverse_stepper(packed: Array, at_creep: int) -> Stepper:
    slope, elements, plays = _hysteresis_views(packed)
    differentiate, infinity = _creep_stepper(packed, at_creep, is_inverse=True), math.inf

    def inverse(desired_um: float, step_s: float) -> float:
        if not (0.0 < step_s < infinity and -infinity < desired_um < infinity):
            return math.nan
        moved = differentiate(desired_um, step_s)
        at, voltage_v = plays.tolist(), slope * moved
        for j, threshold, weight in elements:
            stop = moved - at[j]
            if stop > threshold:
                stop, at[j] = threshold, moved - threshold
            elif stop < -threshold:
                stop, at[j] = -threshold, moved + threshold
            voltage_v += weight * stop
        plays[:] = at
        return voltage_v

    return inverse

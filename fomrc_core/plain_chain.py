"""Hysteresis and creep stepped without numba: the kernels' arithmetic, laid out for plain Python.

Loops over the entries of an array cost plain Python fifty times as much: here some ten plays go through a list,
the modes through numpy views made once for a state, and names are local to a closure. Agrees with the kernels
to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy import add, multiply
from numpy.typing import NDArray

from fomrc_core import creep, hysteresis

Array = NDArray[np.float64]
Stepper = Callable[..., float]


class PlainChain:
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


def _creep_views(packed: Array, at_creep: int) -> tuple[Array, Array, Array, Array, Array]:
    n_modes, first = int(packed[at_creep + creep.N_MODES]), at_creep + creep.HEADER
    arrays = packed[first : first + 7 * n_modes].reshape(7, n_modes)
    from_inputs = arrays[creep.FROM_PREVIOUS : creep.FROM_CURRENT + 1]
    return packed[at_creep:first], arrays[creep.DECAY], arrays[creep.WEIGHTED_DECAY], from_inputs, arrays[creep.MODE]


def _forward_stepper(packed: Array, at_creep: int) -> Stepper:
    slope, elements, plays = _hysteresis_views(packed)
    header, decays, weighted_decays, from_inputs, modes = _creep_views(packed, at_creep)
    inputs, gained = np.empty(2), np.empty(modes.size)
    infinity, at_previous = math.inf, creep.PREVIOUS

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
        moved += beside_um
        _, _, previous, cached_step, current, held, _, _ = header.tolist()
        if step_s != cached_step:
            creep.prepare_step(packed, at_creep, step_s)
            _, _, previous, _, current, held, _, _ = header.tolist()
        result = current * moved + held * previous + weighted_decays.dot(modes).item()
        inputs[0], inputs[1] = previous, moved
        multiply(modes, decays, modes)
        add(modes, inputs.dot(from_inputs, gained), modes)
        header[at_previous] = moved
        return result  # type: ignore[no-any-return]

    return forward


def _inverse_stepper(packed: Array, at_creep: int) -> Stepper:
    slope, elements, plays = _hysteresis_views(packed)
    header, decays, weighted_decays, from_inputs, modes = _creep_views(packed, at_creep)
    inputs, gained = np.empty(2), np.empty(modes.size)
    infinity, at_previous = math.inf, creep.PREVIOUS

    def inverse(desired_um: float, step_s: float) -> float:
        if not (0.0 < step_s < infinity and -infinity < desired_um < infinity):
            return math.nan
        _, _, previous, cached_step, current, held, _, _ = header.tolist()
        if step_s != cached_step:
            creep.prepare_step(packed, at_creep, step_s)
            _, _, previous, _, current, held, _, _ = header.tolist()
        moved = (desired_um - held * previous - weighted_decays.dot(modes).item()) / current
        inputs[0], inputs[1] = previous, moved
        multiply(modes, decays, modes)
        add(modes, inputs.dot(from_inputs, gained), modes)
        header[at_previous] = moved
        at, voltage_v = plays.tolist(), slope * moved
        for j, threshold, weight in elements:
            stop = moved - at[j]
            if stop > threshold:
                stop, at[j] = threshold, moved - threshold
            elif stop < -threshold:
                stop, at[j] = -threshold, moved + threshold
            voltage_v += weight * stop
        plays[:] = at
        return voltage_v  # type: ignore[no-any-return]

    return inverse

"""Hysteresis and creep stepped without numba: the kernels' arithmetic on numpy views, made once for a state.

Loops over the entries of an array cost plain Python fifty times as much. Agrees with the kernels to rounding.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import add, maximum, minimum, multiply, subtract
from numpy.typing import NDArray

from fomrc_core import creep, hysteresis

Array = NDArray[np.float64]


class PlainChain:
    """Step one packed state, hysteresis block at 0, creep block at ``at_creep``; the state moves on in place.

    Args:
        packed: packed state; the views stay valid as long as this array is the state.
        at_creep: where the creep block begins.
    """

    def __init__(self, packed: Array, at_creep: int) -> None:
        self.packed, self._at_creep = packed, at_creep
        n_plays, first = int(packed[hysteresis.N_PLAYS]), hysteresis.HEADER
        thresholds = packed[first : first + n_plays]
        self._slope = float(packed[hysteresis.SLOPE])
        self._weights = packed[first + n_plays : first + 2 * n_plays]
        self._plays = packed[first + 2 * n_plays : first + 3 * n_plays]
        self._limits = np.concatenate((-thresholds, thresholds))
        self._reach = np.empty(2 * n_plays)
        self._value = np.empty(())  # a scalar made an array once, not at every operation
        self._low, self._high = self._reach[:n_plays], self._reach[n_plays:]
        self._lower, self._upper = self._limits[:n_plays], self._limits[n_plays:]
        n_modes = int(packed[at_creep + creep.N_MODES])
        self._header = packed[at_creep : at_creep + creep.HEADER]
        arrays = packed[at_creep + creep.HEADER :][: 7 * n_modes].reshape(7, n_modes)
        self._decays, self._modes = arrays[creep.DECAY], arrays[creep.MODE]
        self._weighted_decays = arrays[creep.WEIGHTED_DECAY]
        self._from_inputs = arrays[creep.FROM_PREVIOUS : creep.FROM_CURRENT + 1]
        self._inputs, self._gained = np.empty(2), np.empty(n_modes)

    def forward(self, voltage_v: float, step_s: float) -> float:
        """Return the displacement [um] after one step; NaN, and no step, for input that is not fit."""
        if not (0.0 < step_s < math.inf and -math.inf < voltage_v < math.inf):
            return math.nan
        return self.integrate(self.move_plays(voltage_v), step_s)

    def inverse(self, desired_um: float, step_s: float) -> float:
        """Return the voltage [V] after one step; NaN, and no step, for input that is not fit."""
        if not (0.0 < step_s < math.inf and -math.inf < desired_um < math.inf):
            return math.nan
        return self.move_stops(self.differentiate(desired_um, step_s))

    def move_plays(self, value: float) -> float:
        """Return the play sum at the new input."""
        plays, self._value[()] = self._plays, value
        add(self._limits, self._value, out=self._reach)
        maximum(plays, self._low, out=plays)
        minimum(plays, self._high, out=plays)
        return self._slope * value + self._weights.dot(plays).item()

    def move_stops(self, value: float) -> float:
        """Return the stop sum at the new input."""
        plays, stops, self._value[()] = self._plays, self._low, value
        subtract(self._value, plays, out=stops)
        maximum(stops, self._lower, out=stops)
        minimum(stops, self._upper, out=stops)
        subtract(self._value, stops, out=plays)
        return self._slope * value + self._weights.dot(stops).item()

    def integrate(self, value: float, step_s: float) -> float:
        """Return ``I^alpha`` of the input after one step."""
        _, _, previous, cached_step, current, held, _, _ = self._header.tolist()
        if step_s != cached_step:
            current, held = self._prepare(step_s)
        modes, inputs = self._modes, self._inputs
        result = current * value + held * previous + self._weighted_decays.dot(modes).item()
        inputs[0], inputs[1] = previous, value
        multiply(modes, self._decays, out=modes)
        add(modes, inputs.dot(self._from_inputs, self._gained), out=modes)
        self._header[creep.PREVIOUS] = value
        return result

    def differentiate(self, value: float, step_s: float) -> float:
        """Return ``D^alpha`` of the input after one step."""
        _, _, previous, cached_step, current, held, _, _ = self._header.tolist()
        if step_s != cached_step:
            current, held = self._prepare(step_s)
        modes, inputs = self._modes, self._inputs
        result = (value - held * previous - self._weighted_decays.dot(modes).item()) / current
        inputs[0], inputs[1] = previous, result
        multiply(modes, self._decays, out=modes)
        add(modes, inputs.dot(self._from_inputs, self._gained), out=modes)
        self._header[creep.PREVIOUS] = result
        return result

    def _prepare(self, step_s: float) -> tuple[float, float]:
        creep.prepare_step(self.packed, self._at_creep, step_s)
        return float(self._header[creep.CURRENT_WEIGHT]), float(self._header[creep.HELD_WEIGHT])

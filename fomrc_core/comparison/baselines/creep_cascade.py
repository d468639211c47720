"""Creep as the rivals have it, in cascade behind hysteresis: logarithmic, and linear time-invariant.

    x(t) = h(t) + sum_j g_j lag_j[h](t),     d lag_j / dt = (h - lag_j) / tau_j

Linear time-invariant creep: free g_j, three time constants (springs and dampers in series; Croft, Shedd and
Devasia 2000, reference 4; Pesotski, Janocha and Kuhnen 2010, reference 9).
Logarithmic creep: x = h [1 + gamma log10(t / t_0)] after a step (reference 4); for any other input one
equal weight per decade of time constant, which is how Kuhnen 2005 (reference 5) approximates log(t)-type
creep.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled

Array = NDArray[np.float64]

LINEAR_TIME_CONSTANTS_S = (0.1, 1.0, 10.0)
LOGARITHMIC_TIME_CONSTANTS_S = (0.1, 1.0, 10.0, 100.0, 1000.0)


@compiled
def lag(values: Array, steps_s: Array, time_constant_s: float) -> Array:
    """Return the first-order lag of each column, exact for values linear between samples."""
    out = np.empty_like(values)
    state = np.zeros(values.shape[1])
    before = np.zeros(values.shape[1])
    for k in range(values.shape[0]):
        a = steps_s[k] / time_constant_s
        keep = np.exp(-a)
        mean = -np.expm1(-a) / a
        state = keep * state + (mean - keep) * before + (1.0 - mean) * values[k]
        before = values[k]
        out[k] = state
    return out


@compiled
def undo(wanted: Array, steps_s: Array, time_constants_s: Array, gains: Array) -> Array:
    """Return h of x = h + sum_j g_j lag_j[h], sample by sample, the exact inverse."""
    out = np.empty(wanted.size)
    states = np.zeros(gains.size)
    before = 0.0
    for k in range(wanted.size):
        a = steps_s[k] / time_constants_s
        keep = np.exp(-a)
        mean = -np.expm1(-a) / a
        states = keep * states + (mean - keep) * before
        before = (wanted[k] - np.sum(gains * states)) / (1.0 + np.sum(gains * (1.0 - mean)))
        states = states + (1.0 - mean) * before
        out[k] = before
    return out


@dataclass(frozen=True, eq=False)
class CreepCascade:
    """Creep with its gains known.

    Attributes:
        time_constants_s: [s], shape (n,).
        gains: g_j [1], shape (n,).
        n_parameters: free gains.
    """

    time_constants_s: Array
    gains: Array
    n_parameters: int

    def apply(self, steps_s: Array, values: Array) -> Array:
        """Return x for h, columns apart where there are columns."""
        columns = np.ascontiguousarray(values if values.ndim == 2 else values[:, None])
        total: Array = columns.copy()
        for tau, gain in zip(self.time_constants_s, self.gains, strict=True):
            if gain != 0.0:
                total += gain * lag(columns, steps_s, tau)
        return total if values.ndim == 2 else total[:, 0]

    def undo(self, steps_s: Array, wanted: Array) -> Array:
        """Return h for x, shape (n_samples,)."""
        return undo(np.ascontiguousarray(wanted), steps_s, self.time_constants_s, self.gains)


NO_CREEP = CreepCascade(np.empty(0), np.empty(0), 0)


def linear_creep(gains: Array) -> CreepCascade:
    """Return linear time-invariant creep with these gains, shape (3,)."""
    return CreepCascade(np.array(LINEAR_TIME_CONSTANTS_S), np.asarray(gains, dtype=np.float64), 3)


def logarithmic_creep(gain: float) -> CreepCascade:
    """Return logarithmic creep with one gain for every decade."""
    time_constants = np.array(LOGARITHMIC_TIME_CONSTANTS_S)
    return CreepCascade(time_constants, np.full(time_constants.size, float(gain)), 1)

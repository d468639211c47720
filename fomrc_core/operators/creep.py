"""Creep: the fractional-order operator of equations (18)-(19), both directions, O(1) memory and cost.

``x = I^alpha y`` (voltage side to displacement) and its inverse ``y = D^alpha x``, relaxed at t = 0, as a sum of
exponential modes (``creep_nodes.py``).

Discretisation convention. Between samples the input is linear (first-order hold); before the first sample it
rose linearly from zero over one step. The part of the current step is integrated exactly,
``w0(dt) = dt^alpha / Gamma(alpha + 2)`` times the change of the input; everything older goes through the
modes, which are exact for a first-order hold of any step length. So

    x_k = w0 (y_k - y_{k-1}) + history,        y_k = y_{k-1} + (x_k - history) / w0:

each direction is the exact inverse of the other, by algebra and not by approximation.

Sums over modes may be taken in any order (vector registers). The compiler chooses the order, and asks at run time how
far apart the arrays lie that a loop uses: so the arrays of such a loop are parts of one, and a state that was saved,
copied or moved goes on bit for bit, wherever it lies in memory. Records go through ``creep_batch.py``.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled_inline, compiled_sums
from fomrc_core.operators.creep_modes import (
    DEFAULT_ACCURACY,
    LONGEST_TIME_S,
    SHORTEST_TIME_S,
    CreepModes,
    check_order,
    creep_modes,
    creep_modes_slope,
    shortest_time_for,
    step_response,
)

__all__ = [
    "DEFAULT_ACCURACY",
    "LONGEST_TIME_S",
    "SHORTEST_TIME_S",
    "CreepModes",
    "check_order",
    "creep_block",
    "creep_modes",
    "creep_modes_slope",
    "differentiate_step",
    "integrate_step",
    "mode_states",
    "prepare_step",
    "shortest_time_for",
    "step_response",
]

Array = NDArray[np.float64]

# Layout of a creep block in a packed array, relative to its first entry.
N_MODES, FEEDTHROUGH, PREVIOUS, CACHED_STEP, CURRENT_WEIGHT, HELD_WEIGHT, ORDER, INVERSE_GAMMA, HEADER = range(9)
# After the header, n_modes entries each:
RATE, WEIGHT, DECAY, FROM_PREVIOUS, FROM_CURRENT, WEIGHTED_DECAY, MODE = range(7)
_N_ARRAYS = 7

_SERIES_LIMIT = 0.5
# Of rate times step: a share of 1e-60 is left, nothing beside rounding. Batches take it to the fourth power, and
# numbers below 1e-308 cost a processor a hundred times as much as others.
_ALL_GONE = 138.0


def creep_block(modes: CreepModes) -> Array:
    """Return a relaxed packed creep block: header, then rates, weights, step coefficients and mode states."""
    n_modes = modes.n_modes
    block = np.zeros(HEADER + _N_ARRAYS * n_modes)
    block[N_MODES] = n_modes
    block[FEEDTHROUGH] = modes.feedthrough
    block[ORDER] = modes.order
    block[INVERSE_GAMMA] = 1.0 / math.gamma(modes.order + 2.0)
    block[HEADER : HEADER + n_modes] = modes.rates_per_s
    block[HEADER + WEIGHT * n_modes : HEADER + (WEIGHT + 1) * n_modes] = modes.weights
    return block


def mode_states(block: Array) -> Array:
    """Return a view of the mode states of a creep block, shape (n_modes,)."""
    n_modes = int(block[N_MODES])
    return block[HEADER + MODE * n_modes : HEADER + (MODE + 1) * n_modes]


@compiled_sums
def prepare_step(packed: Array, at: int, step_s: float) -> None:
    """Compute the coefficients of a step length [s]; they stay until the step length changes."""
    n_modes = int(packed[at + N_MODES])
    first = at + HEADER
    rates = packed[first : first + n_modes]
    weights = packed[first + WEIGHT * n_modes : first + (WEIGHT + 1) * n_modes]
    decays = packed[first + DECAY * n_modes : first + (DECAY + 1) * n_modes]
    previous = packed[first + FROM_PREVIOUS * n_modes : first + (FROM_PREVIOUS + 1) * n_modes]
    current = packed[first + FROM_CURRENT * n_modes : first + (FROM_CURRENT + 1) * n_modes]
    weighted = packed[first + WEIGHTED_DECAY * n_modes : first + (WEIGHTED_DECAY + 1) * n_modes]
    n_slow = 0  # rates ascend
    while n_slow < n_modes and rates[n_slow] * step_s < _SERIES_LIMIT:
        n_slow += 1
    for j in range(n_slow):
        a = rates[j] * step_s
        # series of (1 - (1 - e^-a)/a)/a, sum of (-a)^k / (k + 2)!: the closed form cancels for small a
        ramp = 1.0 / 87178291200.0 - a / 1307674368000.0
        ramp = 1.0 / 479001600.0 - a * (1.0 / 6227020800.0 - a * ramp)
        ramp = 1.0 / 3628800.0 - a * (1.0 / 39916800.0 - a * ramp)
        ramp = 1.0 / 40320.0 - a * (1.0 / 362880.0 - a * ramp)
        ramp = 1.0 / 720.0 - a * (1.0 / 5040.0 - a * ramp)
        ramp = 1.0 / 24.0 - a * (1.0 / 120.0 - a * ramp)
        ramp = 0.5 - a * (1.0 / 6.0 - a * ramp)
        mean = 1.0 - a * ramp
        decays[j] = 1.0 - a * mean
        previous[j] = step_s * (mean - ramp)
        current[j] = step_s * ramp
    for j in range(n_slow, n_modes):
        a = rates[j] * step_s
        decays[j] = math.exp(-a) if a < _ALL_GONE else 0.0
        mean = (1.0 - decays[j]) / a
        ramp = (1.0 - mean) / a
        previous[j] = step_s * (mean - ramp)
        current[j] = step_s * ramp
    held = 0.0
    for j in range(n_modes):
        weighted[j] = weights[j] * decays[j]
        held += weights[j] * (previous[j] + current[j])
    current_weight = step_s ** packed[at + ORDER] * packed[at + INVERSE_GAMMA]
    packed[at + CURRENT_WEIGHT] = current_weight
    packed[at + HELD_WEIGHT] = packed[at + FEEDTHROUGH] - current_weight + held
    packed[at + CACHED_STEP] = step_s


@compiled_inline
def creep_history(packed: Array, at: int) -> float:
    """Return what the past alone gives at the end of the prepared step, with the current input at zero."""
    n_modes = int(packed[at + N_MODES])
    decays = at + HEADER + WEIGHTED_DECAY * n_modes
    weighted = packed[decays : decays + n_modes]
    modes = packed[decays + n_modes : decays + 2 * n_modes]
    history = 0.0
    for j in range(n_modes):
        history += weighted[j] * modes[j]
    output: float = packed[at + HELD_WEIGHT] * packed[at + PREVIOUS] + history
    return output


@compiled_inline
def creep_remember(packed: Array, at: int, current: float) -> None:
    """Move the modes to the end of the prepared step, at which the input is ``current``."""
    n_modes = int(packed[at + N_MODES])
    first = at + HEADER
    decays = packed[first + DECAY * n_modes : first + (DECAY + 1) * n_modes]
    from_previous = packed[first + FROM_PREVIOUS * n_modes : first + (FROM_PREVIOUS + 1) * n_modes]
    from_current = packed[first + FROM_CURRENT * n_modes : first + (FROM_CURRENT + 1) * n_modes]
    modes = packed[first + MODE * n_modes : first + (MODE + 1) * n_modes]
    previous = packed[at + PREVIOUS]
    for j in range(n_modes):
        modes[j] = decays[j] * modes[j] + from_previous[j] * previous + from_current[j] * current
    packed[at + PREVIOUS] = current


@compiled_inline
def integrate_step(packed: Array, at: int, value: float, step_s: float) -> float:
    """Return ``I^alpha`` of the input after one step; the block's state moves on."""
    if step_s != packed[at + CACHED_STEP]:
        prepare_step(packed, at, step_s)
    result: float = packed[at + CURRENT_WEIGHT] * value + creep_history(packed, at)
    creep_remember(packed, at, value)
    return result


@compiled_inline
def differentiate_step(packed: Array, at: int, value: float, step_s: float) -> float:
    """Return ``D^alpha`` of the input after one step; the exact inverse of ``integrate_step``."""
    if step_s != packed[at + CACHED_STEP]:
        prepare_step(packed, at, step_s)
    result: float = (value - creep_history(packed, at)) / packed[at + CURRENT_WEIGHT]
    creep_remember(packed, at, result)
    return result

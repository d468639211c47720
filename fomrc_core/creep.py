"""Creep: the fractional-order operator of equations (18)-(19), both directions, O(1) memory and cost.

``x = I^alpha y`` (voltage side to displacement) and its inverse ``y = D^alpha x``, relaxed at t = 0.

Diffusive representation. With ``r = e^z``,

    s^-alpha = sin(pi alpha)/pi * integral over z of e^((1-alpha) z) / (s + e^z),

and the trapezoid rule in z converges exponentially, its nodes ``r_m = e^(m h)`` not depending on alpha. The
two infinite tails of the sum are geometric series: the fast one is a feedthrough, the slow one an integrator
(and, to match its first moment, a correction of the slowest node). So alpha = 0 is exactly no creep and
alpha = 1 exactly an integrator, with the same nodes.

Discretisation convention. Between samples the input is linear (first-order hold); before the first sample it
rose linearly from zero over one step. The part of the current step is integrated exactly,
``w0(dt) = dt^alpha / Gamma(alpha + 2)`` times the change of the input; everything older goes through the
modes, which are exact for a first-order hold of any step length. So

    x_k = w0 (y_k - y_{k-1}) + history,        y_k = y_{k-1} + (x_k - history) / w0:

each direction is the exact inverse of the other, by algebra and not by approximation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gamma

from fomrc_core.compiled import compiled
from fomrc_core.errors import ParameterError

SHORTEST_TIME_S = 2e-4
LONGEST_TIME_S = 1e5
DEFAULT_ACCURACY = 1e-6

# Layout of a creep block in a packed array, relative to its first entry.
N_MODES, FEEDTHROUGH, PREVIOUS, CACHED_STEP, CURRENT_WEIGHT, HELD_WEIGHT, ORDER, INVERSE_GAMMA, HEADER = range(9)
# After the header, n_modes entries each:
RATE, WEIGHT, DECAY, FROM_PREVIOUS, FROM_CURRENT, WEIGHTED_DECAY, MODE = range(7)
_N_ARRAYS = 7


@dataclass(frozen=True)
class CreepModes:
    """Nodes and weights of the diffusive representation.

    Attributes:
        order: creep order alpha [1].
        feedthrough: instantaneous part [s^alpha].
        rates_per_s: node rates [1/s], shape (n_modes,); the first is 0, the integrator.
        weights: their weights, shape (n_modes,).
    """

    order: float
    feedthrough: float
    rates_per_s: NDArray[np.float64]
    weights: NDArray[np.float64]

    @property
    def n_modes(self) -> int:
        """Number of modes, the integrator among them."""
        return int(self.rates_per_s.size)


def check_order(order: float, where: str = "creep_order") -> float:
    """Return the creep order as float; raises ParameterError outside 0..1."""
    if isinstance(order, (bool, str)) or not isinstance(order, (int, float, np.floating, np.integer)):
        raise ParameterError("creep order is not a number", where=where, value=order, allowed="0 to 1")
    if not (math.isfinite(order) and 0.0 <= order <= 1.0):
        raise ParameterError("creep order out of range", where=where, value=float(order), allowed="0 to 1")
    return float(order)


def creep_modes(
    order: float,
    accuracy: float = DEFAULT_ACCURACY,
    shortest_time_s: float = SHORTEST_TIME_S,
    longest_time_s: float = LONGEST_TIME_S,
) -> CreepModes:
    """Return the modes of ``s^-alpha``, (18)-(19).

    Args:
        order: alpha [1], 0 to 1.
        accuracy: relative error of the step response between the two times [1], 1e-10 to 1e-1.
        shortest_time_s: shortest time the accuracy holds for [s].
        longest_time_s: longest time the accuracy holds for [s].

    Raises:
        ParameterError: a value out of range.
    """
    order = check_order(order)
    if not 1e-10 <= accuracy <= 0.1:
        raise ParameterError("accuracy out of range", where="accuracy", value=accuracy, allowed="1e-10 to 0.1")
    if not 0.0 < shortest_time_s < longest_time_s < math.inf:
        raise ParameterError("time span out of order", where="shortest_time_s, longest_time_s",
                             value=(shortest_time_s, longest_time_s), allowed="0 < shortest < longest")  # fmt: skip
    if order == 0.0:
        return CreepModes(order, 1.0, np.empty(0), np.empty(0))
    if order == 1.0:
        return CreepModes(order, 0.0, np.zeros(1), np.ones(1))
    return _cut_modes(order, *_node_range(accuracy, shortest_time_s, longest_time_s))


def creep_modes_slope(
    order: float,
    accuracy: float = DEFAULT_ACCURACY,
    shortest_time_s: float = SHORTEST_TIME_S,
    longest_time_s: float = LONGEST_TIME_S,
) -> CreepModes:
    """Return modes whose response is the derivative of ``s^-alpha`` with respect to alpha.

    The nodes are fixed, so the derivative is the same modes with other weights. Within 1e-4 of either end of
    0..1 the derivative is taken at that distance from the end.
    """
    order = min(max(check_order(order), 1e-4), 1.0 - 1e-4)
    step = 1e-5
    span = _node_range(accuracy, shortest_time_s, longest_time_s)
    above, below = _cut_modes(order + step, *span), _cut_modes(order - step, *span)
    return CreepModes(
        order,
        (above.feedthrough - below.feedthrough) / (2.0 * step),
        above.rates_per_s,
        (above.weights - below.weights) / (2.0 * step),
    )


def _node_range(accuracy: float, shortest_time_s: float, longest_time_s: float) -> tuple[float, int, int]:
    # The trapezoid error of the step response decays as exp(-pi^2 / h); half of that was seen over all orders.
    spacing = math.pi**2 / math.log(0.7 / accuracy)
    # Past the fast end a mode must have decayed at the shortest time: exp(-r t) <= accuracy.
    fastest = math.ceil(math.log(math.log(0.5 / accuracy) / shortest_time_s) / spacing)
    # Past the slow end two moments of the tail are matched, the third errs as (r t)^2 / 6 of a tail that is
    # itself small: r t at the longest time may be as large as accuracy^(1/3).
    slowest = math.floor((math.log(2.0 * accuracy) / 3.0 - math.log(longest_time_s)) / spacing)
    return spacing, slowest, fastest


def _cut_modes(order: float, spacing: float, slowest: int, fastest: int) -> CreepModes:
    index = np.arange(slowest, fastest + 1)
    z = spacing * index
    scale = spacing * math.sin(math.pi * order) / math.pi
    rates = np.exp(z)
    weights = scale * np.exp((1.0 - order) * z)
    # sum over m > fastest of e^(-alpha z): a geometric series, the feedthrough
    feedthrough = scale * math.exp(-order * spacing * (fastest + 1)) / -math.expm1(-order * spacing)
    # sum over m < slowest of e^((1-alpha) z)/(s + e^z) by an integrator and the slowest node, two moments kept
    first = spacing * (slowest - 1)
    tail_weight = scale * math.exp((1.0 - order) * first) / -math.expm1(-(1.0 - order) * spacing)
    tail_moment = scale * math.exp((2.0 - order) * first) / -math.expm1(-(2.0 - order) * spacing)
    shared = tail_moment / rates[0]
    weights[0] += shared
    return CreepModes(
        order,
        feedthrough,
        np.concatenate(([0.0], rates)),
        np.concatenate(([tail_weight - shared], weights)),
    )


def step_response(modes: CreepModes, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the response of the modes to a unit step at t = 0, shape of ``time_s``."""
    t = np.asarray(time_s, dtype=np.float64)
    total = np.full(t.shape, modes.feedthrough)
    for rate, weight in zip(modes.rates_per_s, modes.weights, strict=True):
        total = total + weight * (t if rate == 0.0 else -np.expm1(-rate * t) / rate)
    return total


def creep_block(modes: CreepModes) -> NDArray[np.float64]:
    """Return a relaxed packed creep block: header, then rates, weights, step coefficients and mode states."""
    n_modes = modes.n_modes
    block = np.zeros(HEADER + _N_ARRAYS * n_modes)
    block[N_MODES] = n_modes
    block[FEEDTHROUGH] = modes.feedthrough
    block[ORDER] = modes.order
    block[INVERSE_GAMMA] = 1.0 / gamma(modes.order + 2.0)
    block[HEADER : HEADER + n_modes] = modes.rates_per_s
    block[HEADER + WEIGHT * n_modes : HEADER + (WEIGHT + 1) * n_modes] = modes.weights
    return block


def mode_states(block: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a view of the mode states of a creep block, shape (n_modes,)."""
    n_modes = int(block[N_MODES])
    return block[HEADER + MODE * n_modes : HEADER + (MODE + 1) * n_modes]


@compiled
def prepare_step(packed: NDArray[np.float64], at: int, step_s: float) -> None:
    """Compute the coefficients of a step length [s]; they stay until the step length changes."""
    n_modes = int(packed[at + N_MODES])
    base = at + HEADER
    order = packed[at + ORDER]
    current = step_s**order * packed[at + INVERSE_GAMMA]
    held = packed[at + FEEDTHROUGH] - current
    for j in range(n_modes):
        rate = packed[base + j]
        weight = packed[base + WEIGHT * n_modes + j]
        a = rate * step_s
        if a < 1e-3:
            # series of (1-e^-a)/a and (1-(1-e^-a)/a)/a: the closed forms cancel for small a
            mean = 1.0 - a * (0.5 - a * (1.0 / 6.0 - a * (1.0 / 24.0 - a / 120.0)))
            ramp = 0.5 - a * (1.0 / 6.0 - a * (1.0 / 24.0 - a * (1.0 / 120.0 - a / 720.0)))
        else:
            mean = -math.expm1(-a) / a
            ramp = (1.0 - mean) / a
        decay = math.exp(-a)
        packed[base + DECAY * n_modes + j] = decay
        packed[base + FROM_PREVIOUS * n_modes + j] = step_s * (mean - ramp)
        packed[base + FROM_CURRENT * n_modes + j] = step_s * ramp
        packed[base + WEIGHTED_DECAY * n_modes + j] = weight * decay
        held += weight * step_s * mean
    packed[at + CURRENT_WEIGHT] = current
    packed[at + HELD_WEIGHT] = held
    packed[at + CACHED_STEP] = step_s


@compiled
def creep_history(packed: NDArray[np.float64], at: int) -> float:
    """Return what the past alone gives at the end of the prepared step, with the current input at zero."""
    n_modes = int(packed[at + N_MODES])
    decays = at + HEADER + WEIGHTED_DECAY * n_modes
    modes = at + HEADER + MODE * n_modes
    history = packed[at + HELD_WEIGHT] * packed[at + PREVIOUS]
    for j in range(n_modes):
        history += packed[decays + j] * packed[modes + j]
    return history


@compiled
def creep_remember(packed: NDArray[np.float64], at: int, current: float) -> None:
    """Move the modes to the end of the prepared step, at which the input is ``current``."""
    n_modes = int(packed[at + N_MODES])
    base = at + HEADER
    previous = packed[at + PREVIOUS]
    for j in range(n_modes):
        packed[base + MODE * n_modes + j] = (
            packed[base + DECAY * n_modes + j] * packed[base + MODE * n_modes + j]
            + packed[base + FROM_PREVIOUS * n_modes + j] * previous
            + packed[base + FROM_CURRENT * n_modes + j] * current
        )
    packed[at + PREVIOUS] = current


@compiled
def integrate_step(packed: NDArray[np.float64], at: int, value: float, step_s: float) -> float:
    """Return ``I^alpha`` of the input after one step; the block's state moves on."""
    if step_s != packed[at + CACHED_STEP]:
        prepare_step(packed, at, step_s)
    result = packed[at + CURRENT_WEIGHT] * value + creep_history(packed, at)
    creep_remember(packed, at, value)
    return result


@compiled
def differentiate_step(packed: NDArray[np.float64], at: int, value: float, step_s: float) -> float:
    """Return ``D^alpha`` of the input after one step; the exact inverse of ``integrate_step``."""
    if step_s != packed[at + CACHED_STEP]:
        prepare_step(packed, at, step_s)
    result = (value - creep_history(packed, at)) / packed[at + CURRENT_WEIGHT]
    creep_remember(packed, at, result)
    return result


@compiled
def integrate(packed: NDArray[np.float64], at: int, values: NDArray[np.float64], steps_s: NDArray[np.float64],
              out: NDArray[np.float64]) -> None:  # fmt: skip
    """Fill ``out`` with ``I^alpha`` of the values, shape (n_samples,); the block's state moves on."""
    for k in range(values.size):
        out[k] = integrate_step(packed, at, values[k], steps_s[k])


@compiled
def differentiate(packed: NDArray[np.float64], at: int, values: NDArray[np.float64],
                  steps_s: NDArray[np.float64], out: NDArray[np.float64]) -> None:  # fmt: skip
    """Fill ``out`` with ``D^alpha`` of the values, shape (n_samples,); the block's state moves on."""
    for k in range(values.size):
        out[k] = differentiate_step(packed, at, values[k], steps_s[k])

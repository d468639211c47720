"""Nodes and weights of the fractional operator ``s^-alpha``, equations (18)-(19), for any order and accuracy.

Diffusive representation. With ``r = e^z``,

    s^-alpha = sin(pi alpha)/pi * integral over z of e^((1-alpha) z) / (s + e^z),

and the trapezoid rule in z converges exponentially, its nodes ``r_m = e^(m h)`` not depending on alpha. The
two infinite tails of the sum are geometric series: the fast one is a feedthrough, the slow one an integrator
and a correction of the slowest nodes that matches its first moments. So alpha = 0 is exactly no creep and
alpha = 1 exactly an integrator, with the same nodes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import ParameterError

SHORTEST_TIME_S = 4.6e-4
_SHORTEST_STEP_SHARE = 0.46  # of a step: the last two samples are taken exactly, modes speak from the third on
LONGEST_TIME_S = 1e5
DEFAULT_ACCURACY = 1e-6
_N_CORRECTED = 4  # slowest nodes whose weights take over the moments of the tail below them


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
        raise ParameterError(
            "time span out of order",
            where="shortest_time_s, longest_time_s",
            value=(shortest_time_s, longest_time_s),
            allowed="0 < shortest < longest",
        )
    if order == 0.0:
        return CreepModes(order, 1.0, np.empty(0), np.empty(0))
    if order == 1.0:
        return CreepModes(order, 0.0, np.zeros(1), np.ones(1))
    return _modes_between(order, accuracy, shortest_time_s, longest_time_s)


# A fit simulates with the same order time and again, and its modes cost it as much as a thousand samples.
@lru_cache(maxsize=64)
def _modes_between(order: float, accuracy: float, shortest_time_s: float, longest_time_s: float) -> CreepModes:
    modes = _cut_modes(order, *_node_range(accuracy, shortest_time_s, longest_time_s))
    for shared in (modes.rates_per_s, modes.weights):
        shared.flags.writeable = False
    return modes


def shortest_time_for(step_s: float) -> float:
    """Return the shortest time [s] modes must hold for where samples are this far apart [s].

    A power law has no time scale of its own, its modes have: a record sampled every 10 us sees creep that modes made
    for milliseconds do not have.
    """
    return min(SHORTEST_TIME_S, _SHORTEST_STEP_SHARE * step_s)


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
    # The trapezoid error of the step response, the largest over all orders, is 0.266 h^0.8 exp(-pi^2 / h).
    spacing = 1.0
    for _ in range(20):
        spacing = math.pi**2 / math.log(1.2 * 0.266 * spacing**0.8 / accuracy)
    # Past the fast end a mode must have decayed at the shortest time: exp(-r t) <= accuracy.
    fastest = math.ceil(math.log(math.log(0.5 / accuracy) / shortest_time_s) / spacing)
    # Past the slow end the first moments of the tail are matched; the next errs as (r t)^5 of a tail that is
    # itself small, so that r t at the longest time may be as large as accuracy^(1/5).
    slowest = math.floor((math.log(75.0 * accuracy) / 5.0 - math.log(longest_time_s)) / spacing)
    return spacing, slowest, max(fastest, slowest + _N_CORRECTED)


def _cut_modes(order: float, spacing: float, slowest: int, fastest: int) -> CreepModes:
    z = spacing * np.arange(slowest, fastest + 1)
    scale = spacing * math.sin(math.pi * order) / math.pi
    rates = np.exp(z)
    weights = scale * np.exp((1.0 - order) * z)
    # sum over m > fastest of e^(-alpha z): a geometric series, the feedthrough
    feedthrough = scale * math.exp(-order * spacing * (fastest + 1)) / -math.expm1(-order * spacing)
    # sum over m < slowest of w / (s + r): its moments are geometric series too. Rates in units of the slowest
    # node; an integrator takes moment zero, the slowest nodes the next ones.
    moment = np.arange(_N_CORRECTED + 1)
    decay = -(moment + 1.0 - order) * spacing
    tail = scale * math.exp((1.0 - order) * z[0]) * np.exp(decay) / -np.expm1(decay)
    powers = (rates[:_N_CORRECTED] / rates[0]) ** moment[1:, None]
    shares = np.linalg.solve(powers, tail[1:])
    weights[:_N_CORRECTED] += shares
    return CreepModes(
        order,
        feedthrough,
        np.concatenate(([0.0], rates)),
        np.concatenate(([tail[0] - np.sum(shares)], weights)),
    )


def step_response(modes: CreepModes, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the response of the modes to a unit step at t = 0, shape of ``time_s``."""
    t = np.asarray(time_s, dtype=np.float64)
    total = np.full(t.shape, modes.feedthrough)
    for rate, weight in zip(modes.rates_per_s, modes.weights, strict=True):
        total = total + weight * (t if rate == 0.0 else -np.expm1(-rate * t) / rate)
    return total

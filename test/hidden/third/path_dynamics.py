"""Dynamics with a state that no linear filter has, stepped through on the fine grid."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from test.hidden.third.arrays import Array
from test.hidden.third.virgin_curves import VirginCurve


def slew_limited(signal: Array, largest_step: float) -> Array:
    """Return what follows a signal by no more than one step a sample."""
    state, out = float(signal[0]), []
    for value in signal.tolist():
        state += min(max(value - state, -largest_step), largest_step)
        out.append(state)
    return np.array(out)


def switched_lag(signal: Array, time_constant_s: Callable[[float, float], float], step_s: float) -> Array:
    """Return the signal behind a lag whose time constant depends on where it is.

    Args:
        signal: on the grid, straight between its samples.
        time_constant_s: of the output and of how far it is behind.
        step_s: of the grid; the time constant is that at the step's beginning.
    """
    state, out = float(signal[0]), [float(signal[0])]
    for here, there in itertools.pairwise(signal.tolist()):
        q = step_s / time_constant_s(state, 0.5 * (here + there) - state)
        stays = math.exp(-q)
        state = state * stays + here * (1.0 - stays) + (there - here) * (1.0 - (1.0 - stays) / q)
        out.append(state)
    return np.array(out)


def play(signal: Array, half_width: float) -> Array:
    """Return what is dragged along behind a gap."""
    state, out = 0.0, []
    for value in signal.tolist():
        state = min(max(state, value - half_width), value + half_width)
        out.append(state)
    return np.array(out)


def stick_slip(signal: Array, breakaway: float, left_over: float) -> Array:
    """Return what sticks until it is pulled by the breakaway distance, and then slips to within a share of it."""
    state, out = 0.0, []
    for value in signal.tolist():
        if abs(value - state) > breakaway:
            state = value - math.copysign(left_over * breakaway, value - state)
        out.append(state)
    return np.array(out)


def domain_walls(voltage_v: Array, curve: VirginCurve, reach_v: float, per_v_per_s: float, step_s: float) -> Array:
    """Return a hysteresis whose walls need a field that grows with the drive's rate: thresholds r (1 + c |dv/dt|).

    Slow, it is a Masing response of the curve.

    Args:
        voltage_v: on a grid, straight between its samples.
        curve: of the first loading when slow.
        reach_v: the largest threshold that is of interest.
        per_v_per_s: widening of the thresholds for the rate, c.
        step_s: of the grid.
    """
    edges_v = reach_v * np.linspace(0.0, 1.0, 49) ** 1.3
    thresholds_v = 0.5 * (edges_v[1:] + edges_v[:-1])
    weights = np.diff(curve.slope(edges_v))
    widths = 1.0 + per_v_per_s * np.abs(np.diff(voltage_v, prepend=voltage_v[0])) / step_s
    position_v, out = np.zeros_like(thresholds_v), np.empty(voltage_v.size)
    for k, (value, width) in enumerate(zip(voltage_v.tolist(), widths.tolist(), strict=True)):
        position_v = np.minimum(np.maximum(position_v, value - width * thresholds_v), value + width * thresholds_v)
        out[k] = weights @ position_v
    return curve.slope_um_per_v * voltage_v + out

"""Ordinary differential equations of the truth, by the classical Runge-Kutta rule on the fine grid."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def first_order(values: np.ndarray, rate_per_s: float, step_s: float) -> np.ndarray:
    """Solve dz/dt = rate (v - z), z(0) = v(0), for v linear between the nodes."""
    out = np.empty_like(values)
    z = values[0]
    out[0] = z
    for k in range(1, values.size):
        v0, v1 = values[k - 1], values[k]
        vm = 0.5 * (v0 + v1)
        k1 = rate_per_s * (v0 - z)
        k2 = rate_per_s * (vm - z - 0.5 * step_s * k1)
        k3 = rate_per_s * (vm - z - 0.5 * step_s * k2)
        k4 = rate_per_s * (v1 - z - step_s * k3)
        z += step_s * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
        out[k] = z
    return out


@njit(cache=True)
def mass_spring_damper(values: np.ndarray, frequency_hz: float, damping_ratio: float, step_s: float) -> np.ndarray:
    """Solve z'' = w^2 (v - z) - 2 d w z' from rest, for v linear between the nodes: a base-driven mass."""
    out = np.empty_like(values)
    w = 2.0 * np.pi * frequency_hz
    w2, c = w * w, 2.0 * damping_ratio * w
    z, s = values[0], 0.0
    out[0] = z
    for k in range(1, values.size):
        v0, v1 = values[k - 1], values[k]
        vm = 0.5 * (v0 + v1)
        z1, s1 = s, w2 * (v0 - z) - c * s
        za, sa = z + 0.5 * step_s * z1, s + 0.5 * step_s * s1
        z2, s2 = sa, w2 * (vm - za) - c * sa
        za, sa = z + 0.5 * step_s * z2, s + 0.5 * step_s * s2
        z3, s3 = sa, w2 * (vm - za) - c * sa
        za, sa = z + step_s * z3, s + step_s * s3
        z4, s4 = sa, w2 * (v1 - za) - c * sa
        z += step_s * (z1 + 2.0 * z2 + 2.0 * z3 + z4) / 6.0
        s += step_s * (s1 + 2.0 * s2 + 2.0 * s3 + s4) / 6.0
        out[k] = z
    return out


@njit(cache=True)
def rate_limited(values: np.ndarray, rate_v_per_s: float, step_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Follow the values no faster than a rate, exactly for values linear between the nodes.

    Returns the output at the nodes, and the turning points between them (index of the node after, value):
    where a value met on its way turns the output round. Hysteresis remembers these: they must not be lost.
    """
    out = np.empty_like(values)
    index = np.empty(values.size, dtype=np.int64)
    turn = np.empty(values.size)
    n_turns = 0
    most = rate_v_per_s * step_s
    z = values[0]
    out[0] = z
    for k in range(1, values.size):
        v0, v1 = values[k - 1], values[k]
        move = v1 - v0
        if v0 == z:
            z += min(most, max(-most, move))
        else:
            chase = most if v0 > z else -most
            meeting = (v0 - z) / (chase - move) if chase != move else 2.0
            if 0.0 < meeting < 1.0:
                z += chase * meeting
                if move * chase < 0.0:
                    index[n_turns], turn[n_turns] = k, z
                    n_turns += 1
                z += (1.0 - meeting) * min(most, max(-most, move))
                if abs(move) <= most:
                    z = v1
            else:
                z += chase
        out[k] = z
    return out, index[:n_turns], turn[:n_turns]


def dead_band(values: np.ndarray, half_width: float) -> np.ndarray:
    """Swallow what is smaller than the half width, and that much of what is larger."""
    return np.sign(values) * np.maximum(np.abs(values) - half_width, 0.0)

"""Linear dynamics, exact for signals that are straight between the samples of their grid."""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import cont2discrete, lfilter

from test.hidden.third.arrays import Array


def respond(signal: Array, numerator: list[float], denominator: list[float], step_s: float) -> Array:
    """Return the response of a transfer function in s, from rest at zero.

    Args:
        signal: on the grid, shape (n,).
        numerator: coefficients of powers of s, highest first [s^power].
        denominator: likewise, of no lower degree.
        step_s: of the grid.
    """
    # In units of the step, so that no coefficient is far from one.
    top, bottom = ([c * step_s ** -(len(p) - 1 - k) for k, c in enumerate(p)] for p in (numerator, denominator))
    b, a, _ = cont2discrete((top, bottom), 1.0, method="foh")
    return np.asarray(lfilter(np.ravel(b), a, signal))


def lag(signal: Array, time_constant_s: float, step_s: float) -> Array:
    """Return the signal behind one lag."""
    return respond(signal, [1.0], [time_constant_s, 1.0], step_s)


def ring(signal: Array, frequency_hz: float, damping_ratio: float, step_s: float) -> Array:
    """Return the signal behind a mass on a spring."""
    omega = 2.0 * math.pi * frequency_hz
    return respond(signal, [1.0], [omega**-2, 2.0 * damping_ratio / omega, 1.0], step_s)


def poles(signal: Array, cutoff_hz: float, n_poles: int, step_s: float) -> Array:
    """Return the signal behind equal poles whose -3 dB frequency together is the cutoff."""
    time_constant_s = math.sqrt(2.0 ** (1.0 / n_poles) - 1.0) / (2.0 * math.pi * cutoff_hz)
    denominator = np.array([1.0])
    for _ in range(n_poles):
        denominator = np.convolve(denominator, [time_constant_s, 1.0])
    return respond(signal, [1.0], denominator.tolist(), step_s)

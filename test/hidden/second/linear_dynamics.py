"""Linear equations of motion, solved exactly for inputs straight between the nodes, from rest at an input of 0."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm
from scipy.signal import buttap, lfilter


def first_order_lag(values: np.ndarray, time_constant_s: float, step_s: float) -> np.ndarray:
    """Solve tau dz/dt = v - z; shape (n_samples,)."""
    along = step_s / time_constant_s
    kept, gain = np.exp(-along), -np.expm1(-along)
    ahead = 1.0 - gain / along  # of the input's end in the step, the rest is of its start
    return lfilter([ahead, gain - ahead], [1.0, -kept], values)


def leak(values: np.ndarray, time_constant_s: float, step_s: float) -> np.ndarray:
    """Solve dz/dt = dv/dt - z / tau: a charge that leaks away through a resistance."""
    return values - first_order_lag(values, time_constant_s, step_s)


def oscillator(values: np.ndarray, frequency_hz: float, damping_ratio: float, step_s: float) -> np.ndarray:
    """Solve z'' + 2 d w z' + w^2 z = w^2 v: a mass on a spring, or a coil and a capacitor."""
    turned = 2.0 * np.pi * frequency_hz * step_s
    # State z and z'/w, then the input and its change over the step: all exact in one exponential.
    whole = np.zeros((4, 4))
    whole[:2, :2] = turned * np.array([[0.0, 1.0], [-1.0, -2.0 * damping_ratio]])
    whole[1, 2] = turned
    whole[2, 3] = 1.0
    moved = expm(whole)
    phi, of_end = moved[:2, :2], moved[:2, 3]
    of_start = moved[:2, 2] - of_end
    a_1, a_2 = -np.trace(phi), np.linalg.det(phi)
    # The response to one impulse at its first three samples, less what the recursion makes of it.
    h_0, second = of_end[0], phi @ of_end + of_start
    h_1, h_2 = second[0], (phi @ second)[0]
    return lfilter([h_0, h_1 + a_1 * h_0, h_2 + a_1 * h_1 + a_2 * h_0], [1.0, a_1, a_2], values)


def low_pass(values: np.ndarray, cutoff_hz: float, order: int, step_s: float) -> np.ndarray:
    """Filter as a sensor's Butterworth low-pass of -3 dB at the cutoff does, section by section."""
    out = values
    for pole in buttap(order)[1]:
        if abs(pole.imag) < 1e-9:
            out = first_order_lag(out, 1.0 / (2.0 * np.pi * cutoff_hz), step_s)
        elif pole.imag > 0.0:
            out = oscillator(out, cutoff_hz, -pole.real, step_s)
    return out

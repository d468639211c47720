"""Creep as a sum of exponentials that is fitted to whatever law the step response has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.signal import lfilter

from test.hidden.third.arrays import Array

# Time constants a decade: with three, a power law is met to about 1e-4.
_PER_DECADE = 3


@dataclass(frozen=True)
class Modes:
    """A step response c + sum a_j (1 - exp(-t / tau_j)).

    Args:
        at_once: what arrives without delay, c.
        weights: a_j, shape (n_modes,).
        time_constants_s: tau_j, shape (n_modes,).
    """

    at_once: float
    weights: Array
    time_constants_s: Array

    def step_response(self, time_s: Array) -> Array:
        """Return the response to a step of one at time zero."""
        return self.at_once + (1.0 - np.exp(-time_s[:, None] / self.time_constants_s)) @ self.weights

    def respond(self, signal: Array, step_s: float) -> Array:
        """Return the response to a signal that is straight between its samples, exactly, from rest at zero."""
        out = self.at_once * signal
        for weight, time_constant_s in zip(self.weights, self.time_constants_s, strict=True):
            out = out + weight * late(signal, step_s, float(time_constant_s))
        return out


def late(signal: Array, step_s: float, time_constant_s: float) -> Array:
    """Return what follows a signal, straight between its samples, with one time constant, along the last axis."""
    q = step_s / time_constant_s
    stays = np.exp(-q)
    mean = -np.expm1(-q) / q
    b = np.array([1.0 - mean, mean - stays])
    out, _ = lfilter(b, [1.0, -stays], signal, axis=-1, zi=-b[0] * signal[..., :1])
    return np.asarray(out)


def time_constants(step_s: float, duration_s: float) -> Array:
    """Return the time constants that cover a record [s]."""
    low, high = np.log10(0.03 * step_s), np.log10(10.0 * duration_s)
    return np.logspace(low, high, int(np.ceil(_PER_DECADE * (high - low))) + 1)


def fit_modes(law: Callable[[Array], Array], constants_s: Array, step_s: float, duration_s: float) -> Modes:
    """Fit a sum of exponentials to a step response, by relative error over all times of a record.

    Args:
        law: the step response at times above zero.
        constants_s: the time constants to use.
        step_s: of the grid; a thirtieth of it is the shortest time that is fitted.
        duration_s: the longest.
    """
    time_s = np.logspace(np.log10(step_s / 30.0), np.log10(1.05 * duration_s), 40 * constants_s.size // 3)
    wanted = law(time_s)
    columns = np.column_stack([np.ones_like(time_s), 1.0 - np.exp(-time_s[:, None] / constants_s)])
    weights = np.linalg.lstsq(columns / wanted[:, None], np.ones_like(time_s), rcond=1e-12)[0]
    return Modes(float(weights[0]), weights[1:], constants_s)


@lru_cache(maxsize=64)
def power_law(order: float, reference_s: float, step_s: float, duration_s: float) -> Modes:
    """Return modes of the step response (t / reference)^order."""
    constants_s = time_constants(step_s, duration_s)
    return fit_modes(lambda t: (t / reference_s) ** order, constants_s, step_s, duration_s)


@lru_cache(maxsize=64)
def log_law(onset_s: float, step_s: float, duration_s: float) -> Modes:
    """Return modes of log10(1 + t / onset), the growth in decades."""
    constants_s = time_constants(step_s, duration_s)
    # One is added for the fit, whose errors are relative, and taken off again.
    modes = fit_modes(lambda t: 1.0 + np.log10(1.0 + t / onset_s), constants_s, step_s, duration_s)
    return Modes(modes.at_once - 1.0, modes.weights, modes.time_constants_s)

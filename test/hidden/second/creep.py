"""Creep by its step response: a power law, the logarithm of time, or a spectrum of relaxations.

The response to any drive follows by superposition, by one convolution for drives that are straight between nodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.special import gamma

_N_AT_ONCE = 8  # columns: a hundred long ones would not fit into memory as spectra


@dataclass(frozen=True)
class PowerLaw:
    """Fractional integral: step response (t / reference)^order, 1 at the reference time."""

    order: float
    reference_s: float

    def after_ramp(self, time_s: np.ndarray) -> np.ndarray:
        """Return the integral of the step response over time [s], shape of the time."""
        scale = gamma(1.0 + self.order) * self.reference_s ** (-self.order)
        return scale * time_s ** (1.0 + self.order) / gamma(2.0 + self.order)

    def of_step(self, time_s: np.ndarray) -> np.ndarray:
        """Return the step response [1]."""
        return (time_s / self.reference_s) ** self.order


@dataclass(frozen=True)
class Logarithmic:
    """Step response 1 + per_decade log10(1 + t / onset)."""

    per_decade: float
    onset_s: float

    def after_ramp(self, time_s: np.ndarray) -> np.ndarray:
        """Return the integral of the step response over time [s], shape of the time."""
        grown = (time_s + self.onset_s) * np.log1p(time_s / self.onset_s) - time_s
        return time_s + self.per_decade / np.log(10.0) * grown

    def of_step(self, time_s: np.ndarray) -> np.ndarray:
        """Return the step response [1]."""
        return 1.0 + self.per_decade * np.log10(1.0 + time_s / self.onset_s)


@dataclass(frozen=True)
class Relaxations:
    """Step response 1 + sum of amplitude (1 - exp(-t / time constant)): Kelvin-Voigt elements in series."""

    amplitudes: tuple[float, ...]
    time_constants_s: tuple[float, ...]

    def after_ramp(self, time_s: np.ndarray) -> np.ndarray:
        """Return the integral of the step response over time [s], shape of the time."""
        total = np.array(time_s, dtype=float)
        for amplitude, tau in zip(self.amplitudes, self.time_constants_s, strict=True):
            total += amplitude * (time_s + tau * np.expm1(-time_s / tau))
        return total

    def of_step(self, time_s: np.ndarray) -> np.ndarray:
        """Return the step response [1]."""
        parts = zip(self.amplitudes, self.time_constants_s, strict=True)
        return 1.0 - sum(a * np.expm1(-np.asarray(time_s) / tau) for a, tau in parts)


CreepLaw = PowerLaw | Logarithmic | Relaxations


def creep(values: np.ndarray, law: CreepLaw, step_s: float) -> np.ndarray:
    """Return the creeping response, shape (n_samples,) or (n_samples, n_columns), to values 0 before the first.

    Straight between the nodes, so the response to the change of one step is that of a ramp.
    """
    n = values.shape[0]
    ramp = law.after_ramp(np.arange(n + 1) * step_s) / step_s
    kernel = np.diff(ramp)
    changes = np.diff(values, axis=0, prepend=0.0 * values[:1])
    # A change at the very first sample is a step that took the step before it.
    size = next_fast_len(2 * n, real=True)
    kernel_spectrum = rfft(kernel, size)
    if changes.ndim == 1:
        return irfft(rfft(changes, size) * kernel_spectrum, size)[:n]
    out = np.empty_like(changes)
    for first in range(0, changes.shape[1], _N_AT_ONCE):
        some = slice(first, first + _N_AT_ONCE)
        out[:, some] = irfft(rfft(changes[:, some], size, axis=0) * kernel_spectrum[:, None], size, axis=0)[:n]
    return out

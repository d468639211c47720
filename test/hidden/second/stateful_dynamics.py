"""Equations of motion that are not linear, step by step."""

from __future__ import annotations

import math

import numpy as np


def rate_limited(values: np.ndarray, per_s: float, step_s: float) -> np.ndarray:
    """Follow the values no faster than a rate; shape (n_samples,)."""
    most = per_s * step_s
    out, z = [], float(values[0])
    for v in values.tolist():
        z += min(most, max(-most, v - z))
        out.append(z)
    return np.array(out)


def unequal_lag(values: np.ndarray, rising_s: float, falling_s: float, step_s: float) -> np.ndarray:
    """Solve tau dz/dt = v - z with one time constant while z rises and another while it falls."""
    up, down = step_s / rising_s, step_s / falling_s
    gain_up, gain_down = -math.expm1(-up), -math.expm1(-down)
    # Of an input straight over the step: what its slope costs within it.
    hold_up, hold_down = 1.0 - gain_up / up, 1.0 - gain_down / down
    out, z, before = [], float(values[0]), float(values[0])
    for v in values.tolist():
        if 0.5 * (v + before) >= z:
            z += gain_up * (before - z) + hold_up * (v - before)
        else:
            z += gain_down * (before - z) + hold_down * (v - before)
        before = v
        out.append(z)
    return np.array(out)


def charged_through(values_v: np.ndarray, time_constant_s: float, per_v: float, step_s: float) -> np.ndarray:
    """Charge a capacitance C0 (1 + per_v z) through a resistance: R C(z) dz/dt = v - z; RC0 the time constant.

    C never falls below a tenth of C0.
    """
    out, z, before = [], float(values_v[0]), float(values_v[0])
    for v in values_v.tolist():
        along = step_s / (time_constant_s * max(0.1, 1.0 + per_v * z))
        gain = -math.expm1(-along)
        ahead = z + gain * (before - z) + (1.0 - gain / along) * (v - before)
        # Once more with the capacitance of the middle of the step.
        along = step_s / (time_constant_s * max(0.1, 1.0 + 0.5 * per_v * (z + ahead)))
        gain = -math.expm1(-along)
        z += gain * (before - z) + (1.0 - gain / along) * (v - before)
        before = v
        out.append(z)
    return np.array(out)


def backlash(values: np.ndarray, gap: float) -> np.ndarray:
    """Follow the values through a gap: pushed on either side, still in between."""
    half = 0.5 * gap
    out, z = [], 0.0
    for v in values.tolist():
        z = max(v - half, min(v + half, z))
        out.append(z)
    return np.array(out)

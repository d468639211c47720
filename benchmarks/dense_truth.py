"""Identification with ``--elements auto`` against a dense truth that shares no code with the project.

80 play elements, exact power-law creep by convolution with its full memory, 1 nm noise, 6 um stroke; fitted on
a triangle and a staircase, scored on a held-out staircase of other amplitudes. Bar: held-out NRMSE <= 0.05 %.

    python benchmarks/dense_truth.py [seed]
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np
from scipy.signal import fftconvolve

from fomrc_core.identification.convex import identify
from fomrc_core.records.recording import Recording

RATE_HZ = 100.0
ORDER = 0.015


def dense_displacement_um(voltage_v: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """80 plays, then the fractional integral of the piecewise linear result, all of its past kept."""
    thresholds = np.sort(rng.uniform(0.01, 2.4, 80))
    weights = rng.gamma(2.0, 1.0, 80) * np.exp(-thresholds / 0.8)
    weights *= 0.45 / weights.sum()
    plays = np.zeros(80)
    y = np.empty(voltage_v.size)
    for k, u in enumerate(voltage_v):
        plays = np.clip(plays, u - thresholds, u + thresholds)
        y[k] = 0.80 * u + weights @ plays
    # Slope s over one step and the integral of order alpha of that ramp: differences of t^(1 + alpha).
    t = np.arange(voltage_v.size + 1) / RATE_HZ
    ramp = t ** (1.0 + ORDER) / math.gamma(2.0 + ORDER)
    slopes = np.diff(y, prepend=0.0) * RATE_HZ
    x = fftconvolve(slopes, np.diff(ramp))[: voltage_v.size]
    return x * 6.0 / 5.6


def staircase(levels: list[float], step_v: float, hold_s: float) -> np.ndarray:
    values: list[float] = []
    current = 0.0
    for level in levels:
        n = max(1, round(abs(level - current) / step_v))
        values += list(current + (level - current) * np.arange(1, n + 1) / n)
        current = level
    return np.repeat(values, round(hold_s * RATE_HZ))


def triangle(levels: list[float], slope: float) -> np.ndarray:
    corners = [0.0, *levels]
    at = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners)) / slope)])
    return np.interp(np.arange(1, round(at[-1] * RATE_HZ) + 1) / RATE_HZ, at, corners)


def main() -> None:
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    drives = [
        triangle([2.5, -2.5, 2, -2, 1.5, -1.5, 1, -1, 0.5, -0.5, 0], 1.0),
        staircase([2.5, -2.5, 1.25, -1.25, 0], 0.25, 3.0),
        staircase([2.2, -1.9, 2.4, 0.7, 1.6, -0.8, 0.4, 0], 0.31, 2.0),
    ]
    noise = np.random.default_rng(1000 + seed)
    records = []
    for number, voltage in enumerate(drives):
        x = dense_displacement_um(voltage, np.random.default_rng(seed)) + noise.normal(0.0, 1e-3, voltage.size)
        records.append(Recording(np.arange(1, voltage.size + 1) / RATE_HZ, voltage, x, name=f"record {number}"))
    begun = time.perf_counter()
    fit = identify(records[:2], n_elements="auto", test=None)
    held = records[2]
    error = held.measured_um - fit.model.simulate(held.steps_s, held.voltage_v)
    nrmse = 100.0 * float(np.std(error)) / float(np.ptp(held.measured_um))
    print(
        f"seed {seed}: {fit.model.n_elements} elements, creep order {fit.model.creep_order:.5f}, training "
        f"{1e3 * fit.rms_um:.3f} nm, held-out NRMSE {nrmse:.4f} % of {np.ptp(held.measured_um):.2f} um "
        f"(bar 0.05 %), {time.perf_counter() - begun:.1f} s"
    )


if __name__ == "__main__":
    main()

"""Drives of every kind, a stage with hysteresis and creep, and sensors of every kind: sound records to judge by."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

N = 4000


def drives(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return drives of every kind between 0 and 1, shape (4000,) each."""
    k = np.arange(N)
    levels = rng.random(200)
    return {
        "triangle": np.abs((k / 700.0 + 1.0) % 2.0 - 1.0),
        "fast triangle": np.abs((k / 9.0 + 1.0) % 2.0 - 1.0),
        "sine": 0.5 - 0.5 * np.cos(2.0 * np.pi * k / 630.0),
        "chirp": 0.5 - 0.5 * np.cos(2.0 * np.pi * (k / 1500.0 + (k / 250.0) ** 2 / 4.0)),
        "square": ((k // 150) % 2).astype(float),
        "staircase": np.abs((k // 100) % 16 - 8) / 8.0,
        "random steps": levels[k // 20],
        "new level each sample": rng.random(N),
        "band of noise": lfilter([0.02], [1.0, -0.98], rng.standard_normal(N)),
        "rests": np.clip(np.abs((k / 500.0) % 4.0 - 2.0) - 0.5, 0.0, 1.0),
    }


def loop(drive: np.ndarray) -> np.ndarray:
    """Return a loop with creep, from two crude plays and a slow lag that share no code with the package."""
    out = 0.6 * drive
    for width, weight in ((0.05, 0.3), (0.3, 0.3)):
        play = np.empty(drive.size)
        at = 0.0
        for i, u in enumerate(drive):
            at = min(max(at, u - width), u + width)
            play[i] = at
        out += weight * play
    return out + 0.05 * lfilter([0.004], [1.0, -0.996], out)


def sensors(clean: np.ndarray, drive: np.ndarray, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return what sensors of several kinds read of a motion, and what a stage with a resonance would have done."""
    white = rng.standard_normal(N)
    span = float(np.ptp(clean))
    pole = 0.97 * np.exp(2j * np.pi / 7.0)
    rings = np.poly([pole, pole.conjugate()]).real
    ringing = lfilter([float(np.sum(rings))], rings, clean)
    return {
        "without noise": clean,
        "white": clean + 1e-4 * span * white,
        "loud": clean + 0.03 * span * white,
        "autoregressive": clean + 1e-3 * span * lfilter([0.3], [1.0, -0.95], white),
        "walk": clean + 2e-4 * span * np.cumsum(white),
        "growing": clean + 1e-4 * span * white * (1.0 + 20.0 * drive),
        "hum": clean + 0.01 * span * np.sin(2.0 * np.pi * np.arange(N) / 4.1) + 1e-4 * span * white,
        "quantised": np.round((clean + 1e-5 * white) / (span / 300.0)) * (span / 300.0),
        "ringing": ringing + 1e-4 * span * white,
    }

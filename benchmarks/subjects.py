"""What is measured: Table 1 of the paper, and a drive over its whole range."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.storage import read_model

ROOT = Path(__file__).parents[1]
MODEL_FILE = ROOT / "config" / "pi_p753_table1.yaml"
STEP_S = 1e-3


def table_1() -> PiezoModel:
    """Return the paper's model: 10 elements, creep order 0.015, creep to 1e-6."""
    return read_model(MODEL_FILE)


def drive(n_samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Return steps [s] and a decreasing sum of two sines [V]."""
    t = STEP_S * np.arange(1, n_samples + 1)
    voltage = (1.6 * np.sin(2 * np.pi * 1.0 * t) + 0.8 * np.sin(2 * np.pi * 7.3 * t)) / (1.0 + t / t[-1])
    return np.full(n_samples, STEP_S), voltage


def record(n_samples: int, noise_um: float, seed: int = 1):
    """Return a recording of the model: triangle of decreasing amplitude and staircase, with noise."""
    from fomrc_core.records.recording import Recording

    t = STEP_S * np.arange(n_samples)
    total = t[-1]
    envelope = 2.4 * (1.0 - 0.9 * t / total)
    voltage = envelope * (2.0 * np.abs((t / 2.5 + 0.5) % 2.0 - 1.0) - 1.0) * np.minimum(t / 0.25, 1.0)
    held = (t > 0.8 * total) & (t < 0.9 * total)
    voltage[held] = np.round(voltage[held] * 4.0) / 4.0
    steps = np.full(n_samples, STEP_S)
    moved = table_1().simulate(steps, voltage)
    return Recording(t, voltage, moved + noise_um * np.random.default_rng(seed).standard_normal(n_samples))

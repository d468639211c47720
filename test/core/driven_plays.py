"""A truth made with numpy alone: plays that follow a drive of slow lines, and had perhaps been driven before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def sum_of_lines(rng: np.random.Generator, time_s: Array, lowest_hz: float, highest_hz: float) -> Array:
    """Return eight sines of random frequencies and phases, added, shape (n_samples,)."""
    lines_hz, phases = rng.uniform(lowest_hz, highest_hz, 8), rng.uniform(0.0, 2.0 * np.pi, 8)
    return np.asarray(np.sum(np.sin(2.0 * np.pi * lines_hz[:, None] * time_s + phases[:, None]), axis=0))


def states_of_plays(thresholds_v: Array, drive_v: Array, extreme_v: float = 0.0) -> Array:
    """Return where plays stand at each sample [V], shape (n_samples, n_plays).

    Args:
        thresholds_v: their half widths [V], shape (n_plays,).
        drive_v: the drive [V], shape (n_samples,).
        extreme_v: where the drive had gone before, from zero and back [V].
    """
    before_v = np.concatenate((np.linspace(0.0, extreme_v, 200), np.linspace(extreme_v, 0.0, 200)))
    stands_v, states = np.zeros(thresholds_v.size), []
    for now_v in (*before_v, *drive_v):
        stands_v = np.clip(stands_v, now_v - thresholds_v, now_v + thresholds_v)
        states.append(stands_v)
    return np.array(states[before_v.size :])

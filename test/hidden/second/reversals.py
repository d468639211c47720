"""Monotone sweeps of a drive: what every rate-independent hysteresis depends on and nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Sweeps:
    """The monotone sweeps of a drive.

    Args:
        first, last: sample before the sweep moves, and its last sample; shape (n_sweeps,).
        heading: +1 rising, -1 falling; shape (n_sweeps,).
    """

    first: np.ndarray
    last: np.ndarray
    heading: np.ndarray


def sweeps_of(drive: np.ndarray) -> Sweeps:
    """Split a drive, shape (n_samples,), into monotone sweeps; a rest belongs to the sweep before it."""
    moves = np.sign(np.diff(drive))
    at = np.flatnonzero(moves)
    if at.size == 0:
        none = np.zeros(0, dtype=np.int64)
        return Sweeps(none, none, none)
    starts = at[np.concatenate([[True], moves[at][1:] != moves[at][:-1]])]
    return Sweeps(starts, np.append(starts[1:], drive.size - 1), moves[starts].astype(np.int64))

"""Noise like that which a fit left: blocks of it, drawn at random and put one behind the other (Kuensch, 1989)."""

from __future__ import annotations

import math

import numpy as np

from fomrc_core.compute.arrays import Array

_N_BLOCKS = 60  # per record


def moving_blocks(values: Array, n_draws: int, rng: np.random.Generator) -> Array:
    """Return draws of as many values, correlated over short times as these are, shape (n_draws, n_samples).

    Args:
        values: what a fit left, shape (n_samples,).
        n_draws: number of draws.
        rng: where each block begins, and its sign.
    """
    length = max(1, values.size // _N_BLOCKS)
    n_blocks = math.ceil(values.size / length)
    first = rng.integers(0, values.size - length + 1, (n_draws, n_blocks))
    signs = rng.choice([-1.0, 1.0], (n_draws, n_blocks, 1))
    blocks = values[first[:, :, None] + np.arange(length)] * signs
    drawn: Array = blocks.reshape(n_draws, -1)[:, : values.size]
    return drawn

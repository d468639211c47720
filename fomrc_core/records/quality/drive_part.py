"""What of a displacement follows the last few samples of the drive, so that its jumps are not taken for faults.

A short filter by robust regression of differences: it follows steps, lags and much of a ringing. Hysteresis is not in
it; what it gets wrong is in proportion to the bends of what it gives, and is allowed for there.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fomrc_core.compute.arrays import Array, Mask

_N_TAPS = 9
_N_LOOKED_AT = 1 << 17
_N_BLOCKS = 64
_N_PASSES = 6
_TIKHONOV = 1e-9  # of the largest eigenvalue: a slow drive leaves taps that cannot be told apart
_HUBER = 2.0  # in robust standard deviations


def drive_part(voltage_v: Array, displacement_um: Array, is_valid: Mask) -> Array:
    """Return the part of a displacement that follows the drive within a few samples [um], shape (n_samples,).

    Args:
        voltage_v: drive [V], shape (n_samples,).
        displacement_um: readings, or what a model left of them [um], shape (n_samples,).
        is_valid: samples to learn from, shape (n_samples,).
    """
    moments = [_rows(voltage_v, displacement_um, is_valid, block) for block in _blocks(voltage_v.size)]
    columns, target = np.concatenate([m[0] for m in moments]), np.concatenate([m[1] for m in moments])
    taps = np.zeros(_N_TAPS)
    if target.size > 2 * _N_TAPS and np.any(columns):
        weight = np.ones(target.size)
        for _ in range(_N_PASSES):
            weighted = columns * weight[:, None]
            gram = weighted.T @ columns
            gram[np.diag_indices(_N_TAPS)] += _TIKHONOV * float(np.trace(gram))
            taps = np.linalg.solve(gram, weighted.T @ target)
            left = np.abs(target - columns @ taps)
            # where most samples rest, their median says nothing of those that move
            moving = left[np.any(columns != 0.0, axis=1)]
            limit = _HUBER * 1.4826 * float(np.median(moving if moving.size else left))
            weight = np.where(left > limit, limit / np.maximum(left, 1e-300), 1.0) if limit > 0.0 else weight
    padded = np.concatenate((np.full(_N_TAPS - 1, voltage_v[0]), voltage_v))
    return np.convolve(padded - voltage_v[0], taps, mode="valid")


def _blocks(n_samples: int) -> Iterator[slice]:
    """Yield the stretches that are looked at: all of a record, or evenly spread parts of a long one."""
    if n_samples <= _N_LOOKED_AT:
        yield slice(0, n_samples)
        return
    length = _N_LOOKED_AT // _N_BLOCKS
    for start in np.linspace(0, n_samples - length, _N_BLOCKS).astype(int):
        yield slice(int(start), int(start) + length)


def _rows(voltage_v: Array, displacement_um: Array, is_valid: Mask, block: slice) -> tuple[Array, Array]:
    v, x, valid = voltage_v[block], displacement_um[block], is_valid[block]
    moved = np.concatenate((np.zeros(_N_TAPS - 1), np.diff(v)))
    columns = np.lib.stride_tricks.sliding_window_view(moved, _N_TAPS)[:, ::-1]
    kept = valid[1:] & valid[:-1]
    return np.asarray(columns[kept]), np.diff(x)[kept]

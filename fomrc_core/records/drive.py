"""What a drive is like: where it turns, how many kinds of loops it makes, how it begins, what of it is held out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.compiled import compiled

# Of the range of the drive: one that turns by less has not turned, a measured voltage has noise.
LEAST_TURN = 0.02
# Kinds of loops are told apart by eighths of the range, in width and in mean.
_N_CELLS = 8
# A sine makes up to 4 kinds; triangles, steps and a multisine together 15 to 26.
MANY_LOOPS = 10
# Of the range of the drive: a first voltage as small is zero, read with an offset.
_ZERO_SHARE = 0.01
# Of the duration: what came before a record that does not begin at zero volts has faded by then to what a hold of
# the first voltage explains.
UNSURE_START_SHARE = 0.02
# Every third of twenty blocks is held out: the drive of each is mostly seen in the others, and all of the record is
# sampled. The edges of a held-out block, this share of it on either side, are not scored: what is correlated with
# the neighbours is not independent of them.
_N_BLOCKS = 20
_GAP_SHARE = 0.1


def turning_points(voltage_v: Array, least_turn_v: float) -> NDArray[np.int64]:
    """Return the samples at which the drive turns, its first sample and its last extreme with them, in order.

    Args:
        voltage_v: drive [V], shape (n_samples,).
        least_turn_v: a turn that goes back by no more than this is no turn [V].
    """
    turns: NDArray[np.int64] = np.empty(voltage_v.size, dtype=np.int64)
    n_turns = _fill_turns(np.ascontiguousarray(voltage_v, dtype=np.float64), least_turn_v, turns)
    found: NDArray[np.int64] = turns[:n_turns].copy()
    return found


@compiled
def _fill_turns(voltage_v: Array, least_turn_v: float, turns: NDArray[np.int64]) -> int:
    n_turns, extreme, direction = 1, 0, 0.0
    turns[0] = 0
    for k in range(1, voltage_v.size):
        change = voltage_v[k] - voltage_v[extreme]
        if direction == 0.0:
            if abs(change) > least_turn_v:
                direction, extreme = (1.0 if change > 0.0 else -1.0), k
        elif change * direction > 0.0:
            extreme = k
        elif -change * direction > least_turn_v:
            turns[n_turns] = extreme
            n_turns += 1
            direction, extreme = -direction, k
    if extreme != turns[n_turns - 1]:
        turns[n_turns] = extreme
        n_turns += 1
    return n_turns


def n_loop_kinds(voltages_v: Sequence[Array]) -> int:
    """Return the number of kinds of sweeps between turning points of drives [V], told apart by width and mean."""
    low, high = min(float(np.min(v)) for v in voltages_v), max(float(np.max(v)) for v in voltages_v)
    if not high > low:
        return 0
    kinds: set[tuple[int, int]] = set()
    for voltage_v in voltages_v:
        share = (voltage_v - low) / (high - low)
        ends = share[turning_points(share, LEAST_TURN)]
        width, mean = np.abs(np.diff(ends)), 0.5 * (ends[1:] + ends[:-1])
        cells = np.minimum((_N_CELLS * np.column_stack((width, mean))).astype(int), _N_CELLS - 1)
        kinds.update((int(w), int(m)) for w, m in cells)
    return len(kinds)


def longest_sweep(voltages_v: Sequence[Array]) -> int:
    """Return the number of samples in which the drive moves in the longest sweep one way.

    Thresholds closer together than its samples cannot be told apart.
    """
    longest = 0
    for voltage_v in voltages_v:
        n_moves = np.concatenate(([0], np.cumsum(np.diff(voltage_v) != 0.0)))
        turns = turning_points(voltage_v, LEAST_TURN * float(np.ptp(voltage_v)))
        longest = max(longest, int(np.max(np.diff(n_moves[turns]), initial=0)))
    return longest


def begins_at_zero(voltage_v: Array) -> bool:
    """Return whether the first voltage is zero, so that the actuator can be taken to begin relaxed.

    At another voltage it may just have come there from the relaxed state, or have rested there for long.
    """
    return abs(float(voltage_v[0])) <= _ZERO_SHARE * float(np.ptp(voltage_v))


def is_settled(time_s: Array, voltage_v: Array) -> Mask:
    """Return which samples say something of a model, shape (n_samples,).

    Where a record does not begin at zero volts nobody knows how it came there; its first fiftieth is left out.
    """
    if begins_at_zero(voltage_v):
        return np.ones(time_s.size, dtype=np.bool_)
    return np.asarray(time_s - time_s[0] >= UNSURE_START_SHARE * (time_s[-1] - time_s[0]))


def held_out_blocks(n_samples: int) -> Mask:
    """Return the samples of every third block of a record, the edges of the blocks left out, shape (n_samples,)."""
    block, inside = _position(n_samples)
    return np.asarray((block % 3 == 1) & (inside >= _GAP_SHARE) & (inside < 1.0 - _GAP_SHARE))


def learned_blocks(n_samples: int) -> Mask:
    """Return the samples of the other blocks, shape (n_samples,)."""
    return np.asarray(_position(n_samples)[0] % 3 != 1)


def _position(n_samples: int) -> tuple[NDArray[np.int64], Array]:
    """Return the block each sample lies in, and where in it, from 0 to 1."""
    share = np.arange(n_samples) * _N_BLOCKS / n_samples
    return share.astype(np.int64), share - np.floor(share)

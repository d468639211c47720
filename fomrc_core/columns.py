"""Columns of the linear problem: creep applied to many play operators at once.

In the play form displacement is linear in the weights, x = sum_j g_j I^alpha[play_rho_j[u]]: for given thresholds
and creep order a fit is linear least squares on the forward error itself. Each column is one play (threshold
zero is the drive), its derivative with respect to its threshold, or a play that counts only above a knee.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compiled import compiled
from fomrc_core.creep import (
    CURRENT_WEIGHT,
    DECAY,
    FROM_CURRENT,
    FROM_PREVIOUS,
    HEADER,
    HELD_WEIGHT,
    N_MODES,
    WEIGHTED_DECAY,
    CreepModes,
    creep_block,
    prepare_step,
)

Array = NDArray[np.float64]

PLAY, THRESHOLD_SLOPE = 0, 1


@dataclass(frozen=True, eq=False)
class ColumnKinds:
    """What each column is, arrays of shape (n_columns,).

    Attributes:
        thresholds_v: half widths of the plays [V]; 0 is the drive itself.
        knees_v: where each begins to count [V]; -inf counts always.
        kinds: PLAY or THRESHOLD_SLOPE.
    """

    thresholds_v: Array
    knees_v: Array
    kinds: NDArray[np.int64]

    @classmethod
    def plays(cls, thresholds_v: Array) -> ColumnKinds:
        """Return plain plays of these thresholds [V], shape (n_columns,)."""
        t = np.ascontiguousarray(thresholds_v, dtype=np.float64)
        return cls(t, np.full(t.size, -np.inf), np.zeros(t.size, dtype=np.int64))

    def joined(self, other: ColumnKinds) -> ColumnKinds:
        """Return these columns followed by the others."""
        return ColumnKinds(
            np.concatenate((self.thresholds_v, other.thresholds_v)),
            np.concatenate((self.knees_v, other.knees_v)),
            np.concatenate((self.kinds, other.kinds)),
        )


def creep_columns(columns: ColumnKinds, modes: CreepModes, drive_v: Array, steps_s: Array, n_skipped: int = 0) -> Array:
    """Return the columns, shape (n_samples - n_skipped, n_columns), relaxed at the start.

    Args:
        columns: what each column is.
        modes: creep modes.
        drive_v: voltage at the elements [V], shape (n_samples,).
        steps_s: steps [s], shape (n_samples,).
        n_skipped: samples before the record, run through but not returned.
    """
    out = np.empty((drive_v.size - n_skipped, columns.thresholds_v.size))
    block = creep_block(modes)
    _fill(columns.thresholds_v, columns.knees_v, columns.kinds, block, np.ascontiguousarray(drive_v),
          np.ascontiguousarray(steps_s), n_skipped, out)  # fmt: skip
    return out


@compiled
def _fill(thresholds: Array, knees: Array, kinds: NDArray[np.int64], block: Array, drive: Array, steps: Array,
          n_skipped: int, out: Array) -> None:  # fmt: skip
    n_columns = thresholds.size
    n_modes = int(block[N_MODES])
    at_decay = HEADER + DECAY * n_modes
    at_previous = HEADER + FROM_PREVIOUS * n_modes
    at_current = HEADER + FROM_CURRENT * n_modes
    at_weighted = HEADER + WEIGHTED_DECAY * n_modes
    plays = np.zeros(n_columns)
    slopes = np.zeros(n_columns)
    now = np.zeros(n_columns)
    before = np.zeros(n_columns)
    total = np.zeros(n_columns)
    modes = np.zeros((n_modes, n_columns))
    step = -1.0
    for k in range(drive.size):
        if steps[k] != step:
            step = steps[k]
            prepare_step(block, 0, step)
        u = drive[k]
        for j in range(n_columns):
            play = plays[j]
            if play < u - thresholds[j]:
                play = u - thresholds[j]
                slopes[j] = -1.0
            elif play > u + thresholds[j]:
                play = u + thresholds[j]
                slopes[j] = 1.0
            plays[j] = play
            now[j] = (max(play, knees[j]) - max(0.0, knees[j])) if kinds[j] == PLAY else slopes[j]
        current, held = block[CURRENT_WEIGHT], block[HELD_WEIGHT]
        for j in range(n_columns):
            total[j] = current * now[j] + held * before[j]
        for m in range(n_modes):
            weighted = block[at_weighted + m]
            decay = block[at_decay + m]
            from_previous = block[at_previous + m]
            from_current = block[at_current + m]
            row = modes[m]
            for j in range(n_columns):
                q = row[j]
                total[j] += weighted * q
                row[j] = decay * q + from_previous * before[j] + from_current * now[j]
        for j in range(n_columns):
            before[j] = now[j]
        if k >= n_skipped:
            for j in range(n_columns):
                out[k - n_skipped, j] = total[j]

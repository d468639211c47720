"""Columns of the linear problem: creep applied to many play operators at once.

In the play form displacement is linear in the weights, x = sum_j g_j I^alpha[play_rho_j[u]]: for given thresholds
and creep order a fit is linear least squares on the forward error itself. Each column is one play (threshold
zero is the drive), its derivative with respect to its threshold, or a play that counts only above a knee.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled_inline, compiled_sums
from fomrc_core.effects import Effect
from fomrc_core.operators.creep import (
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
_FEW_CHANGES = 0.1  # changes of the step length per sample up to which shifted modes pay


@dataclass(frozen=True, eq=False)
class ColumnKinds:
    """What each column is, arrays of shape (n_columns,).

    Attributes:
        thresholds_v: half widths of the plays [V]; 0 is the drive itself.
        knees_v: where each begins to count [V]; -inf counts always.
        kinds: PLAY or THRESHOLD_SLOPE.
        owners: name of the effect whose play each is, empty for the elements' own; all of them where not given.
    """

    thresholds_v: Array
    knees_v: Array
    kinds: NDArray[np.int64]
    owners: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.owners:
            object.__setattr__(self, "owners", ("",) * self.thresholds_v.size)

    @classmethod
    def plays(cls, thresholds_v: Array) -> ColumnKinds:
        """Return plain plays of these thresholds [V], shape (n_columns,)."""
        t = np.ascontiguousarray(thresholds_v, dtype=np.float64)
        return cls(t, np.full(t.size, -np.inf), np.zeros(t.size, dtype=np.int64))

    @classmethod
    def plays_of(cls, effect: Effect) -> ColumnKinds:
        """Return the plays an effect owns."""
        thresholds, knees, _ = effect.plays()
        return cls(thresholds, knees, np.zeros(thresholds.size, dtype=np.int64), (effect.name,) * thresholds.size)

    @property
    def is_plain(self) -> NDArray[np.bool_]:
        """Whether each column is of the elements, shape (n_columns,)."""
        return self.owned_by("")

    def owned_by(self, name: str) -> NDArray[np.bool_]:
        """Return whether each column is a play of this effect, shape (n_columns,)."""
        return np.array([owner == name for owner in self.owners], dtype=np.bool_)

    def chosen(self, mask: NDArray[np.bool_]) -> ColumnKinds:
        """Return the columns where the mask, shape (n_columns,), is true."""
        owners = tuple(owner for owner, is_kept in zip(self.owners, mask, strict=True) if is_kept)
        return ColumnKinds(self.thresholds_v[mask], self.knees_v[mask], self.kinds[mask], owners)

    def joined(self, other: ColumnKinds) -> ColumnKinds:
        """Return these columns followed by the others."""
        return ColumnKinds(
            np.concatenate((self.thresholds_v, other.thresholds_v)),
            np.concatenate((self.knees_v, other.knees_v)),
            np.concatenate((self.kinds, other.kinds)),
            (*self.owners, *other.owners),
        )


def creep_columns(
    columns: ColumnKinds,
    modes: CreepModes,
    drive_v: Array,
    steps_s: Array,
    n_skipped: int = 0,
    widening: Array | None = None,
) -> Array:
    """Return the columns, shape (n_samples - n_skipped, n_columns), relaxed at the start.

    Args:
        columns: what each column is.
        modes: creep modes.
        drive_v: voltage at the elements [V], shape (n_samples,).
        steps_s: steps [s], shape (n_samples,).
        n_skipped: samples before the record, run through but not returned.
        widening: factor of the elements' thresholds, shape (n_samples,); one where not given.
    """
    out = np.empty((drive_v.size - n_skipped, columns.thresholds_v.size))
    block = creep_block(modes)
    drive, steps = np.ascontiguousarray(drive_v), np.ascontiguousarray(steps_s)
    n_changes = int(np.count_nonzero(np.diff(steps)))
    fill = _fill_equal_steps if n_changes <= _FEW_CHANGES * steps.size else _fill_any_steps
    factors = np.ones(drive.size) if widening is None else np.ascontiguousarray(widening)
    own = (columns.thresholds_v, columns.knees_v, columns.kinds, columns.is_plain)
    fill(*own, block, drive, factors, steps, n_skipped, out)
    return out


@compiled_inline
def _widen(
    thresholds: Array, is_widened: NDArray[np.bool_], factor: float, widths: Array, per_threshold: Array
) -> None:
    for j in range(widths.size):
        per_threshold[j] = factor if is_widened[j] else 1.0
        widths[j] = per_threshold[j] * thresholds[j]


@compiled_inline
def _move_plays(
    widths: Array,
    per_threshold: Array,
    knees: Array,
    kinds: NDArray[np.int64],
    u: float,
    plays: Array,
    slopes: Array,
    now: Array,
) -> None:
    for j in range(plays.size):
        play = plays[j]
        if play < u - widths[j]:
            play = u - widths[j]
            slopes[j] = -per_threshold[j]
        elif play > u + widths[j]:
            play = u + widths[j]
            slopes[j] = per_threshold[j]
        plays[j] = play
        now[j] = (max(play, knees[j]) - max(0.0, knees[j])) if kinds[j] == PLAY else slopes[j]


@compiled_sums
def _fill_equal_steps(
    thresholds: Array,
    knees: Array,
    kinds: NDArray[np.int64],
    is_widened: NDArray[np.bool_],
    block: Array,
    drive: Array,
    widening: Array,
    steps: Array,
    n_skipped: int,
    out: Array,
) -> None:
    n_columns = thresholds.size
    n_modes = int(block[N_MODES])
    plays, slopes, now, before = (np.zeros(n_columns), np.zeros(n_columns), np.zeros(n_columns), np.zeros(n_columns))
    factor, widths, per_threshold = 1.0, thresholds.copy(), np.ones(n_columns)
    # Shifted modes as in creep_batch.py, a row each, padded to whole groups of four with modes that weigh nothing
    n_rows = 4 * ((n_modes + 3) // 4)
    modes = np.zeros((n_rows, n_columns))
    past = np.zeros(n_columns)  # their weighted sum
    decays, weighted = np.zeros(n_rows), np.zeros(n_rows)
    gains, currents = np.ones(n_modes), np.zeros(n_modes)
    step, now_weight, before_weight = -1.0, 0.0, 0.0
    for k in range(drive.size):
        if steps[k] != step:
            step = steps[k]
            prepare_step(block, 0, step)
            now_weight = block[CURRENT_WEIGHT]
            before_weight = _reshift(block, modes, before, past, decays, weighted, gains, currents)
        if widening[k] != factor:
            factor = widening[k]
            _widen(thresholds, is_widened, factor, widths, per_threshold)
        _move_plays(widths, per_threshold, knees, kinds, drive[k], plays, slopes, now)
        if k >= n_skipped:
            for j in range(n_columns):
                out[k - n_skipped, j] = now_weight * now[j] + before_weight * before[j] + past[j]
        for j in range(n_columns):
            past[j] = 0.0
        # four modes at a time: half the memory traffic of one
        for m in range(0, n_rows, 4):
            first, second, third, fourth = modes[m], modes[m + 1], modes[m + 2], modes[m + 3]
            d0, d1, d2, d3 = decays[m], decays[m + 1], decays[m + 2], decays[m + 3]
            w0, w1, w2, w3 = weighted[m], weighted[m + 1], weighted[m + 2], weighted[m + 3]
            for j in range(n_columns):
                b = before[j]
                p0, p1, p2, p3 = d0 * first[j] + b, d1 * second[j] + b, d2 * third[j] + b, d3 * fourth[j] + b
                first[j], second[j], third[j], fourth[j] = p0, p1, p2, p3
                past[j] += (w0 * p0 + w1 * p1) + (w2 * p2 + w3 * p3)
        for j in range(n_columns):
            before[j] = now[j]


@compiled_sums
def _reshift(
    block: Array,
    modes: Array,
    before: Array,
    past: Array,
    decays: Array,
    weighted: Array,
    gains: Array,
    currents: Array,
) -> float:
    # Take the shifted modes from the old step length to the one just prepared; return the weight of the last input.
    n_modes = int(block[N_MODES])
    held: float = block[HELD_WEIGHT]
    for j in range(before.size):
        past[j] = 0.0
    for m in range(n_modes):
        decays[m] = block[HEADER + DECAY * n_modes + m]
        current = block[HEADER + FROM_CURRENT * n_modes + m]
        gain = block[HEADER + FROM_PREVIOUS * n_modes + m] + decays[m] * current
        weight = block[HEADER + WEIGHTED_DECAY * n_modes + m]
        kept, added = gains[m] / gain, (currents[m] - current) / gain
        weighted[m] = weight * gain
        held += weight * current
        row = modes[m]
        for j in range(before.size):
            row[j] = kept * row[j] + added * before[j]
            past[j] += weighted[m] * row[j]
        gains[m], currents[m] = gain, current
    return held


@compiled_sums
def _fill_any_steps(
    thresholds: Array,
    knees: Array,
    kinds: NDArray[np.int64],
    is_widened: NDArray[np.bool_],
    block: Array,
    drive: Array,
    widening: Array,
    steps: Array,
    n_skipped: int,
    out: Array,
) -> None:
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
    factor, widths, per_threshold = 1.0, thresholds.copy(), np.ones(n_columns)
    step = -1.0
    for k in range(drive.size):
        if steps[k] != step:
            step = steps[k]
            prepare_step(block, 0, step)
        if widening[k] != factor:
            factor = widening[k]
            _widen(thresholds, is_widened, factor, widths, per_threshold)
        _move_plays(widths, per_threshold, knees, kinds, drive[k], plays, slopes, now)
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

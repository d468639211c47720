"""Creep of a whole record: the operator of ``creep.py``, both directions, in runs of equal steps.

Forward the inputs are known, and four samples go at once: what the modes give at each of them is a sum over the modes
before them, its weights times powers of their decays, and of the inputs in between (block filtering; Burrus, IEEE
Trans. Audio Electroacoust. 20 (1972) 230). Its coefficients depend on the step length, and where steps are divided into
parts the same few lengths come again and again: they are kept.

Backward each output is the next input. A run goes on shifted and scaled modes, ``p = (q - b y) / c`` with ``b`` the
weight of the present input and ``c`` that of a former one: then ``p_k = d p_{k-1} + y_{k-1}``, two operations a mode,
and nothing waits for the present output.

Both differ from single steps by rounding only.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled, compiled_sums
from fomrc_core.operators.creep import (
    CACHED_STEP,
    CURRENT_WEIGHT,
    DECAY,
    FROM_CURRENT,
    FROM_PREVIOUS,
    HEADER,
    HELD_WEIGHT,
    MODE,
    N_MODES,
    PREVIOUS,
    WEIGHTED_DECAY,
    differentiate_step,
    integrate_step,
    prepare_step,
)

Array = NDArray[np.float64]

_AT_ONCE = 4  # samples; and modes of a vector register
_SHORT_RUN = 8  # equal steps below which what is prepared for a run does not pay
_LONG_RUN = 4096
_NEGLIGIBLE = 1e-290  # modes below it are set to zero: denormal numbers cost a hundred times as much

# What is kept of a step length, a row each: of the modes' decay d, weight w, and what they take of the input before and
# of the present one (a, b; e = d b + a), and numbers that belong to no mode.
_OUT, _MODE_4, _INPUT, _DECAY, _FROM_PREVIOUS, _NUMBERS, _N_ROWS = 0, 4, 5, 10, 11, 12, 13
# w d, w d^2, w d^3, w d^4; d^4; d^3 a, d^2 e, d e, e, b of the input before and the four; d; a
_STEP, _NOW, _HELD, _AGO, _N_NUMBERS = 0, 1, 2, 3, 9  # of the numbers; six that inputs give later among the four
_N_KEPT = 8  # step lengths: as many as parts of a step


@compiled
def _end_of_run(steps_s: Array, start: int) -> int:
    stop = start + 1
    limit = min(steps_s.size, start + _LONG_RUN)
    while stop < limit and steps_s[stop] == steps_s[start]:
        stop += 1
    return stop


@compiled
def _nothing_kept(n_modes: int) -> Array:
    """Return room for what is kept: whole vector registers, for what is left over costs as much as a few more modes.

    No step is zero long, as those are that are not kept yet; the last number of the first row counts.
    """
    n_columns = (n_modes + _AT_ONCE - 1) // _AT_ONCE * _AT_ONCE
    return np.zeros((_N_KEPT, _N_ROWS, max(n_columns, _N_NUMBERS + 1)))


@compiled_sums
def _prepare(packed: Array, at: int, step_s: float, n_steps: int, kept: Array) -> int:
    """Compute the coefficients of a run's step length unless they are kept; return where, or -1 where they are not."""
    n_modes = int(packed[at + N_MODES])
    first = at + HEADER
    for place in range(_N_KEPT):
        if kept[place, _NUMBERS, _STEP] == step_s:
            return place
    if packed[at + CACHED_STEP] != step_s:
        prepare_step(packed, at, step_s)
    n_before = int(kept[0, _NUMBERS, _N_NUMBERS])
    if n_before >= _N_KEPT and n_steps < _SHORT_RUN:
        return -1  # of a clock that jitters no step length comes again
    place = n_before % _N_KEPT
    kept[0, _NUMBERS, _N_NUMBERS] += 1.0
    row = kept[place]
    row[_NUMBERS, _STEP] = step_s
    row[_NUMBERS, _NOW] = packed[at + CURRENT_WEIGHT]
    row[_NUMBERS, _HELD] = packed[at + HELD_WEIGHT]
    row[_NUMBERS, _AGO : _AGO + 6] = 0.0
    for j in range(n_modes):
        decay = packed[first + DECAY * n_modes + j]
        before = packed[first + FROM_PREVIOUS * n_modes + j]
        now = packed[first + FROM_CURRENT * n_modes + j]
        out = packed[first + WEIGHTED_DECAY * n_modes + j]
        both = decay * now + before
        square = decay * decay
        row[_OUT, j] = out
        row[_OUT + 1, j] = out * decay
        row[_OUT + 2, j] = out * square
        row[_OUT + 3, j] = out * square * decay
        row[_MODE_4, j] = square * square
        row[_INPUT, j] = square * decay * before
        row[_INPUT + 1, j] = square * both
        row[_INPUT + 2, j] = decay * both
        row[_INPUT + 3, j] = both
        row[_INPUT + 4, j] = now
        row[_DECAY, j] = decay
        row[_FROM_PREVIOUS, j] = before
        row[_NUMBERS, _AGO] += out * before
        row[_NUMBERS, _AGO + 1] += out * decay * before
        row[_NUMBERS, _AGO + 2] += out * square * before
        row[_NUMBERS, _AGO + 3] += out * now
        row[_NUMBERS, _AGO + 4] += out * both
        row[_NUMBERS, _AGO + 5] += out * decay * both
    return place


@compiled_sums
def _prepared(packed: Array, at: int, step_s: float, n_steps: int, kept: Array) -> int:
    """Return the same, the coefficients in the block as well."""
    place = _prepare(packed, at, step_s, n_steps, kept)
    if place >= 0:
        _take_kept(packed, at, kept[place])
    return place


@compiled_sums
def _take_kept(packed: Array, at: int, row: Array) -> None:
    """Take the coefficients of a step length into the block."""
    n_modes = int(packed[at + N_MODES])
    first = at + HEADER
    if packed[at + CACHED_STEP] == row[_NUMBERS, _STEP]:
        return
    packed[at + CACHED_STEP] = row[_NUMBERS, _STEP]
    packed[at + CURRENT_WEIGHT] = row[_NUMBERS, _NOW]
    packed[at + HELD_WEIGHT] = row[_NUMBERS, _HELD]
    for j in range(n_modes):
        packed[first + DECAY * n_modes + j] = row[_DECAY, j]
        packed[first + FROM_PREVIOUS * n_modes + j] = row[_FROM_PREVIOUS, j]
        packed[first + FROM_CURRENT * n_modes + j] = row[_INPUT + 4, j]
        packed[first + WEIGHTED_DECAY * n_modes + j] = row[_OUT, j]


@compiled_sums
def _integrate_fours(kept: Array, modes: Array, before: float, values: Array, out: Array) -> None:
    """Fill ``out`` with what whole fours of inputs give, after the one before them; the modes move on.

    Args:
        kept: what is kept of the step length, shape (_N_ROWS, n_columns).
        modes: their states, and zeros, shape (n_columns,).
        before: the input before.
        values: inputs, shape (n,), n a multiple of four.
        out: what they give, shape (n,).
    """
    now, held = kept[_NUMBERS, _NOW], kept[_NUMBERS, _HELD]
    ago = kept[_NUMBERS, _AGO : _AGO + 6]
    for k in range(0, values.size, _AT_ONCE):
        first, second, third, fourth = values[k], values[k + 1], values[k + 2], values[k + 3]
        sum_1, sum_2, sum_3, sum_4 = 0.0, 0.0, 0.0, 0.0
        for j in range(modes.size):
            mode = modes[j]
            sum_1 += kept[_OUT, j] * mode
            sum_2 += kept[_OUT + 1, j] * mode
            sum_3 += kept[_OUT + 2, j] * mode
            sum_4 += kept[_OUT + 3, j] * mode
            known = kept[_INPUT, j] * before + kept[_INPUT + 1, j] * first + kept[_INPUT + 2, j] * second
            modes[j] = kept[_MODE_4, j] * mode + (known + kept[_INPUT + 3, j] * third + kept[_INPUT + 4, j] * fourth)
        out[k] = now * first + held * before + sum_1
        out[k + 1] = now * second + held * first + sum_2 + (ago[0] * before + ago[3] * first)
        out[k + 2] = now * third + held * second + sum_3 + (ago[1] * before + ago[4] * first + ago[3] * second)
        later = ago[2] * before + ago[5] * first + ago[4] * second + ago[3] * third
        out[k + 3] = now * fourth + held * third + sum_4 + later
        before = fourth


@compiled_sums
def _integrate_ones(kept: Array, modes: Array, before: float, values: Array, out: Array) -> None:
    """Fill ``out`` with what inputs give that are no whole four, after the one before them; the modes move on."""
    now, held = kept[_NUMBERS, _NOW], kept[_NUMBERS, _HELD]
    for k in range(values.size):
        value = values[k]
        total = 0.0
        for j in range(modes.size):
            mode = modes[j]
            total += kept[_OUT, j] * mode
            modes[j] = kept[_DECAY, j] * mode + (kept[_FROM_PREVIOUS, j] * before + kept[_INPUT + 4, j] * value)
        out[k] = now * value + held * before + total
        before = value


@compiled
def _store(modes: Array, states: Array) -> None:
    """Take the modes into the block, and what is left of none as none."""
    for j in range(states.size):
        modes[j] = modes[j] if abs(modes[j]) > _NEGLIGIBLE else 0.0
        states[j] = modes[j]


@compiled_sums
def integrate(packed: Array, at: int, values: Array, steps_s: Array, out: Array) -> None:
    """Fill ``out`` with ``I^alpha`` of the values, shape (n_samples,); the block's state moves on.

    ``out`` may be ``values`` itself.
    """
    n_modes = int(packed[at + N_MODES])
    kept = _nothing_kept(n_modes)
    modes = np.zeros(kept.shape[2])
    states = packed[at + HEADER + MODE * n_modes : at + HEADER + (MODE + 1) * n_modes]
    start = 0
    while start < values.size:
        stop = _end_of_run(steps_s, start)
        place = _prepared(packed, at, steps_s[start], stop - start, kept)
        whole = start if place < 0 else stop - (stop - start) % _AT_ONCE
        if whole > start:
            for j in range(n_modes):
                modes[j] = states[j]
            last = values[whole - 1]
            _integrate_fours(kept[place], modes, packed[at + PREVIOUS], values[start:whole], out[start:whole])
            packed[at + PREVIOUS] = last
            for j in range(n_modes):
                states[j] = modes[j] if abs(modes[j]) > _NEGLIGIBLE else 0.0
        for k in range(whole, stop):
            out[k] = integrate_step(packed, at, values[k], steps_s[k])
        start = stop


@compiled_sums
def integrate_parts(packed: Array, at: int, values: Array, steps_s: Array, out: Array) -> None:
    """Fill ``out`` with ``integrate`` of parts of steps, to rounding, shape (n_parts,); the block's state moves on.

    A step in a few parts is a run of as many, of which hardly one is long: modes stay where they are worked with from
    run to run. ``out`` may be ``values`` itself.
    """
    n_modes = int(packed[at + N_MODES])
    kept = _nothing_kept(n_modes)
    modes = np.zeros(kept.shape[2])
    states = packed[at + HEADER + MODE * n_modes : at + HEADER + (MODE + 1) * n_modes]
    for j in range(n_modes):
        modes[j] = states[j]
    start, stored = 0, 0
    while start < values.size:
        stop = _end_of_run(steps_s, start)
        last = values[stop - 1]
        place = _prepare(packed, at, steps_s[start], stop - start, kept)
        if place < 0:
            _store(modes, states)
            for k in range(start, stop):
                out[k] = integrate_step(packed, at, values[k], steps_s[k])
            for j in range(n_modes):
                modes[j] = states[j]
        else:
            row, whole, before = kept[place], stop - (stop - start) % _AT_ONCE, packed[at + PREVIOUS]
            if whole > start:
                last_of_fours = values[whole - 1]
                _integrate_fours(row, modes, before, values[start:whole], out[start:whole])
                before = last_of_fours
            if stop > whole:
                _integrate_ones(row, modes, before, values[whole:stop], out[whole:stop])
            packed[at + PREVIOUS] = last
        if stop - stored > _LONG_RUN // 8:
            _store(modes, states)
            stored = stop
        start = stop
    _store(modes, states)


@compiled_sums
def _shift_modes(packed: Array, at: int, work: Array) -> tuple[float, float]:
    # Fill the rows of the workspace: decays, shifted modes and their weights; return the weight of the last input
    # and the modes' sum. Sums run over one array only: how far it lies from another decides on the order of a sum.
    n_modes = int(packed[at + N_MODES])
    first = at + HEADER
    previous = packed[at + PREVIOUS]
    for j in range(n_modes):
        decay = packed[first + DECAY * n_modes + j]
        current = packed[first + FROM_CURRENT * n_modes + j]
        gain = packed[first + FROM_PREVIOUS * n_modes + j] + decay * current
        work[0, j] = decay
        work[1, j] = (packed[first + MODE * n_modes + j] - current * previous) / gain
        work[2, j] = packed[first + WEIGHTED_DECAY * n_modes + j] * gain
        work[3, j] = packed[first + WEIGHTED_DECAY * n_modes + j] * current
    held, total = packed[at + HELD_WEIGHT], 0.0
    for j in range(n_modes):
        held += work[3, j]
        total += work[2, j] * work[1, j]
    return held, total


@compiled_sums
def _unshift_modes(packed: Array, at: int, shifted: Array, last: float) -> None:
    n_modes = int(packed[at + N_MODES])
    first = at + HEADER
    for j in range(n_modes):
        decay = packed[first + DECAY * n_modes + j]
        current = packed[first + FROM_CURRENT * n_modes + j]
        gain = packed[first + FROM_PREVIOUS * n_modes + j] + decay * current
        mode = gain * shifted[j] + current * last
        packed[first + MODE * n_modes + j] = mode if abs(mode) > _NEGLIGIBLE else 0.0
    packed[at + PREVIOUS] = last


@compiled_sums
def differentiate(packed: Array, at: int, values: Array, steps_s: Array, out: Array) -> None:
    """Fill ``out`` with ``D^alpha`` of the values, shape (n_samples,); the block's state moves on.

    ``out`` may be ``values`` itself.
    """
    kept = _nothing_kept(int(packed[at + N_MODES]))
    work = np.zeros((4, kept.shape[2]))
    start = 0
    while start < values.size:
        stop = _end_of_run(steps_s, start)
        _prepared(packed, at, steps_s[start], stop - start, kept)
        if stop - start < _SHORT_RUN:
            for k in range(start, stop):
                out[k] = differentiate_step(packed, at, values[k], steps_s[k])
        else:
            inverse_now, previous = 1.0 / packed[at + CURRENT_WEIGHT], packed[at + PREVIOUS]
            held, total = _shift_modes(packed, at, work)
            for k in range(start, stop):
                value = (values[k] - (held * previous + total)) * inverse_now
                out[k] = value
                total = 0.0
                for j in range(work.shape[1]):
                    mode = work[0, j] * work[1, j] + previous
                    work[1, j] = mode
                    total += work[2, j] * mode
                previous = value
            _unshift_modes(packed, at, work[1], previous)
        start = stop

"""Kernels several effects share: first-order lag, delay line, exact for a drive linear between samples."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled, compiled_sums

Array = NDArray[np.float64]

DELAY_CAPACITY = 4096  # steps a delay line keeps from call to call: 64 kB of state
_SERIES_BELOW = 0.25  # of the ratio: there ten terms are exact to rounding, and the closed form loses digits
_DELAY_HEADER = 3  # count, elapsed time [s], reading place


@compiled
def lag_shares(ratio: float) -> tuple[float, float]:
    """Return (gone, ramp) of a first-order lag over a step of ``ratio`` time constants, gone to the last digit.

    output = output_before + (ramp * input_now + (gone - ramp) * input_before - gone * output_before): where a step is
    a millionth of the time constant, weights that must add up to one would each lose what a million steps add up to.
    """
    gone = -math.expm1(-ratio)
    return gone, lag_weights(ratio)[1]


@compiled
def lag_weights(ratio: float) -> tuple[float, float]:
    """Return (decay, ramp) of a first-order lag over a step of ``ratio`` time constants.

    output = decay * output_before + (1 - decay - ramp) * input_before + ramp * input_now, exact for an input
    linear over the step.
    """
    if ratio < _SERIES_BELOW:
        # ramp / ratio = 1/2! - ratio/3! + ratio^2/4! - ..., in pairs that do not wait for each other
        square = ratio * ratio
        low = (0.5 - ratio * (1.0 / 6.0)) + square * (1.0 / 24.0 - ratio * (1.0 / 120.0))
        high = (1.0 / 720.0 - ratio * (1.0 / 5040.0)) + square * (1.0 / 40320.0 - ratio * (1.0 / 362880.0))
        rest = 1.0 / 3628800.0 - ratio * (1.0 / 39916800.0)
        ramp = ratio * (low + square * square * (high + square * square * rest))
        return 1.0 - ratio * (1.0 - ramp), ramp
    change = math.expm1(-ratio)
    return 1.0 + change, 1.0 + change / ratio


@compiled
def run_lag(state: Array, time_constant_s: float, values: Array, steps_s: Array, out: Array) -> None:
    """Fill ``out`` with the first-order lag of the values; state is (output, input) of the step before."""
    output, before = state[0], state[1]
    step = -1.0
    gone, ramp = 0.0, 0.0
    for k in range(values.size):
        if steps_s[k] != step:
            step = steps_s[k]
            gone, ramp = lag_shares(step / time_constant_s)
        output = output + (ramp * values[k] + (gone - ramp) * before - gone * output)
        before = values[k]
        out[k] = output
    state[0], state[1] = output, before


def delay_state() -> Array:
    """Return an empty delay line: count, elapsed time [s], reading place, then times and values."""
    return np.zeros(_DELAY_HEADER + 2 * DELAY_CAPACITY)


@compiled
def _slot(number: int) -> int:
    """Return where the time of a sample is kept."""
    return _DELAY_HEADER + number % DELAY_CAPACITY


@compiled
def run_delay(state: Array, delay_s: float, values: Array, steps_s: Array, out: Array) -> bool:
    """Fill ``out`` with the values ``delay_s`` ago, linear between samples; before the start they were zero.

    What is given in one call is read from there, so that of a whole record a delay may hold any number of samples; from
    one call to the next the line keeps its capacity.

    Returns whether the delay line was long enough for every sample.
    """
    before = int(state[0])  # samples of former calls
    elapsed = state[1]
    oldest = max(0, before - DELAY_CAPACITY)
    # How many samples are not younger than what is read. Back first: a changed delay takes over the state of another.
    reader = max(int(state[2]), oldest)
    if values.size > 0:
        wanted = elapsed + steps_s[0] - delay_s
        while reader > oldest and state[_slot(reader - 1)] > wanted:
            reader -= 1
    # What is read lies in one line, some twenty times as fast as where it is kept: from the sample before on.
    first = max(reader - 1, oldest)
    n_kept = before - first
    line_times, line_values = np.empty(n_kept + values.size), np.empty(n_kept + values.size)
    for i in range(n_kept):
        line_times[i] = state[_slot(first + i)]
        line_values[i] = state[_slot(first + i) + DELAY_CAPACITY]
    line_values[n_kept:] = values
    at = reader - first
    is_long_enough = True
    for k in range(values.size):
        newest = n_kept + k
        elapsed += steps_s[k]
        line_times[newest] = elapsed
        wanted = elapsed - delay_s
        while at <= newest and line_times[at] <= wanted:
            at += 1
        if at > newest:
            out[k] = values[k]
        elif wanted <= 0.0:
            out[k] = 0.0
        elif at > 0:
            share = (wanted - line_times[at - 1]) / (line_times[at] - line_times[at - 1])
            out[k] = line_values[at - 1] + share * (line_values[at] - line_values[at - 1])
        else:
            # before the first sample ever it was zero; otherwise what is to be read has been overwritten
            is_long_enough = is_long_enough and first == 0
            out[k] = wanted / line_times[0] * line_values[0]
    for k in range(max(0, values.size - DELAY_CAPACITY), values.size):
        slot = _slot(before + k)
        state[slot], state[slot + DELAY_CAPACITY] = line_times[n_kept + k], values[k]
    state[0], state[1], state[2] = float(before + values.size), elapsed, float(first + at)
    return is_long_enough


@compiled
def elapsed_times(state: Array, steps_s: Array, out: Array) -> None:
    """Fill ``out`` with the time since the first sample [s]; state is (elapsed [s], whether started)."""
    elapsed = state[0]
    for k in range(steps_s.size):
        if state[1] == 0.0:
            state[1] = 1.0
        else:
            elapsed += steps_s[k]
        out[k] = elapsed
    state[0] = elapsed


def knee_block(thresholds: Array, knees: Array, weights: Array) -> Array:
    """Return a packed block of plays that count only above a knee: header, thresholds, knees, weights, plays."""
    n_plays = len(thresholds)
    return np.concatenate(([float(n_plays)], thresholds, knees, weights, np.zeros(n_plays)))


def plain_block(thresholds: Array, weights: Array) -> Array:
    """Return a packed block of plays that count everywhere."""
    return knee_block(thresholds, np.full(len(thresholds), -np.inf), weights)


def with_plays_of(block: Array, old: Array) -> Array:
    """Return a packed block with the plays of another of as many; as it is where there are not."""
    carried = np.array(block, dtype=np.float64)
    if old.size == block.size:
        first = 1 + 3 * int(block[0])
        carried[first:] = old[first:]
    return carried


@compiled
def knee_sum(block: Array, value: float, is_kept: bool) -> float:
    """Return sum of weight * (max(play, knee) - max(0, knee)) at an input; the plays move on if ``is_kept``.

    A knee of -inf leaves a plain play.
    """
    n_plays = int(block[0])
    total = 0.0
    for j in range(n_plays):
        threshold = block[1 + j]
        knee = block[1 + n_plays + j]
        play = min(max(block[1 + 3 * n_plays + j], value - threshold), value + threshold)
        if is_kept:
            block[1 + 3 * n_plays + j] = play
        total += block[1 + 2 * n_plays + j] * (max(play, knee) - max(0.0, knee))
    return total


@compiled_sums
def run_knees(block: Array, values: Array, out: Array) -> None:
    """Fill ``out`` with ``knee_sum`` of each input, to rounding, shape (n_samples,); the plays move on."""
    n_plays = int(block[0])
    thresholds, knees = block[1 : 1 + n_plays], block[1 + n_plays : 1 + 2 * n_plays]
    weights, plays = block[1 + 2 * n_plays : 1 + 3 * n_plays], block[1 + 3 * n_plays : 1 + 4 * n_plays]
    floors = np.empty(n_plays)
    for j in range(n_plays):
        floors[j] = max(0.0, knees[j])
    for k in range(values.size):
        value = values[k]
        total = 0.0
        for j in range(n_plays):
            play = min(max(plays[j], value - thresholds[j]), value + thresholds[j])
            plays[j] = play
            total += weights[j] * (max(play, knees[j]) - floors[j])
        out[k] = total

"""Sums of terms of a displacement with memory: each a weight times powers of it, of its lag, its path, its play.

For controllers (step forms) and compiled, one beside the other; ``effects/unnamed.py`` says what a term is.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.kernels import lag_shares
from fomrc_core.effects.base.step_form import Fields, Number, lag_ramp

Array = NDArray[np.float64]

# Beyond what the terms were learned from they go on as at its edge: a power that is extrapolated says anything.
REACH = 1.1  # of the span
MOST_PATH = 20.0  # of the spans that a path counts: more is as much
_N_TURNS = 60  # of the inverse, each of which halves the error at least
N_STATE = 3  # of each term: late share, share of the step before, play


def prepare_terms(k: Fields, c: Fields, step_s: float) -> None:
    """Fill the coefficients of a step of this length."""
    for j in range(len(c.lags_s)):
        if c.lags_s[j] > 0.0:
            k.gone[j] = -math.expm1(-step_s / c.lags_s[j])
            k.ramp[j] = lag_ramp(step_s / c.lags_s[j])


def remembered(lag_power: float, late: float, before: float, gone: float, ramp: float, x: float) -> float:
    """Return the lag of x after a step, or for a power of zero the path it has gone lately."""
    if lag_power < 0.5:
        return min(late - gone * late + abs(x - before), 20.0)
    return late + (ramp * x + (gone - ramp) * before - gone * late)


def factor_of(lag_power: float, late: float, x: float) -> float:
    """Return the factor of a term that its memory makes."""
    if lag_power < 0.5:
        return late
    if lag_power < 1.5:
        return x - late
    if lag_power < 2.5:
        return (x - late) * (x - late)
    return (x - late) * (x - late) * (x - late)


def add_terms(s: Fields, k: Fields, c: Fields, value: float) -> Number:
    """Return the value with the terms of it [um]."""
    x = min(max(value / c.span_um, -c.reach), c.reach)
    total = 0.0
    for j in range(len(c.weights_um)):
        term = c.weights_um[j]
        for _ in range(int(c.powers[j])):
            term = term * x
        if c.lags_s[j] > 0.0:
            s.late[j] = remembered(c.lag_powers[j], s.late[j], s.before[j], k.gone[j], k.ramp[j], x)
            term = term * factor_of(c.lag_powers[j], s.late[j], x)
        s.before[j] = x
        if c.thresholds[j] > 0.0:
            s.play[j] = min(max(s.play[j], x - c.thresholds[j]), x + c.thresholds[j])
            term = term * (x - s.play[j])
        total = total + term
    return value + total


def take_terms(s: Fields, k: Fields, c: Fields, value: float) -> Number:
    """Return the value whose terms make it this one [um]."""
    found = value
    # a contraction, for the terms are less steep than the displacement
    for _ in range(60):
        x = min(max(found / c.span_um, -c.reach), c.reach)
        total = 0.0
        for j in range(len(c.weights_um)):
            term = c.weights_um[j]
            for _i in range(int(c.powers[j])):
                term = term * x
            if c.lags_s[j] > 0.0:
                late = remembered(c.lag_powers[j], s.late[j], s.before[j], k.gone[j], k.ramp[j], x)
                term = term * factor_of(c.lag_powers[j], late, x)
            if c.thresholds[j] > 0.0:
                term = term * (x - min(max(s.play[j], x - c.thresholds[j]), x + c.thresholds[j]))
            total = total + term
        moved = value - total
        is_still = abs(moved - found) <= 1e-15 * c.span_um
        found = moved
        if is_still:
            break
    x = min(max(found / c.span_um, -c.reach), c.reach)
    for j in range(len(c.weights_um)):
        if c.lags_s[j] > 0.0:
            s.late[j] = remembered(c.lag_powers[j], s.late[j], s.before[j], k.gone[j], k.ramp[j], x)
        s.before[j] = x
        if c.thresholds[j] > 0.0:
            s.play[j] = min(max(s.play[j], x - c.thresholds[j]), x + c.thresholds[j])
    return found


_remembered, _factor_of = compiled(remembered), compiled(factor_of)


@compiled
def _advance_term(
    state: Array,
    at: int,
    power: float,
    lag_s: float,
    lag_power: float,
    threshold: float,
    x: float,
    gone: float,
    ramp: float,
) -> float:
    """Return one term, and move its state on by a step of these shares of its lag."""
    x = min(max(x, -REACH), REACH)
    value = 1.0
    for _ in range(int(power)):
        value *= x
    if lag_s > 0.0:
        state[at] = _remembered(lag_power, state[at], state[at + 1], gone, ramp, x)
        state[at + 1] = x
        value *= _factor_of(lag_power, state[at], x)
    if threshold > 0.0:
        play = min(max(state[at + 2], x - threshold), x + threshold)
        state[at + 2] = play
        value *= x - play
    return value


@compiled
def shares_of(lags_s: Array, step_s: float, known_s: float, gone: Array, ramps: Array) -> float:
    """Return the step, its shares filled in: most of what a term costs, and those of a step as long are known."""
    if step_s != known_s:
        for j in range(lags_s.size):
            if lags_s[j] > 0.0:
                gone[j], ramps[j] = lag_shares(step_s / lags_s[j])
    return step_s


@compiled
def _sum_of_terms(
    state: Array,
    weights: Array,
    powers: Array,
    lags_s: Array,
    lag_powers: Array,
    thresholds: Array,
    x: float,
    gone: Array,
    ramps: Array,
) -> float:
    """Return all terms together [um], and move their states on."""
    total = 0.0
    for j in range(weights.size):
        total += weights[j] * _advance_term(
            state, N_STATE * j, powers[j], lags_s[j], lag_powers[j], thresholds[j], x, gone[j], ramps[j]
        )
    return total


@compiled
def run_sum(
    state: Array,
    weights: Array,
    powers: Array,
    lags_s: Array,
    lag_powers: Array,
    thresholds: Array,
    span_um: float,
    values: Array,
    steps_s: Array,
    out: Array,
) -> None:
    """Fill ``out`` with the values and the terms of them [um]; the state moves on."""
    gone, ramps = np.zeros(lags_s.size), np.zeros(lags_s.size)
    step_s = -1.0
    for k in range(values.size):
        step_s = shares_of(lags_s, steps_s[k], step_s, gone, ramps)
        share = values[k] / span_um
        total = _sum_of_terms(state, weights, powers, lags_s, lag_powers, thresholds, share, gone, ramps)
        out[k] = values[k] + total


@compiled
def run_terms(
    state: Array,
    powers: Array,
    lags_s: Array,
    lag_powers: Array,
    thresholds: Array,
    x: Array,
    steps_s: Array,
    out: Array,
) -> None:
    """Fill ``out`` with each term without its weight, (n_samples, n_terms); the state moves on."""
    gone, ramps = np.zeros(lags_s.size), np.zeros(lags_s.size)
    step_s = -1.0
    for k in range(x.size):
        step_s = shares_of(lags_s, steps_s[k], step_s, gone, ramps)
        for j in range(powers.size):
            out[k, j] = _advance_term(
                state, N_STATE * j, powers[j], lags_s[j], lag_powers[j], thresholds[j], x[k], gone[j], ramps[j]
            )


@compiled
def invert_terms(
    state: Array,
    weights: Array,
    powers: Array,
    lags_s: Array,
    lag_powers: Array,
    thresholds: Array,
    span_um: float,
    values: Array,
    steps_s: Array,
    out: Array,
) -> None:
    """Fill ``out`` with the values whose terms make them these [um]; the state moves on."""
    before = state.copy()
    found = 0.0
    gone, ramps = np.zeros(lags_s.size), np.zeros(lags_s.size)
    step_s = -1.0
    for k in range(values.size):
        step_s = shares_of(lags_s, steps_s[k], step_s, gone, ramps)
        before[:] = state
        found = values[k]
        # a contraction, for the terms are less steep than the displacement
        for _ in range(_N_TURNS):
            state[:] = before
            share = found / span_um
            total = _sum_of_terms(state, weights, powers, lags_s, lag_powers, thresholds, share, gone, ramps)
            moved = values[k] - total
            is_still = abs(moved - found) <= 1e-15 * span_um
            found = moved
            if is_still:
                break
        out[k] = found

"""Sums of terms of a signal beside the displacement: each a weight times powers of both, and what one of them lags.

For controllers (step forms) and compiled, one beside the other; ``signal_terms.py`` says what a term is. Signal and
displacement are shares of what they were learned from, and stand still not far beyond it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.kernels import lag_shares
from fomrc_core.effects.base.step_form import Fields, Number, clock_after, ramp_in_step

Array = NDArray[np.float64]

# Shares beyond which signal and displacement stand still: a power that is extrapolated says anything, a line may go on
# as far again as it was learned.
SIGNAL_REACH, LINE_REACH = 1.1, 2.0
N_SIGNAL_STATE = 2  # of each term: late share, share of the step before
N_CLOCK = 2  # before them: time since the first sample [s], whether there has been one
_N_TURNS = 60  # of the inverse, each of which halves the error at least


def late_after(late: float, before: float, gone: float, ramp: float, x: float) -> float:
    """Return the lag of x after a step."""
    return late + (ramp * x + (gone - ramp) * before - gone * late)


def power_of(x: float, power: float) -> float:
    """Return a share within a line's reach to a whole power, beyond the reach of powers that of the reach."""
    if power < 1.5:
        if power < 0.5:
            return 1.0
        return x
    inside = min(max(x, -1.1), 1.1)
    total = 1.0
    for _ in range(int(power)):
        total = total * inside
    return total


def add_terms_of_time(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    """Return the value with its terms of the time since the first sample [um]."""
    s.elapsed = clock_after(s.elapsed, s.started, step_s)
    t = min((s.elapsed - c.signal_zero) / c.signal_range, c.reach)
    x = min(max(value / c.span_um, -c.reach), c.reach)
    total = 0.0
    for j in range(len(c.weights_um)):
        term = c.weights_um[j] * power_of(t, c.signal_powers[j]) * power_of(x, c.powers[j])
        if c.lags_s[j] > 0.0:
            if s.started == 0:
                s.late[j] = x
            else:
                ratio = step_s / c.lags_s[j]
                ramp = ramp_in_step(ratio)
                s.late[j] = late_after(s.late[j], s.before[j], ratio * (1.0 - ramp), ramp, x)
            s.before[j] = x
            term = term * (x - s.late[j])
        total = total + term
    s.started = 1
    return value + total


def add_terms_of_column(s: Fields, c: Fields, value: float, step_s: float, covariate: float, is_known: int) -> Number:
    """Return the value with its terms of a recorded signal [um]."""
    if not is_known:
        return value
    u = min(max((covariate - c.signal_zero) / c.signal_range, -c.reach), c.reach)
    x = min(max(value / c.span_um, -c.reach), c.reach)
    total = 0.0
    for j in range(len(c.weights_um)):
        term = c.weights_um[j] * power_of(u, c.signal_powers[j]) * power_of(x, c.powers[j])
        if c.lags_s[j] > 0.0:
            if s.started == 0:
                s.late[j] = u
            else:
                ratio = step_s / c.lags_s[j]
                ramp = ramp_in_step(ratio)
                s.late[j] = late_after(s.late[j], s.before[j], ratio * (1.0 - ramp), ramp, u)
            s.before[j] = u
            term = term * (u - s.late[j])
        total = total + term
    s.started = 1
    return value + total


def take_terms_of_column(s: Fields, c: Fields, value: float, step_s: float, covariate: float, is_known: int) -> Number:
    """Return the value whose terms make it this one [um]."""
    if not is_known:
        return value
    u = min(max((covariate - c.signal_zero) / c.signal_range, -c.reach), c.reach)
    for j in range(len(c.weights_um)):
        if c.lags_s[j] > 0.0:
            if s.started == 0:
                s.late[j] = u
            else:
                ratio = step_s / c.lags_s[j]
                ramp = ramp_in_step(ratio)
                s.late[j] = late_after(s.late[j], s.before[j], ratio * (1.0 - ramp), ramp, u)
            s.before[j] = u
    s.started = 1
    found = value
    # a contraction, for the terms are less steep than the displacement
    for _ in range(60):
        x = min(max(found / c.span_um, -c.reach), c.reach)
        total = 0.0
        for j in range(len(c.weights_um)):
            term = c.weights_um[j] * power_of(u, c.signal_powers[j]) * power_of(x, c.powers[j])
            if c.lags_s[j] > 0.0:
                term = term * (u - s.late[j])
            total = total + term
        moved = value - total
        is_still = abs(moved - found) <= 1e-15 * c.span_um
        found = moved
        if is_still:
            break
    return found


_power_of = compiled(power_of)


@compiled
def _factors(
    state: Array,
    signal_powers: Array,
    lags_s: Array,
    lags_displacement: bool,
    u: float,
    x: float,
    step_s: float,
    out: Array,
) -> None:
    """Fill ``out`` with what the signal and its memory, or that of the displacement, make of each term."""
    for j in range(lags_s.size):
        out[j] = _power_of(u, signal_powers[j])
        if lags_s[j] > 0.0:
            z = x if lags_displacement else u
            at = N_CLOCK + N_SIGNAL_STATE * j
            if state[1] == 0.0:
                state[at] = z
            else:
                gone, ramp = lag_shares(step_s / lags_s[j])
                state[at] += ramp * z + (gone - ramp) * state[at + 1] - gone * state[at]
            state[at + 1] = z
            out[j] *= z - state[at]


@compiled
def _share(value: float) -> float:
    return min(max(value, -LINE_REACH), LINE_REACH)


@compiled
def run_signal_terms(
    state: Array,
    terms: Array,
    lags_displacement: bool,
    signal: Array,
    x: Array,
    steps_s: Array,
    columns: Array,
    total: Array,
) -> None:
    """Fill ``columns`` with each term without its weight, where it has rows, and ``total`` with their sum.

    ``terms`` has the rows weights, powers of the signal, powers of the displacement, lags; the state moves on.
    """
    weights, signal_powers, powers, lags_s = terms[0], terms[1], terms[2], terms[3]
    factors = np.empty(weights.size)
    for n in range(x.size):
        here = _share(x[n])
        if state[1] == 1.0:
            state[0] += steps_s[n]
        _factors(state, signal_powers, lags_s, lags_displacement, _share(signal[n]), here, steps_s[n], factors)
        state[1] = 1.0
        total[n] = 0.0
        for j in range(weights.size):
            term = factors[j] * _power_of(here, powers[j])
            total[n] += weights[j] * term
            if columns.shape[0] > 0:
                columns[n, j] = term


@compiled
def invert_signal_terms(
    state: Array, terms: Array, span_um: float, signal: Array, values: Array, steps_s: Array, out: Array
) -> None:
    """Fill ``out`` with the values whose terms make them these [um]; the memory is that of the signal alone."""
    weights, signal_powers, powers, lags_s = terms[0], terms[1], terms[2], terms[3]
    factors = np.empty(weights.size)
    for n in range(values.size):
        if state[1] == 1.0:
            state[0] += steps_s[n]
        _factors(state, signal_powers, lags_s, False, _share(signal[n]), 0.0, steps_s[n], factors)
        state[1] = 1.0
        found = values[n]
        # a contraction, for the terms are less steep than the displacement
        for _ in range(_N_TURNS):
            here = _share(found / span_um)
            total = 0.0
            for j in range(weights.size):
                total += weights[j] * factors[j] * _power_of(here, powers[j])
            moved = values[n] - total
            is_still = abs(moved - found) <= 1e-15 * span_um
            found = moved
            if is_still:
                break
        out[n] = found

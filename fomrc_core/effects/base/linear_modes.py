"""Linear dynamics as a sum of first-order modes side by side, exact for an input linear between samples.

    output = through * input + sum_j gain_j * z_j,        dz_j/dt = rate_j (input - z_j),

each mode by its own exponential, whatever the length of the step (lags and relaxations have real rates, a filter that
overshoots pairs of complex ones, of which one stands for both).
"""

from __future__ import annotations

import math

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.compiled import compiled, compiled_sums
from fomrc_core.compute.vector_registers import in_whole_registers
from fomrc_core.effects.base.kernels import lag_shares
from fomrc_core.effects.base.step_form import FieldKind, Fields, Number, StateField, StepForm, lag_ramp

_SERIES_LIMIT = 0.1  # of rate times step: below it the closed form of the ramp cancels
_N_SERIES = 9


def modes_at_rest(n_modes: int) -> Array:
    """Return the state of real modes at rest: the input of the step before, then the modes."""
    return np.zeros(1 + n_modes)


@compiled_sums
def run_modes(
    state: Array, rates_per_s: Array, gains: Array, through: float, values: Array, steps_s: Array, out: Array
) -> None:
    """Fill ``out`` with the response of real modes, shape (n_samples,); the state moves on."""
    n_modes = rates_per_s.size
    n_whole = in_whole_registers(n_modes) if n_modes > 1 else n_modes
    gone, ramps, shares, modes = np.zeros(n_whole), np.zeros(n_whole), np.zeros(n_whole), np.zeros(n_whole)
    for j in range(n_modes):
        shares[j], modes[j] = gains[j], state[1 + j]
    before = state[0]
    step = -1.0
    for k in range(values.size):
        if steps_s[k] != step:
            step = steps_s[k]
            for j in range(n_modes):
                gone[j], ramps[j] = lag_shares(step * rates_per_s[j])
        now = values[k]
        rise = now - before
        total = 0.0
        for j in range(n_whole):
            mode = modes[j] + (ramps[j] * rise + gone[j] * (before - modes[j]))
            modes[j] = mode
            total += shares[j] * mode
        before = now
        out[k] = through * now + total
    state[0] = before
    for j in range(n_modes):
        state[1 + j] = modes[j]


@compiled
def undo_modes(
    state: Array, rates_per_s: Array, gains: Array, through: float, values: Array, steps_s: Array, out: Array
) -> None:
    """Fill ``out`` with the input whose response ``run_modes`` is these values, exactly; the state moves on."""
    n_modes = rates_per_s.size
    gone, ramps = np.empty(n_modes), np.empty(n_modes)
    step, share = -1.0, 1.0
    for k in range(values.size):
        if steps_s[k] != step:
            step, share = steps_s[k], through
            for j in range(n_modes):
                gone[j], ramps[j] = lag_shares(step * rates_per_s[j])
                share += gains[j] * ramps[j]
        before = state[0]
        known = 0.0
        for j in range(n_modes):
            mode = state[1 + j] + ((gone[j] - ramps[j]) * before - gone[j] * state[1 + j])
            state[1 + j] = mode
            known += gains[j] * mode
        now = (values[k] - known) / share
        for j in range(n_modes):
            state[1 + j] += ramps[j] * now
        state[0] = now
        out[k] = now


def pairs_at_rest(n_pairs: int) -> Array:
    """Return the state of complex modes at rest: the input of the step before, then each mode's two parts."""
    return np.zeros(1 + 2 * n_pairs)


@compiled
def pair_weights(x: float, y: float) -> tuple[float, float, float, float]:
    """Return decay exp(z) and ramp 1 - (exp(z) - 1) / z of z = x + i y = pole times step, both parts of each."""
    size = math.exp(x)
    decay_re, decay_im = size * math.cos(y), size * math.sin(y)
    square = x * x + y * y
    if square > _SERIES_LIMIT * _SERIES_LIMIT:
        a, b = decay_re - 1.0, decay_im
        return decay_re, decay_im, 1.0 - (a * x + b * y) / square, -(b * x - a * y) / square
    # -(z/2! + z^2/3! + ...)
    power_re, power_im, ramp_re, ramp_im = 1.0, 0.0, 0.0, 0.0
    for n in range(1, _N_SERIES):
        power_re, power_im = (power_re * x - power_im * y) / (n + 1.0), (power_re * y + power_im * x) / (n + 1.0)
        ramp_re -= power_re
        ramp_im -= power_im
    return decay_re, decay_im, ramp_re, ramp_im


@compiled
def run_pairs(state: Array, poles_per_s: Array, gains: Array, values: Array, steps_s: Array, out: Array) -> None:
    """Fill ``out`` with the real part of sum_j gain_j z_j, dz_j/dt = pole_j (z_j - input); the state moves on.

    Args:
        state: from ``pairs_at_rest``.
        poles_per_s: real and imaginary parts, shape (n_pairs, 2).
        gains: the same of the gains, shape (n_pairs, 2).
        values: input, shape (n_samples,).
        steps_s: steps [s], shape (n_samples,).
        out: response, shape (n_samples,).
    """
    n_pairs = poles_per_s.shape[0]
    weights = np.empty((n_pairs, 4))
    step = -1.0
    for k in range(values.size):
        if steps_s[k] != step:
            step = steps_s[k]
            for j in range(n_pairs):
                w = pair_weights(poles_per_s[j, 0] * step, poles_per_s[j, 1] * step)
                weights[j, 0], weights[j, 1], weights[j, 2], weights[j, 3] = w
        before, now = state[0], values[k]
        total = 0.0
        for j in range(n_pairs):
            re, im = state[1 + 2 * j], state[2 + 2 * j]
            d, e, r, s = weights[j, 0], weights[j, 1], weights[j, 2], weights[j, 3]
            new_re = d * re - e * im + (1.0 - d - r) * before + r * now
            new_im = d * im + e * re - (e + s) * before + s * now
            state[1 + 2 * j], state[2 + 2 * j] = new_re, new_im
            total += gains[j, 0] * new_re - gains[j, 1] * new_im
        state[0] = now
        out[k] = total


_LOGARITHMIC_FIRST, _LOGARITHMIC_LAST = (
    -2,
    20,
)  # of e-folds from the onset: nothing faster, nothing within a record slower


def logarithmic_modes(onset_s: float) -> tuple[Array, Array]:
    """Return rates [1/s] and gains of modes that after a unit step add up to ln(1 + t / onset_s).

    ln(1 + t / T) is the integral of exp(-s T) (1 - exp(-s t)) / s over all rates s (Frullani): a sum over rates a
    factor e apart, of which those slower than a hundred million times the onset, and those that the exponential
    leaves nothing of, are left out. The sum errs by some 1e-4 of a neper.
    """
    folds = np.arange(_LOGARITHMIC_FIRST, _LOGARITHMIC_LAST)
    rates_onset = np.exp(-folds.astype(np.float64))
    return rates_onset / onset_s, np.exp(-rates_onset)


def modes_form(rates_per_s: Array, gains: Array, through: float, *, is_inverted: bool) -> StepForm:
    """Return ``run_modes``, and where wanted ``undo_modes``, a sample at a time, for a controller."""
    return StepForm(
        constants=(("rates", tuple(rates_per_s.tolist())), ("gains", tuple(gains.tolist())), ("through", through)),
        state=(
            StateField("modes", (0.0,) * rates_per_s.size, FieldKind.WIDE, is_array=True),
            StateField("before", comment="input of the step before"),
        ),
        coefficients=(("gone", rates_per_s.size), ("ramp", rates_per_s.size), "share"),
        prepare=_prepare_modes,
        forward=_follow_modes,
        inverse=_undo_modes if is_inverted else None,
        helpers=(lag_ramp,),
    )


def _prepare_modes(k: Fields, c: Fields, step_s: float) -> None:
    share = c.through
    for j in range(len(c.rates)):
        k.gone[j] = -math.expm1(-step_s * c.rates[j])
        k.ramp[j] = lag_ramp(step_s * c.rates[j])
        share = share + c.gains[j] * k.ramp[j]
    k.share = share


def _follow_modes(s: Fields, k: Fields, c: Fields, value: float) -> Number:
    total = c.through * value
    for j in range(len(c.rates)):
        mode = s.modes[j] + (k.ramp[j] * value + (k.gone[j] - k.ramp[j]) * s.before - k.gone[j] * s.modes[j])
        s.modes[j] = mode
        total = total + c.gains[j] * mode
    s.before = value
    return total


def _undo_modes(s: Fields, k: Fields, c: Fields, value: float) -> Number:
    known = 0.0
    for j in range(len(c.rates)):
        mode = s.modes[j] + ((k.gone[j] - k.ramp[j]) * s.before - k.gone[j] * s.modes[j])
        s.modes[j] = mode
        known = known + c.gains[j] * mode
    now = (value - known) / k.share
    for j in range(len(c.rates)):
        s.modes[j] = s.modes[j] + k.ramp[j] * now
    s.before = now
    return now

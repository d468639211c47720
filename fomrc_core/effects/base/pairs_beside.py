"""Complex modes (linear_modes.py) beside what comes through at once, and their exact inverse.

    output = through * input + real part of sum_j gain_j z_j,        dz_j/dt = pole_j (z_j - input).

For controllers (step forms) and compiled, one beside the other.
"""

from __future__ import annotations

import math

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.linear_modes import pair_weights
from fomrc_core.effects.base.step_form import FieldKind, Fields, Number, StateField, StepForm


@compiled
def undo_pairs(
    state: Array, poles_per_s: Array, gains: Array, through: float, values: Array, steps_s: Array, out: Array
) -> None:
    """Fill ``out`` with the input whose response, ``run_pairs`` and ``through`` times it, is these values."""
    n_pairs = poles_per_s.shape[0]
    weights = np.empty((n_pairs, 4))
    step, share = -1.0, 1.0
    for k in range(values.size):
        if steps_s[k] != step:
            step, share = steps_s[k], through
            for j in range(n_pairs):
                w = pair_weights(poles_per_s[j, 0] * step, poles_per_s[j, 1] * step)
                weights[j, 0], weights[j, 1], weights[j, 2], weights[j, 3] = w
                share += gains[j, 0] * w[2] - gains[j, 1] * w[3]
        before, known = state[0], 0.0
        for j in range(n_pairs):
            re, im = state[1 + 2 * j], state[2 + 2 * j]
            d, e, r, s = weights[j, 0], weights[j, 1], weights[j, 2], weights[j, 3]
            state[1 + 2 * j] = d * re - e * im + (1.0 - d - r) * before
            state[2 + 2 * j] = d * im + e * re - (e + s) * before
            known += gains[j, 0] * state[1 + 2 * j] - gains[j, 1] * state[2 + 2 * j]
        now = (values[k] - known) / share
        for j in range(n_pairs):
            state[1 + 2 * j] += weights[j, 2] * now
            state[2 + 2 * j] += weights[j, 3] * now
        state[0] = now
        out[k] = now


def pairs_form(poles_per_s: Array, gains: Array, through: float = 0.0, *, is_inverted: bool = False) -> StepForm:
    """Return ``run_pairs`` and ``through`` times the input, and where wanted ``undo_pairs``, for a controller."""
    n_pairs = poles_per_s.shape[0]
    (pole_re, pole_im), (gain_re, gain_im) = poles_per_s.T.tolist(), gains.T.tolist()
    return StepForm(
        constants=(
            ("pole_re", tuple(pole_re)),
            ("pole_im", tuple(pole_im)),
            ("gain_re", tuple(gain_re)),
            ("gain_im", tuple(gain_im)),
            ("through", through),
        ),
        state=(
            StateField("re", (0.0,) * n_pairs, FieldKind.WIDE, is_array=True, comment="real parts of the modes"),
            StateField("im", (0.0,) * n_pairs, FieldKind.WIDE, is_array=True, comment="imaginary parts"),
            StateField("before", comment="input of the step before"),
        ),
        coefficients=(*((name, n_pairs) for name in ("decay_re", "decay_im", "ramp_re", "ramp_im")), "share"),
        prepare=_prepare_pairs,
        forward=_follow_pairs,
        inverse=_undo_pairs if is_inverted else None,
    )


def _prepare_pairs(k: Fields, c: Fields, step_s: float) -> None:
    # pair_weights of each pole
    share = c.through
    for j in range(len(c.pole_re)):
        x = c.pole_re[j] * step_s
        y = c.pole_im[j] * step_s
        k.decay_re[j] = math.exp(x) * math.cos(y)
        k.decay_im[j] = math.exp(x) * math.sin(y)
        square = x * x + y * y
        if square > 0.01:
            a = k.decay_re[j] - 1.0
            k.ramp_re[j] = 1.0 - (a * x + k.decay_im[j] * y) / square
            k.ramp_im[j] = -(k.decay_im[j] * x - a * y) / square
        else:
            power_re = 1.0
            power_im = 0.0
            k.ramp_re[j] = 0.0
            k.ramp_im[j] = 0.0
            for n in range(8):
                former = power_re
                power_re = (power_re * x - power_im * y) / (n + 2.0)
                power_im = (former * y + power_im * x) / (n + 2.0)
                k.ramp_re[j] = k.ramp_re[j] - power_re
                k.ramp_im[j] = k.ramp_im[j] - power_im
        share = share + c.gain_re[j] * k.ramp_re[j] - c.gain_im[j] * k.ramp_im[j]
    k.share = share


def _follow_pairs(s: Fields, k: Fields, c: Fields, value: float) -> Number:
    total = c.through * value
    for j in range(len(c.pole_re)):
        re = k.decay_re[j] * s.re[j] - k.decay_im[j] * s.im[j]
        im = k.decay_re[j] * s.im[j] + k.decay_im[j] * s.re[j]
        re = re + (1.0 - k.decay_re[j] - k.ramp_re[j]) * s.before + k.ramp_re[j] * value
        im = im - (k.decay_im[j] + k.ramp_im[j]) * s.before + k.ramp_im[j] * value
        s.re[j] = re
        s.im[j] = im
        total = total + (c.gain_re[j] * re - c.gain_im[j] * im)
    s.before = value
    return total


def _undo_pairs(s: Fields, k: Fields, c: Fields, value: float) -> Number:
    known = 0.0
    for j in range(len(c.pole_re)):
        re = k.decay_re[j] * s.re[j] - k.decay_im[j] * s.im[j]
        im = k.decay_re[j] * s.im[j] + k.decay_im[j] * s.re[j]
        s.re[j] = re + (1.0 - k.decay_re[j] - k.ramp_re[j]) * s.before
        s.im[j] = im - (k.decay_im[j] + k.ramp_im[j]) * s.before
        known = known + (c.gain_re[j] * s.re[j] - c.gain_im[j] * s.im[j])
    now = (value - known) / k.share
    for j in range(len(c.pole_re)):
        s.re[j] = s.re[j] + k.ramp_re[j] * now
        s.im[j] = s.im[j] + k.ramp_im[j] * now
    s.before = now
    return now

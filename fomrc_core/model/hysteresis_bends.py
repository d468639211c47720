"""What hysteresis bends within a sample, and the voltages that give those bends to a stage that rings.

An element that gives way between two samples bends the voltage there. The samples do not show it, or fold it down to
frequencies at which it is not: a mass that swings within few samples is struck by what is missing. So the hysteresis is
looked at in parts of a sample, of which the straight line from sample to sample is taken off,

    e_i = u(y_0 + (y_1 - y_0) i / n) - u_0 - (u_1 - u_0) i / n,        i = 1 .. n - 1,

and the voltages find what is below half the sample rate of these n - 1 hats by a filter of their own.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fomrc_core.compute.arrays import Array, ComplexArray
from fomrc_core.compute.compiled import compiled_sums
from fomrc_core.compute.least_squares import NormalEquations
from fomrc_core.effects.base.course import low_pass
from fomrc_core.operators.creep import PREVIOUS, differentiate_step
from fomrc_core.operators.hysteresis import move_stops, peek_stops

N_PARTS = 4  # of a sample; 8 leave as little ringing within a tenth
N_BENDS = N_PARTS - 1
N_BENDS_BEHIND = 10  # samples whose bends are still being given: 4 leave half as much ringing again
# Of the sample rate, where what is given to a stage that rings is to be whole, and nothing: as far as samples reach.
WIDE_FLAT, WIDE_GONE = 0.35, 0.5
_N_FREQUENCIES = 1024
_SLOW = 0.05  # of the sample rate: below it weights stop to rise
_PENALTY = 1e-3  # of taps, beside errors of one


@compiled_sums
def bent_step(packed: Array, at_creep: int, desired_um: float, step_s: float, before_v: float, bends_v: Array) -> float:
    """Return the voltage [V] after one step as ``inverse_step`` does, and fill in the bends on the way [V].

    Args:
        packed: stop form at 0; the state moves on.
        at_creep: where the creep block begins.
        desired_um: where the step ends [um].
        step_s: its length [s].
        before_v: voltage after the step before [V].
        bends_v: filled, shape (N_BENDS,).
    """
    if not (0.0 < step_s < np.inf and abs(desired_um) < np.inf):
        return np.nan
    before = packed[at_creep + PREVIOUS]
    change = differentiate_step(packed, at_creep, desired_um, step_s) - before
    for i in range(N_BENDS):
        bends_v[i] = peek_stops(packed, 0, before + change * ((i + 1) / N_PARTS))
    voltage = move_stops(packed, 0, before + change)
    for i in range(N_BENDS):
        bends_v[i] -= before_v + (voltage - before_v) * ((i + 1) / N_PARTS)
    return voltage


@compiled_sums
def bent_run(packed: Array, at_creep: int, desired_um: Array, step_s: float, voltage_v: Array, bends_v: Array) -> None:
    """Fill voltages [V], (n_samples,), and bends [V], (n_samples, N_BENDS), of displacements [um], (n_samples,)."""
    last_v = peek_stops(packed, 0, packed[at_creep + PREVIOUS])
    for k in range(desired_um.size):
        last_v = bent_step(packed, at_creep, desired_um[k], step_s, last_v, bends_v[k])
        voltage_v[k] = last_v


def bend_taps(response: Callable[[Array], ComplexArray], step_s: float, flat_hz: float, n_ahead: int) -> Array:
    """Return the taps that give bends to a stage, shape (N_BENDS, N_BENDS_BEHIND + 1 + n_ahead), oldest first.

    By least squares over the band, as far as dynamics can be undone at all.

    Args:
        response: complex gain at frequencies [Hz], from the voltages put out to what hysteresis sees between samples.
        step_s: distance of the samples [s].
        flat_hz: up to here bends are given whole [Hz].
        n_ahead: number of samples to come whose bends are known.
    """
    frequency_hz = np.linspace(0.0, 0.5 / step_s, _N_FREQUENCIES)
    phase = 2.0 * np.pi * step_s * frequency_hz
    gone_hz = min(WIDE_GONE / WIDE_FLAT * flat_hz, 0.5 / step_s)
    band = low_pass(frequency_hz, flat_hz, gone_hz)
    weight = _SLOW / (_SLOW + frequency_hz * step_s)
    gain = response(frequency_hz)
    hat = np.sinc(frequency_hz * step_s / N_PARTS) ** 2 / N_PARTS
    before_end = 1.0 - np.arange(1, N_PARTS) / N_PARTS
    wanted = (hat * band)[:, None] * np.exp(1j * np.outer(phase, before_end))
    lags = np.arange(-N_BENDS_BEHIND, n_ahead + 1)
    waves = weight[:, None] * gain[:, None] * np.exp(1j * np.outer(phase, lags))
    gram = (waves.conj().T @ waves).real + _PENALTY**2 * np.eye(lags.size)
    moment = (waves.conj().T @ (weight[:, None] * wanted)).real
    return np.ascontiguousarray(NormalEquations(gram, moment).solution().T)

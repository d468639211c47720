"""Second-order dynamics, of a mass on a spring or an amplifier that overshoots, exact for a linear input."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compute.arrays import Array, ComplexArray
from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.effect import Effect, Stage
from fomrc_core.effects.base.linear_columns import through_pairs
from fomrc_core.effects.base.step_form import FieldKind, Fields, Number, StateField, StepForm

# Of a response, over what it is at rest: one that peaks by less is a lag of two poles to whoever looks. The sharpest of
# those (Butterworth's) is just where peaks end, so that every other fit to one would come out as a resonance.
_LEAST_PEAK = 1.01
# The damping ratio d of that: the peak is 1 / (2 d sqrt(1 - d^2)).
_FLAT = math.sqrt(0.5 * (1.0 - math.sqrt(1.0 - _LEAST_PEAK**-2)))

# Of what rings at a third of the sample rate a straight line over a fifth of a sample is 2 % off, over a twentieth
# 0.1 %.
_N_PARTS_RINGING = 20


@compiled
def run_second_order(
    state: Array, omega: float, damping: float, values: Array, steps_s: Array, out: Array, rate: Array
) -> None:
    """Fill ``out`` with x of x'' + 2 d w x' + w^2 x = w^2 f, exact for f linear over each step; the state moves on.

    Args:
        state: (x, its rate [1/s], f) at the step before, zeros at rest.
        omega: undamped angular frequency w [rad/s].
        damping: damping ratio d, below 1.
        values: f, shape (n_samples,).
        steps_s: steps [s], shape (n_samples,).
        out: x, shape (n_samples,).
        rate: x' [1/s], shape (n_samples,); of size 0 where nobody asks.
    """
    # f linear over the step: the particular solution is a line, behind by a lag; the rest decays. What a step does to
    # distance from the input and rate is a matrix, so that each waits for little of the step before.
    position, velocity, before = state[0], state[1], state[2]
    sigma, damped = damping * omega, omega * math.sqrt(1.0 - damping * damping)
    lag_s = 2.0 * damping / omega
    step, per_s = -1.0, 0.0
    stays, swings, returns, keeps, slope_moves, slope_drives = 1.0, 0.0, 0.0, 1.0, 0.0, 0.0
    for k in range(values.size):
        if steps_s[k] != step:
            step = steps_s[k]
            per_s = 1.0 / step
            decay = math.exp(-sigma * step)
            c, s = decay * math.cos(damped * step), decay * math.sin(damped * step) / damped
            stays, swings, returns, keeps = c + sigma * s, s, -omega * omega * s, c - sigma * s
            slope_moves = (stays - 1.0) * lag_s - swings
            slope_drives = returns * lag_s + (1.0 - keeps)
        distance = position - before
        slope = (values[k] - before) * per_s
        before = values[k]
        position = before + (stays * distance + (swings * velocity + slope_moves * slope))
        velocity = keeps * velocity + (returns * distance + slope_drives * slope)
        out[k] = position
        if rate.size:
            rate[k] = velocity
    state[0], state[1], state[2] = position, velocity, before


_UNDAMPED = 2.0  # times the least there is: at a bound nothing has been found


@dataclass(frozen=True)
class SecondOrder(Effect):
    """What a mass on a spring, an amplifier that overshoots and a mode of a part have alike."""

    needs_substeps: ClassVar[bool] = True
    rings: ClassVar[bool] = True

    frequency_hz: float
    damping_ratio: float

    @property
    def share(self) -> float:
        """Share of the output that passes through the second order [1]; the rest follows at once."""
        return 1.0

    @property
    def rate_share(self) -> float:
        """Share of its rate over w that is added to the output [1]."""
        return 0.0

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether it has a peak, and of its swing something is in the records.

        Beyond half the rate only a swing that is damped and lasts for more than a sample is: else it is a delay.
        """
        is_in_band = self.frequency_hz * step_s <= 0.5
        lasts = 2.0 * math.pi * self.damping_ratio * self.frequency_hz * step_s < 1.0
        # one that is never damped is no swing that anybody sampled, but an alternation of the noise
        lasts = lasts and self.damping_ratio > _UNDAMPED * self.parameter("damping_ratio").lower
        return self.damping_ratio < _FLAT and (is_in_band or lasts)

    def least_parts(self, effects: tuple[Effect, ...]) -> int:
        """Return many parts, also while the drive rests: what it swings by, elements and whatever is behind it follow.

        As many alone as before others, or another would be told for what only the parts gain.
        """
        return 1 if self.is_null() else _N_PARTS_RINGING

    def parts_of_turn(self, effects: tuple[Effect, ...], step_s: float, turn: float) -> int:
        """Return as many parts as let it turn by little in each."""
        n_parts = math.ceil(2.0 * math.pi * self.frequency_hz * step_s / turn)
        return max(1, min(n_parts, self.least_parts(effects)))

    def turn_at_swing(self, values: Array, steps_s: Array, least: float) -> Array:
        """Return how often a step is to be divided where it swings as freely as it does behind these values."""
        omega = 2.0 * math.pi * self.frequency_hz
        sigma, damped = self.damping_ratio * omega, omega * math.sqrt(1.0 - self.damping_ratio**2)
        position, velocity = np.empty(values.size), np.empty(values.size)
        run_second_order(self.initial_state(), omega, self.damping_ratio, values, steps_s, position, velocity)
        # beside the line on which it follows a line: what is left of the swing the step began with
        slope = np.diff(values, prepend=0.0) / steps_s
        off = position - (values - 2.0 * self.damping_ratio / omega * slope)
        size = np.hypot(off, (velocity - slope + sigma * off) / damped) * np.exp(np.minimum(sigma * steps_s, 1.0))
        size *= math.hypot(self.share, self.rate_share)
        return np.asarray(damped * steps_s * np.sqrt(size / (8.0 * least)))

    def initial_state(self) -> Array:
        """Return (output, its rate [1/s], input) at rest."""
        return np.zeros(3)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the response, in the unit of the values, shape (n_samples,)."""
        out, rate = np.empty(values.size), np.empty(values.size if self.rate_share != 0.0 else 0)
        omega = 2.0 * np.pi * self.frequency_hz
        run_second_order(state, omega, self.damping_ratio, values, steps_s, out, rate)
        if self.share != 1.0:
            out = values + self.share * (out - values)
        return out if self.rate_share == 0.0 else out + self.rate_share / omega * rate

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the response to each change of a displacement, (n_samples, n_changes)."""
        if self.stage is not Stage.MECHANICAL:
            return changes
        omega = 2.0 * math.pi * self.frequency_hz
        damped = omega * math.sqrt(1.0 - self.damping_ratio**2)
        pole = complex(-self.damping_ratio * omega, damped)
        # of both poles' modes, each the other's conjugate, the real part of twice the one
        gain = 1j * (self.share * omega * omega + self.rate_share * omega * pole) / (damped * pole)
        poles, gains = np.array([[pole.real, pole.imag]]), np.array([[gain.real, gain.imag]])
        return through_pairs(poles, gains, 1.0 - self.share, changes, steps_s)

    def response(self, frequency_hz: Array) -> ComplexArray:
        """Return 1 - p + (p w^2 + i q w v) / (w^2 - v^2 + 2 i d w v) [1] at frequencies [Hz], of the shares p and q."""
        part = frequency_hz / self.frequency_hz
        swing = 1.0 / (1.0 - part**2 + 2j * self.damping_ratio * part)
        return np.asarray(1.0 - self.share + (self.share + 1j * self.rate_share * part) * swing)

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        damping = self.damping_ratio
        return StepForm(
            constants=(
                ("omega", 2.0 * math.pi * self.frequency_hz),
                ("damping", damping),
                ("root", math.sqrt(1.0 - damping * damping)),
                ("share", self.share),
                ("rate_share", self.rate_share),
            ),
            state=(
                StateField("position", kind=FieldKind.WIDE, comment="output of the step before"),
                StateField("velocity", kind=FieldKind.WIDE, comment="its rate [1/s]"),
                StateField("before", comment="input of the step before"),
            ),
            coefficients=("decay", "cosine", "sine"),
            prepare=_prepare,
            forward=_swing,
        )


def _prepare(k: Fields, c: Fields, step_s: float) -> None:
    k.decay = math.exp(-c.damping * c.omega * step_s)
    k.cosine = math.cos(c.omega * c.root * step_s)
    k.sine = math.sin(c.omega * c.root * step_s)


def _swing(s: Fields, k: Fields, c: Fields, value: float, step_s: float) -> Number:
    # The loop of run_second_order, once.
    sigma = c.damping * c.omega
    damped = c.omega * c.root
    slope = (value - s.before) / step_s
    lag = 2.0 * c.damping / c.omega * slope
    p = s.position - (s.before - lag)
    q = (s.velocity - slope + sigma * p) / damped
    s.velocity = slope + k.decay * (-sigma * (p * k.cosine + q * k.sine) + damped * (q * k.cosine - p * k.sine))
    s.position = value - lag + k.decay * (p * k.cosine + q * k.sine)
    s.before = value
    return value + c.share * (s.position - value) + c.rate_share * s.velocity / c.omega

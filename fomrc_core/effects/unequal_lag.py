"""The voltage amplifier rises and falls at unequal speed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.course import Course
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.kernels import lag_weights
from fomrc_core.effects.base.lag import is_seen
from fomrc_core.effects.base.step_form import FieldKind, Fields, Number, StateField, StepForm, ramp_in_step

_LAGS = (0.15, 1.0, 8.0, 60.0)  # of trials, in samples: a lag of a part of a sample shows as well


@compiled
def _run_unequal(state: Array, rising_s: float, falling_s: float, values: Array, steps_s: Array, out: Array) -> None:
    # The gap e = input - output obeys e' = slope - e / T, T that of rising for e > 0: from e0 it goes to slope T
    # exponentially. It changes sign at most once in a step, where slope and e0 are of opposite sign; then the other
    # T holds for the rest of it.
    output, before = state[0], state[1]
    for k in range(values.size):
        step, now = steps_s[k], values[k]
        slope = (now - before) / step
        gap = before - output
        left = step
        is_rising = gap > 0.0 or (gap == 0.0 and slope > 0.0)
        time_constant_s = rising_s if is_rising else falling_s
        if gap * slope < 0.0:
            until_s = time_constant_s * math.log1p(-gap / (slope * time_constant_s))
            if until_s < step:
                left, gap = step - until_s, 0.0
                time_constant_s = falling_s if is_rising else rising_s
        decay, ramp = lag_weights(left / time_constant_s)
        output = now - (decay * gap + (1.0 - ramp) * slope * left)
        before = now
        out[k] = output
    state[0], state[1] = output, before


def _follow(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    # The loop of _run_unequal, once.
    slope = (value - s.before) / step_s
    gap = s.before - s.output
    left = step_s
    is_rising = 1 if gap > 0.0 or (gap == 0.0 and slope > 0.0) else 0
    time_constant_s = c.rising_s if is_rising == 1 else c.falling_s
    if gap * slope < 0.0:
        until_s = time_constant_s * math.log1p(-gap / (slope * time_constant_s))
        if until_s < step_s:
            left = step_s - until_s
            gap = 0.0
            time_constant_s = c.falling_s if is_rising == 1 else c.rising_s
    ratio = left / time_constant_s
    s.output = value - (math.exp(-ratio) * gap + (1.0 - ramp_in_step(ratio)) * slope * left)
    s.before = value
    return s.output


def _lead(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    change = value - s.before
    s.before = value
    return value + (c.rising_s if change > 0.0 else c.falling_s) * change / step_s


@dataclass(frozen=True)
class UnequalLag(Effect):
    """First-order lag of the drive with one time constant while it rises and another while it falls.

    Exact for a drive linear between samples.
    """

    name: ClassVar[str] = "unequal_lag"
    stage: ClassVar[Stage] = Stage.DRIVE
    order: ClassVar[float] = 24.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("rising_s", "s", 1e-10, 1e7, is_log=True, description="time constant while the output rises"),
        Parameter("falling_s", "s", 1e-10, 1e7, is_log=True, description="time constant while the output falls"),
    )
    main_parameter: ClassVar[str] = "rising_s"
    generalizes: ClassVar[str] = "amplifier_bandwidth"
    meaning: ClassVar[str] = "The amplifier sources and sinks its current through unlike stages: one way is slower."
    signature: ClassVar[str] = "residual follows the rate of the drive, by an unequal share up and down"
    experiment: ClassVar[str] = "steps up and down between the same two voltages, sampled fast"
    inverse_note: ClassVar[str] = "inverted: the voltage leads by the time constant of its direction times its rate"
    needs_substeps: ClassVar[bool] = True
    can_invert: ClassVar[bool] = True

    rising_s: float
    falling_s: float

    def special_case(self) -> dict[str, float]:
        """Return the cutoff of an amplifier that lags by their geometric mean both ways."""
        return {"cutoff_hz": 1.0 / (2.0 * math.pi * math.sqrt(self.rising_s * self.falling_s))}

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether it is more than samples so far apart leave open."""
        return is_seen(max(self.rising_s, self.falling_s), step_s)

    def initial_state(self) -> Array:
        """Return (output, input) [V] of the step before, at rest."""
        return np.zeros(2)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the amplifier's output [V], shape (n_samples,)."""
        out = np.empty(values.size)
        _run_unequal(state, self.rising_s, self.falling_s, values, steps_s, out)
        return out

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the drive [V] that gives the wanted output; backward difference, so it cannot ring."""
        before = np.concatenate((state[:1], values[:-1]))
        state[0] = state[1] = values[-1]
        change = values - before
        return values + np.where(change > 0.0, self.rising_s, self.falling_s) * change / steps_s

    def undo_known(self, wanted: Array, course: Course) -> Array:
        """Return the drive [V] that gives the wanted output, by its rate at the samples themselves."""
        rate = course.rate(wanted)
        return wanted + np.where(rate > 0.0, self.rising_s, self.falling_s) * rate

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=(("rising_s", self.rising_s), ("falling_s", self.falling_s)),
            state=(
                StateField("output", kind=FieldKind.WIDE, comment="of the step before [V]"),
                StateField("before", comment="its input [V]"),
            ),
            forward=_follow,
            inverse=_lead,
            helpers=(ramp_in_step,),
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[UnequalLag]:
        """Return lags from a part of a sample to many, three times as long one way as the other."""
        trials = [(n, ratio) for n in _LAGS for ratio in (1.0 / 3.0, 3.0)]
        step_s = evidence.sample_period_s
        return cls.proposed({"rising_s": n * step_s, "falling_s": n * ratio * step_s} for n, ratio in trials)

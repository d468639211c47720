"""Beside creep, one relaxation with a time constant of its own."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.kernels import lag_shares, run_lag
from fomrc_core.effects.base.linear_columns import through_modes
from fomrc_core.effects.base.step_form import FieldKind, Fields, Number, StateField, StepForm, lag_ramp


def _prepare(k: Fields, c: Fields, step_s: float) -> None:
    k.gone = -math.expm1(-step_s / c.time_constant_s)
    k.ramp = lag_ramp(step_s / c.time_constant_s)


def _relax(s: Fields, k: Fields, c: Fields, value: float) -> Number:
    s.late = s.late + (k.ramp * value + (k.gone - k.ramp) * s.before - k.gone * s.late)
    s.before = value
    return value + c.amplitude * s.late


def _relaxed(s: Fields, k: Fields, c: Fields, value: float) -> Number:
    known = s.late + ((k.gone - k.ramp) * s.before - k.gone * s.late)
    s.before = (value - c.amplitude * known) / (1.0 + c.amplitude * k.ramp)
    s.late = known + k.ramp * s.before
    return s.before


_SHORTEST_SAMPLES = 5.0  # a bend of fewer samples is no bend
_LONGEST = 0.7  # of the record


@dataclass(frozen=True)
class SlowRelaxation(Effect):
    """Displacement plus a share of itself that arrives with one time constant (a Zener element)."""

    name: ClassVar[str] = "slow_relaxation"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 10.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("amplitude", "1", -0.9, 10.0, description="share of the displacement that arrives late"),
        Parameter("time_constant_s", "s", 1e-9, 1e9, is_log=True, description="its time constant"),
    )
    main_parameter: ClassVar[str] = "amplitude"
    meaning: ClassVar[str] = "An adhesive layer, clamp or load cell yields slowly, with one time constant."
    signature: ClassVar[str] = "after each step the residual bends once in log time, where creep is straight"
    experiment: ClassVar[str] = "one large step held for ten of its time constants"
    inverse_note: ClassVar[str] = "inverted exactly"
    bends_to_much: ClassVar[bool] = True
    can_invert: ClassVar[bool] = True
    linear_parameters: ClassVar[tuple[str, ...]] = ("amplitude",)
    one_more_of: ClassVar[tuple[str, ...]] = ("creep_law",)  # a spectrum of relaxations holds any one more

    amplitude: float
    time_constant_s: float

    def initial_state(self) -> Array:
        """Return (late part, input) [um] of the step before, at rest."""
        return np.zeros(2)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement with the late part [um], shape (n_samples,)."""
        late = np.empty(values.size)
        run_lag(state, self.time_constant_s, values, steps_s, late)
        return values + self.amplitude * late

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement [um] before this effect, exactly."""
        out = np.empty(values.size)
        _invert_relaxation(state, self.amplitude, self.time_constant_s, values, steps_s, out)
        return out

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes with their late parts, (n_samples, n_changes)."""
        return through_modes(np.array([1.0 / self.time_constant_s]), np.array([self.amplitude]), 1.0, changes, steps_s)

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether the relaxation adds to the displacement and bends within the record, over some samples.

        One that takes away mends what another cause did, one of few samples is a lag, a longer one is a drift.
        """
        is_seen = _SHORTEST_SAMPLES * step_s <= self.time_constant_s <= _LONGEST * duration_s
        return self.amplitude > 0.0 and is_seen

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=(("amplitude", self.amplitude), ("time_constant_s", self.time_constant_s)),
            state=(
                StateField("late", kind=FieldKind.WIDE, comment="what has arrived late by the step before [um]"),
                StateField("before", comment="displacement of the step before [um]"),
            ),
            coefficients=("gone", "ramp"),
            prepare=_prepare,
            forward=_relax,
            inverse=_relaxed,
            helpers=(lag_ramp,),
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[SlowRelaxation]:
        """Return time constants from some samples to the length of the record."""
        shortest, longest = 2.0 * _SHORTEST_SAMPLES * evidence.sample_period_s, evidence.duration_s
        times_s = np.geomspace(shortest, max(longest, shortest), 8)
        return cls.proposed({"amplitude": 0.01, "time_constant_s": float(t)} for t in times_s)


@compiled
def _invert_relaxation(
    state: Array, amplitude: float, time_constant_s: float, values: Array, steps_s: Array, out: Array
) -> None:
    late, before = state[0], state[1]
    for k in range(values.size):
        gone, ramp = lag_shares(steps_s[k] / time_constant_s)
        known = late + ((gone - ramp) * before - gone * late)
        out[k] = (values[k] - amplitude * known) / (1.0 + amplitude * ramp)
        late = known + ramp * out[k]
        before = out[k]
    state[0], state[1] = late, before

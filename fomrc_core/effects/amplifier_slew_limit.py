"""The voltage amplifier cannot change faster than its current allows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.step_form import FieldKind, Fields, Number, StateField, StepForm

_NEARLY = 0.9  # of the fastest rate: a limit that acts at all
_LEAST_SHARE = 0.02  # of the fastest rate: a drive of triangles alone is to be limited, too
_N_TRIALS = 8  # a factor of two or so apart: within reach of a fit


@compiled
def _run_slew(state: Array, slew_v_per_s: float, values: Array, steps_s: Array, out: Array) -> None:
    # Exact for an input linear over the step: the output runs at the limit until it meets the input, then follows
    # it, or, where the input is the faster one, runs on behind it.
    output, before = state[0], state[1]
    for k in range(values.size):
        step = steps_s[k]
        slope = (values[k] - before) / step
        gap = before - output
        left = step
        if gap != 0.0:
            heading = slew_v_per_s if gap > 0.0 else -slew_v_per_s
            closing = heading - slope
            meets = closing * gap > 0.0 and gap / closing < step
            left = step - gap / closing if meets else 0.0
            output = before + slope * (step - left) if meets else output + heading * step
        if left > 0.0:
            if abs(slope) <= slew_v_per_s:
                output = values[k]
            else:
                output += (slew_v_per_s if slope > 0.0 else -slew_v_per_s) * left
        before = values[k]
        out[k] = output
    state[0], state[1] = output, before


def _slew(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    # The loop of _run_slew, once.
    slope = (value - s.before) / step_s
    gap = s.before - s.output
    left = step_s
    if gap != 0.0:
        heading = c.slew_v_per_s if gap > 0.0 else -c.slew_v_per_s
        closing = heading - slope
        left = 0.0
        if closing * gap > 0.0 and gap / closing < step_s:
            left = step_s - gap / closing
            s.output = s.before + slope * (step_s - left)
        else:
            s.output = s.output + heading * step_s
    if left > 0.0:
        if abs(slope) <= c.slew_v_per_s:
            s.output = value
        else:
            s.output = s.output + (c.slew_v_per_s if slope > 0.0 else -c.slew_v_per_s) * left
    s.before = value
    return s.output


@dataclass(frozen=True)
class AmplifierSlewLimit(Effect):
    """Rate limit on the drive."""

    name: ClassVar[str] = "amplifier_slew_limit"
    stage: ClassVar[Stage] = Stage.DRIVE
    order: ClassVar[float] = 10.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("slew_v_per_s", "V/s", 1e-9, 1e15, is_log=True, description="largest rate of the output"),
    )
    main_parameter: ClassVar[str] = "slew_v_per_s"
    meaning: ClassVar[str] = "The amplifier's current limit bounds how fast it can charge the actuator."
    signature: ClassVar[str] = "residual only where the drive is faster than the limit, growing with the step's size"
    experiment: ClassVar[str] = "steps of several sizes: the time to arrive is proportional to the size"
    inverse_note: ClassVar[str] = "no inverse: what is faster than the limit cannot be had; slow the target"
    needs_substeps: ClassVar[bool] = True
    size_exponent: ClassVar[float] = -1.0

    slew_v_per_s: float

    def initial_state(self) -> Array:
        """Return (output, input) [V] of the step before, at rest."""
        return np.zeros(2)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the limited drive [V], shape (n_samples,)."""
        out = np.empty(values.size)
        _run_slew(state, self.slew_v_per_s, values, steps_s, out)
        return out

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=(("slew_v_per_s", self.slew_v_per_s),),
            state=(
                StateField("output", kind=FieldKind.WIDE, comment="of the step before [V]"),
                StateField("before", comment="its input [V]"),
            ),
            forward=_slew,
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[AmplifierSlewLimit]:
        """Return limits from just below the drive's fastest rate, of its steps, down to its usual rate.

        The faster the sampling, the farther above what an amplifier can do is a step from one sample to the next.
        """
        rates = np.concatenate([np.abs(np.diff(r.voltage_v) / r.steps_s[1:]) for r in evidence.records])
        moving = rates[rates > 0.0]
        if moving.size == 0:
            return []
        fastest = float(np.max(moving))
        slowest = min(float(np.median(moving)), _LEAST_SHARE * fastest)
        return cls.proposed(
            {"slew_v_per_s": float(limit)} for limit in np.geomspace(_NEARLY * fastest, slowest, _N_TRIALS)
        )

"""The gain of the actuator changes while it works."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.kernels import elapsed_times
from fomrc_core.effects.base.step_form import CLOCK_FIELDS, Fields, Number, StepForm, clock_after


def _drift(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    s.elapsed = clock_after(s.elapsed, s.started, step_s)
    s.started = 1
    return value * (1.0 + c.per_s * s.elapsed)


@dataclass(frozen=True)
class GainDrift(Effect):
    """Displacement times one plus a rate times the time since the start."""

    name: ClassVar[str] = "gain_drift"
    stage: ClassVar[Stage] = Stage.SENSED
    order: ClassVar[float] = 40.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("per_s", "1/s", -1e9, 1e9, description="relative change of the gain per second"),
    )
    main_parameter: ClassVar[str] = "per_s"
    meaning: ClassVar[str] = "The ceramic warms under cycling, or the sensor's reference drifts: the stroke changes."
    signature: ClassVar[str] = "residual is the displacement itself times the time since the start"
    experiment: ClassVar[str] = "the same triangle again after minutes of work"
    inverse_note: ClassVar[str] = "not inverted: the drift is that of the record and does not go on for ever"
    linear_parameters: ClassVar[tuple[str, ...]] = ("per_s",)

    per_s: float

    def initial_state(self) -> Array:
        """Return (elapsed [s], started)."""
        return np.zeros(2)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement [um] with the changed gain, shape (n_samples,)."""
        t = np.empty(steps_s.size)
        elapsed_times(state, steps_s, t)
        return values * (1.0 + self.per_s * t)

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes times the gain of their time."""
        t = np.empty(steps_s.size)
        elapsed_times(self.initial_state(), steps_s, t)
        return changes * (1.0 + self.per_s * t)[:, None]

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(constants=(("per_s", self.per_s),), state=CLOCK_FIELDS, forward=_drift, helpers=(clock_after,))

    @classmethod
    def screening(cls, evidence: Evidence) -> list[GainDrift]:
        """Return a drift of a thousandth over the record."""
        return cls.proposed([{"per_s": 1e-3 / evidence.duration_s}])

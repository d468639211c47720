"""The other axis of the stage moves this one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.covariates import Covariate
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.step_form import Fields, Number, StepForm


def _add(c: Fields, value: float, covariate: float, is_known: int) -> Number:
    return value + c.gain * covariate if is_known else value


def _take(c: Fields, value: float, covariate: float, is_known: int) -> Number:
    return value - c.gain * covariate if is_known else value


@dataclass(frozen=True)
class CrossAxis(Effect):
    """A share of the second axis's recorded signal added to the displacement."""

    name: ClassVar[str] = "cross_axis"
    stage: ClassVar[Stage] = Stage.SENSED
    order: ClassVar[float] = 20.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("gain", "um/um or um/V", -1e9, 1e9, description="displacement per unit of the second axis"),
    )
    covariate: ClassVar[Covariate | None] = Covariate.SECOND_AXIS
    main_parameter: ClassVar[str] = "gain"
    meaning: ClassVar[str] = "Guide and sensor are not square to each other, so the other axis leaks into this one."
    signature: ClassVar[str] = "residual follows the second axis, also while this axis rests"
    experiment: ClassVar[str] = "move the second axis while this one rests"
    inverse_note: ClassVar[str] = "inverted where the second axis is known while running"
    can_invert: ClassVar[bool] = True
    linear_parameters: ClassVar[tuple[str, ...]] = ("gain",)

    gain: float

    def initial_state(self) -> Array:
        """Return an empty state: the coupling has no memory."""
        return np.zeros(0)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement [um] with the share of the second axis, shape (n_samples,)."""
        return values if covariate is None else values + self.gain * covariate

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement [um] without the share of the second axis."""
        return values if covariate is None else values - self.gain * covariate

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(constants=(("gain", self.gain),), forward=_add, inverse=_take)

    @classmethod
    def screening(cls, evidence: Evidence) -> list[CrossAxis]:
        """Return a gain of a thousandth of the stroke over the second axis's range, where one was recorded."""
        stroke_per_unit = evidence.stroke_per(Covariate.SECOND_AXIS)
        return cls.proposed([{"gain": 1e-3 * stroke_per_unit}]) if stroke_per_unit > 0.0 else []

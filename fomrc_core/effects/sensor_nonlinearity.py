"""The sensor's reading is not in proportion to the displacement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.step_form import Fields, Number, StepForm


def _read(c: Fields, value: float) -> Number:
    return value + value * value * (c.quadratic_per_um + c.cubic_per_um2 * value)


@dataclass(frozen=True)
class SensorNonlinearity(Effect):
    """Quadratic and cubic error of the reading."""

    name: ClassVar[str] = "sensor_nonlinearity"
    stage: ClassVar[Stage] = Stage.SENSED
    order: ClassVar[float] = 50.0
    is_of_sensor: ClassVar[bool] = True
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("quadratic_per_um", "1/um", -1e9, 1e9, description="quadratic error"),
        Parameter("cubic_per_um2", "1/um^2", -1e18, 1e18, description="cubic error"),
    )
    main_parameter: ClassVar[str] = "quadratic_per_um"
    meaning: ClassVar[str] = "A capacitive or strain sensor reads a curved scale."
    signature: ClassVar[str] = "residual is one curve of the displacement, the same on the way up and down"
    experiment: ClassVar[str] = "a slow triangle over the whole stroke against a reference"
    inverse_note: ClassVar[str] = "not inverted: the reading errs, not the position"
    slope_depends_on_input: ClassVar[bool] = True
    linear_parameters: ClassVar[tuple[str, ...]] = ("quadratic_per_um", "cubic_per_um2")

    quadratic_per_um: float = 0.0
    cubic_per_um2: float = 0.0

    def initial_state(self) -> Array:
        """Return an empty state: the scale has no memory."""
        return np.zeros(0)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the reading [um], shape (n_samples,)."""
        return values + values * values * (self.quadratic_per_um + self.cubic_per_um2 * values)

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes times the slope of the scale where the displacement stands."""
        if values is None:
            return changes
        slope = 1.0 + values * (2.0 * self.quadratic_per_um + 3.0 * self.cubic_per_um2 * values)
        return changes * slope[:, None]

    def free_names(self) -> tuple[str, ...]:
        """Return both errors: a curved scale seldom has only one of them."""
        return ("quadratic_per_um", "cubic_per_um2")

    def scale_of(self, name: str, value: float) -> float:
        """Return a unit for an error that stands at zero."""
        return abs(value) if value != 0.0 else 1e-3

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        constants = (("quadratic_per_um", self.quadratic_per_um), ("cubic_per_um2", self.cubic_per_um2))
        return StepForm(constants=constants, forward=_read)

    @classmethod
    def screening(cls, evidence: Evidence) -> list[SensorNonlinearity]:
        """Return both errors at a thousandth of the stroke, alone and together."""
        stroke = evidence.stroke_um
        if not stroke > 0.0:
            return []
        q, c = 1e-3 / stroke, 1e-3 / stroke**2
        return cls.proposed(
            [{"quadratic_per_um": q}, {"cubic_per_um2": c}, {"quadratic_per_um": q, "cubic_per_um2": -c}]
        )

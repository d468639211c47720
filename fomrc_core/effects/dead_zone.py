"""The drive does nothing until it has left a band around zero."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.step_form import Fields, Number, StepForm


def _pass(c: Fields, value: float) -> Number:
    return value - min(max(value, -c.half_width_v), c.half_width_v)


# Of the half width: less is what rounding leaves of zero volts, on which no jump must hang.
_NOTHING = 1e-10


def _jump(c: Fields, value: float) -> Number:
    if value > c.nothing_v:
        return value + c.half_width_v
    if value < -c.nothing_v:
        return value - c.half_width_v
    return value


@dataclass(frozen=True)
class DeadZone(Effect):
    """Symmetric dead zone about zero volts."""

    name: ClassVar[str] = "dead_zone"
    stage: ClassVar[Stage] = Stage.DRIVE
    order: ClassVar[float] = 40.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("half_width_v", "V", 0.0, 1e6, description="half width of the band"),
    )
    main_parameter: ClassVar[str] = "half_width_v"
    meaning: ClassVar[str] = "An output stage with crossover distortion passes nothing near zero volts."
    signature: ClassVar[str] = "displacement rests while the drive crosses zero; elsewhere it is short by a constant"
    experiment: ClassVar[str] = "a slow triangle of small amplitude about zero volts"
    inverse_note: ClassVar[str] = "inverted: the voltage jumps across the band"
    needs_substeps: ClassVar[bool] = True
    can_invert: ClassVar[bool] = True
    linear_parameters: ClassVar[tuple[str, ...]] = ("half_width_v",)

    half_width_v: float

    def initial_state(self) -> Array:
        """Return an empty state: the dead zone has no memory."""
        return np.zeros(0)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return what passes [V], shape (n_samples,)."""
        return values - np.clip(values, -self.half_width_v, self.half_width_v)

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the drive [V] that passes the wanted voltage."""
        is_beyond = np.abs(values) > _NOTHING * self.half_width_v
        return np.asarray(values + np.where(is_beyond, np.sign(values), 0.0) * self.half_width_v)

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        constants = (("half_width_v", self.half_width_v), ("nothing_v", _NOTHING * self.half_width_v))
        return StepForm(constants=constants, forward=_pass, inverse=_jump, jumps=("inverse",))

    @classmethod
    def screening(cls, evidence: Evidence) -> list[DeadZone]:
        """Return widths of some thousandths to some hundredths of the range."""
        span = evidence.largest_v - evidence.smallest_v
        return cls.proposed({"half_width_v": span * share} for share in (0.003, 0.01, 0.04))

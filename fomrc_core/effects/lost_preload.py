"""Below one displacement the stage is no longer pressed on, and follows otherwise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.step_form import Fields, Number, StepForm

_BEHIND_MASSES = 24.0  # of the order among mechanics: modes stand before it, a sensor's filter behind


def _bend(c: Fields, value: float) -> Number:
    return value + c.slope_change * (min(value - c.kink_um, 0.0) - min(-c.kink_um, 0.0))


def _unbend(c: Fields, value: float) -> Number:
    bent = value + c.slope_change * min(-c.kink_um, 0.0)
    return bent - min(bent - c.kink_um, 0.0) * (c.slope_change / (1.0 + c.slope_change))


@dataclass(frozen=True)
class LostPreload(Effect):
    """A kink: below one displacement the stage moves by another share of what the actuator does.

    The joint that gives way may stand before the masses that ring or behind them: then it bends what rings as well.
    Displacement is counted from rest before and behind it: a delay or a mass that follows begins at rest as well.
    """

    name: ClassVar[str] = "lost_preload"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 12.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("kink_um", "um", -1e6, 1e6, description="displacement of the kink"),
        Parameter("slope_change", "1", -0.999, 10.0, description="relative change of the slope below it"),
        Parameter("behind_masses", "1", 0.0, 1.0, description="1: the joint is behind what rings; 0: before it"),
    )
    main_parameter: ClassVar[str] = "kink_um"
    held_parameters: ClassVar[tuple[str, ...]] = ("behind_masses",)
    linear_parameters: ClassVar[tuple[str, ...]] = ("slope_change",)
    meaning: ClassVar[str] = "Spring or glue no longer press the stage on: below one displacement a joint gives way."
    signature: ClassVar[str] = "residual is one broken line of the displacement, the same on the way up and down"
    experiment: ClassVar[str] = (
        "a slow triangle over the whole stroke, then with more preload: the kink moves or goes; a contact that is made "
        "stands where the other part does"
    )
    inverse_note: ClassVar[str] = "inverted exactly"
    can_invert: ClassVar[bool] = True
    slope_depends_on_input: ClassVar[bool] = True

    kink_um: float
    slope_change: float
    behind_masses: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "behind_masses", float(round(self.behind_masses)))

    @property
    def place(self) -> float:
        """Return where among the mechanics it acts: before modes, or behind them and before the sensor."""
        return _BEHIND_MASSES if self.behind_masses else self.order

    def form(self) -> tuple[str, ...]:
        """Return the parameters a fit moves, and where the joint stands."""
        return (*super().form(), f"{self.behind_masses:.0f}")

    def other_forms(self) -> list[LostPreload]:
        """Return it on the other side of the masses."""
        return [replace(self, behind_masses=1.0 - self.behind_masses)]

    def initial_state(self) -> Array:
        """Return an empty state: the kink has no memory."""
        return np.zeros(0)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement of the stage [um], shape (n_samples,)."""
        return np.asarray(values + self.slope_change * (np.minimum(values - self.kink_um, 0.0) - self._below_at_rest))

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement of the actuator [um], exactly."""
        bent = values + self.slope_change * self._below_at_rest
        below = np.minimum(bent - self.kink_um, 0.0)
        return np.asarray(bent - below * (self.slope_change / (1.0 + self.slope_change)))

    @property
    def _below_at_rest(self) -> float:
        return min(-self.kink_um, 0.0)

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes times the slope where the displacement stands."""
        if values is None:
            return changes
        return np.asarray(changes * (1.0 + self.slope_change * (values < self.kink_um))[:, None])

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return the change of slope data would just have shown at this kink."""
        return {"slope_change": abs(self.slope_change) * factor}

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=(("kink_um", self.kink_um), ("slope_change", self.slope_change)), forward=_bend, inverse=_unbend
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[LostPreload]:
        """Return small kinks across the stroke."""
        low = min(float(np.min(record.predicted_um)) for record in evidence.records)
        return cls.proposed(
            {"kink_um": low + share * evidence.stroke_um, "slope_change": 0.01}
            for share in (0.08, 0.2, 0.35, 0.5, 0.65, 0.8, 0.92)
        )

"""The voltage amplifier ends at its supply rails."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.step_form import Fields, Number, StepForm
from fomrc_core.errors import ParameterError

_NO_LIMIT_V = 1e6  # beyond any amplifier: a side that does not act


def _clamp(c: Fields, value: float) -> Number:
    return min(max(value, c.low_v), c.high_v)


@dataclass(frozen=True)
class AmplifierSaturation(Effect):
    """Clamp on the drive; a side that does not act stands at +-1e6 V."""

    name: ClassVar[str] = "amplifier_saturation"
    stage: ClassVar[Stage] = Stage.DRIVE
    order: ClassVar[float] = 30.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("low_v", "V", -_NO_LIMIT_V, _NO_LIMIT_V, description="lowest output"),
        Parameter("high_v", "V", -_NO_LIMIT_V, _NO_LIMIT_V, description="highest output"),
    )
    main_parameter: ClassVar[str] = "high_v"
    meaning: ClassVar[str] = "The amplifier reaches its supply and holds there while the command goes on."
    signature: ClassVar[str] = "residual only beyond one voltage, flat displacement there"
    experiment: ClassVar[str] = "a slow triangle over the whole range, then one over nine tenths of it"
    inverse_note: ClassVar[str] = "no inverse: displacement beyond the rails cannot be had"
    needs_substeps: ClassVar[bool] = True

    low_v: float = -_NO_LIMIT_V
    high_v: float = _NO_LIMIT_V

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.low_v < self.high_v:
            raise ParameterError(
                "low_v is not below high_v", where=self.name, value=(self.low_v, self.high_v), allowed="low_v < high_v"
            )

    def initial_state(self) -> Array:
        """Return an empty state: the clamp has no memory."""
        return np.zeros(0)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the clamped drive [V], shape (n_samples,)."""
        return np.clip(values, self.low_v, self.high_v)

    def is_null(self) -> bool:
        """Return whether neither side acts."""
        return not self.free_names()

    def free_names(self) -> tuple[str, ...]:
        """Return the sides that act."""
        return tuple(name for name in ("low_v", "high_v") if abs(getattr(self, name)) < _NO_LIMIT_V)

    def scale_of(self, name: str, value: float) -> float:
        """Return a tenth of the range as the unit of a limit, which may stand near zero."""
        return 0.1 * (self.high_v - self.low_v if abs(self.high_v - self.low_v) < _NO_LIMIT_V else max(abs(value), 1.0))

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return nothing: what shows is the way beyond a limit, not the limit."""
        return {}

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(constants=(("low_v", self.low_v), ("high_v", self.high_v)), forward=_clamp)

    @classmethod
    def screening(cls, evidence: Evidence) -> list[AmplifierSaturation]:
        """Return clamps a little inside the range of the drive, on either side and on both."""
        low, high = evidence.smallest_v, evidence.largest_v
        trials: list[dict[str, float]] = []
        for share in (0.02, 0.06, 0.15):
            rails = {"low_v": low + share * (high - low), "high_v": high - share * (high - low)}
            trials += [{"high_v": rails["high_v"]}, {"low_v": rails["low_v"]}, rails]
        return cls.proposed(trials)

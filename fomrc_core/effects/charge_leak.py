"""Charge leaks off the ceramic, and with it the displacement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.linear_modes import modes_at_rest, modes_form, run_modes, undo_modes
from fomrc_core.effects.base.step_form import StepForm

_SHORTEST_SAMPLES = 5.0  # leaks away faster: it never was there


@dataclass(frozen=True)
class ChargeLeak(Effect):
    """High-pass of the drive: what is held leaks away with one time constant, exact between samples."""

    name: ClassVar[str] = "charge_leak"
    stage: ClassVar[Stage] = Stage.DRIVE
    order: ClassVar[float] = 50.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("time_constant_s", "s", 1e-10, 1e12, is_log=True, description="resistance times capacitance"),
    )
    main_parameter: ClassVar[str] = "time_constant_s"
    meaning: ClassVar[str] = "A charge amplifier, or a ceramic left to itself, loses its charge through what insulates."
    signature: ClassVar[str] = "residual goes back towards zero volts in every hold, the more the longer it lasts"
    experiment: ClassVar[str] = "a step held for some time constants: creep goes on the way of the step, a leak back"
    inverse_note: ClassVar[str] = "inverted exactly: the voltage grows for as long as a position is held"
    can_invert: ClassVar[bool] = True
    size_exponent: ClassVar[float] = -1.0

    time_constant_s: float

    def initial_state(self) -> Array:
        """Return (drive of the step before, what has leaked) [V], at rest."""
        return modes_at_rest(1)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return what is left of the drive [V], shape (n_samples,)."""
        out = np.empty(values.size)
        run_modes(state, np.array([1.0 / self.time_constant_s]), np.array([-1.0]), 1.0, values, steps_s, out)
        return out

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the drive [V] of which the wanted voltage is left, exactly."""
        out = np.empty(values.size)
        undo_modes(state, np.array([1.0 / self.time_constant_s]), np.array([-1.0]), 1.0, values, steps_s, out)
        return out

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether the leak leaves the drive some samples to act in."""
        return self.time_constant_s >= _SHORTEST_SAMPLES * step_s

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        rates = np.array([1.0 / self.time_constant_s])
        return modes_form(rates, np.array([-1.0]), 1.0, is_inverted=True)

    @classmethod
    def screening(cls, evidence: Evidence) -> list[ChargeLeak]:
        """Return leaks from a hundredth of the record to some records long."""
        return cls.proposed({"time_constant_s": share * evidence.duration_s} for share in (0.01, 0.1, 1.0, 10.0))

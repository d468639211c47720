"""The voltage amplifier is of second order and overshoots."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.ringing import ringing_peaks_hz
from fomrc_core.effects.base.second_order import run_second_order, second_order_form
from fomrc_core.effects.base.step_form import StepForm


@dataclass(frozen=True)
class DriveResonance(Effect):
    """Second-order response of the drive, exact for a drive linear between samples."""

    name: ClassVar[str] = "drive_resonance"
    stage: ClassVar[Stage] = Stage.DRIVE
    order: ClassVar[float] = 22.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("frequency_hz", "Hz", 1e-7, 1e9, is_log=True, description="undamped natural frequency"),
        Parameter("damping_ratio", "1", 1e-3, 0.999, is_log=True, description="damping ratio"),
    )
    main_parameter: ClassVar[str] = "frequency_hz"
    meaning: ClassVar[str] = "Amplifier and capacitive actuator swing together: the voltage overshoots each step."
    signature: ClassVar[str] = (
        "residual swings after steps; where the voltage overshoots hysteresis keeps the overshoot, unlike with a mass"
    )
    experiment: ClassVar[str] = (
        "record the voltage at the ceramic beside the command; or small steps at two mean voltages: an amplifier rings "
        "at both alike, and a mass loaded by a known weight rings slower"
    )
    inverse_note: ClassVar[str] = "not inverted: it takes the second derivative of the voltage; use smooth targets"
    needs_substeps: ClassVar[bool] = True
    rings: ClassVar[bool] = True
    size_exponent: ClassVar[float] = -0.5

    frequency_hz: float
    damping_ratio: float

    def initial_state(self) -> Array:
        """Return (output [V], its rate [V/s], input [V]) at rest."""
        return np.zeros(3)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the amplifier's output [V], shape (n_samples,)."""
        out = np.empty(values.size)
        run_second_order(state, 2.0 * np.pi * self.frequency_hz, self.damping_ratio, values, steps_s, out)
        return out

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return second_order_form(2.0 * math.pi * self.frequency_hz, self.damping_ratio)

    @classmethod
    def screening(cls, evidence: Evidence) -> list[DriveResonance]:
        """Return well damped frequencies over the band, and a lightly damped one where the residual rings most."""
        rate = 1.0 / evidence.sample_period_s
        trials = [(rate * share, 0.5) for share in (0.01, 0.04, 0.12, 0.35)]
        trials += [(peak_hz, 0.1) for peak_hz in ringing_peaks_hz(evidence)[:1]]
        return cls.proposed({"frequency_hz": f, "damping_ratio": damping} for f, damping in trials)

"""The voltage amplifier is of second order and overshoots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fomrc_core.effects.base.effect import Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.ringing import ringing_peaks_hz
from fomrc_core.effects.base.second_order import SecondOrder


@dataclass(frozen=True)
class DriveResonance(SecondOrder):
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
    size_exponent: ClassVar[float] = -0.5

    def kin(self) -> dict[str, dict[str, float]]:
        """Return the mass that rings alike: but for the loops of what it drives nothing tells the two apart."""
        return {"mechanical_resonance": {"frequency_hz": self.frequency_hz, "damping_ratio": self.damping_ratio}}

    @classmethod
    def screening(cls, evidence: Evidence) -> list[DriveResonance]:
        """Return well damped frequencies over the band, and a lightly damped one where the residual rings most."""
        rate = 1.0 / evidence.sample_period_s
        trials = [(rate * share, 0.5) for share in (0.01, 0.04, 0.12, 0.35)]
        trials += [(peak_hz, 0.1) for peak_hz in ringing_peaks_hz(evidence)[:1]]
        return cls.proposed({"frequency_hz": f, "damping_ratio": damping} for f, damping in trials)

"""A part of the stage has a mode of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fomrc_core.effects.base.effect import Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.ringing import ringing_peaks_hz
from fomrc_core.effects.base.second_order import SecondOrder

_HALF = 0.5  # of the motion: a mode that takes more of it is the stage's first, ``mechanical_resonance``


@dataclass(frozen=True)
class SecondMode(SecondOrder):
    """A share of the displacement that passes through a mode, (1 - p) x + p x_mode, beside what follows at once.

    In the frequency response a pair of a resonance and an antiresonance, at f and f / sqrt(1 - p).
    """

    name: ClassVar[str] = "second_mode"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 22.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("frequency_hz", "Hz", 1e-7, 1e9, is_log=True, description="undamped natural frequency"),
        Parameter("damping_ratio", "1", 1e-4, 0.999, is_log=True, description="damping ratio"),
        Parameter("participation", "1", -_HALF, _HALF, description="share of the motion that is the mode's"),
    )
    main_parameter: ClassVar[str] = "frequency_hz"
    linear_parameters: ClassVar[tuple[str, ...]] = ("participation",)
    meaning: ClassVar[str] = "A bracket, a lever or the base beneath the stage rings beside the stage itself."
    signature: ClassVar[str] = "residual rings at a frequency at which the stage as a whole still follows"
    experiment: ClassVar[str] = (
        "a multisine through the frequency: a mode of a part shows a resonance and an antiresonance beside it, the "
        "stage's own a resonance beyond which it no longer follows"
    )
    inverse_note: ClassVar[str] = "not inverted: it takes the second derivative of the target; use smooth targets"

    participation: float

    @property
    def share(self) -> float:
        """The participation of the mode [1]."""
        return self.participation

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return the participation data would just have shown."""
        return {"participation": min(abs(self.participation) * factor, _HALF)}

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether the mode rings within the band, where records show it as one."""
        return self.frequency_hz * step_s <= 0.5

    @classmethod
    def screening(cls, evidence: Evidence) -> list[SecondMode]:
        """Return lightly damped modes where the residual's spectrum peaks."""
        return cls.proposed(
            {"frequency_hz": peak_hz, "damping_ratio": damping, "participation": 0.05}
            for peak_hz in ringing_peaks_hz(evidence)
            for damping in (0.01, 0.05)
        )

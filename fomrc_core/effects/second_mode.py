"""A part of the stage has a mode of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fomrc_core.effects.base.effect import Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.ringing import ringing_peaks_hz
from fomrc_core.effects.base.second_order import SecondOrder

_HALF = 0.5  # of the motion: a mode that takes more of it is the stage's first, ``mechanical_resonance``
# Two modes side by side, s1 H1 + s2 H2, are H1 in series with 1 - p + p H2 where 1 - p = s1 + s2 (f2 / f1)^2: p is
# below zero without end, for f2 is as far above f1 as it likes. Ten times the frequency at an equal share is 50.
_LARGEST = 50.0
_NEARLY = 0.99  # of it: a fit that ends at a bound has not found what it was sent for


@dataclass(frozen=True)
class SecondMode(SecondOrder):
    """A share of the displacement that passes through a mode, (1 - p) x + p x_mode + q x_mode' / w.

    In the frequency response a pair of a resonance and an antiresonance, at f and f / sqrt(1 - p). Behind
    ``mechanical_resonance`` it makes of it any two modes side by side, s1 H1 + s2 H2; q is what they leave where their
    dampings are not alike, and 0 for a part that rings beside the stage.
    """

    name: ClassVar[str] = "second_mode"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 22.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("frequency_hz", "Hz", 1e-7, 1e9, is_log=True, description="undamped natural frequency"),
        Parameter("damping_ratio", "1", 1e-4, 0.999, is_log=True, description="damping ratio"),
        Parameter("participation", "1", -_LARGEST, _HALF, description="share of the motion that is the mode's"),
        Parameter("rate_share", "1", -_LARGEST, _LARGEST, description="share of its rate over 2 pi f that is added"),
    )
    main_parameter: ClassVar[str] = "frequency_hz"
    linear_parameters: ClassVar[tuple[str, ...]] = ("participation", "rate_share")
    meaning: ClassVar[str] = "A bracket, a lever or the base beneath the stage rings beside the stage itself."
    signature: ClassVar[str] = "residual rings at a frequency at which the stage as a whole still follows"
    experiment: ClassVar[str] = (
        "a multisine through the frequency: a mode of a part shows a resonance and an antiresonance beside it, the "
        "stage's own a resonance beyond which it no longer follows"
    )
    inverse_note: ClassVar[str] = "not inverted: it takes the second derivative of the target; use smooth targets"

    participation: float
    rate_share: float = 0.0

    @property
    def share(self) -> float:
        """The participation of the mode [1]."""
        return self.participation

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return the participation data would just have shown."""
        return {"participation": min(abs(self.participation) * factor, _HALF)}

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether the mode rings within the band, where records show it as one, and beside the stage's first."""
        is_beside = self.participation < _HALF * _NEARLY
        return super().is_plausible(duration_s, step_s) and is_beside and self.frequency_hz * step_s <= 0.5

    @classmethod
    def screening(cls, evidence: Evidence) -> list[SecondMode]:
        """Return lightly damped modes where the residual's spectrum peaks."""
        return cls.proposed(
            {"frequency_hz": peak_hz, "damping_ratio": damping, "participation": 0.05, "rate_share": rate_share}
            for peak_hz in ringing_peaks_hz(evidence)
            for damping, rate_share in ((0.01, 0.0), (0.05, 0.0), (0.01, 0.001))
        )

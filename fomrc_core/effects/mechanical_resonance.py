"""The stage is a mass on a spring."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.ringing import n_apart, ringing_peaks_hz, slowest_ringing_hz
from fomrc_core.effects.base.second_order import SecondOrder

# Of the sample rate: a mode that rings is seen up to half of it, one that hardly does somewhat above.
_FASTEST, _FASTEST_DAMPED = 0.49, 0.8
_APART = 1.8  # factor between trials: within reach of a fit, which finds a resonance from half or twice its frequency


@dataclass(frozen=True)
class MechanicalResonance(SecondOrder):
    """Second-order response of the displacement, equation (3), exact for a force linear between samples."""

    name: ClassVar[str] = "mechanical_resonance"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 20.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("frequency_hz", "Hz", 1e-7, 1e9, is_log=True, description="undamped natural frequency"),
        Parameter("damping_ratio", "1", 1e-4, 0.999, is_log=True, description="damping ratio"),
    )
    main_parameter: ClassVar[str] = "frequency_hz"
    meaning: ClassVar[str] = "Moved mass and stiffness of the stage ring at their natural frequency."
    signature: ClassVar[str] = (
        "residual rings after steps and corners; its spectrum peaks at one frequency of the drive"
    )
    experiment: ClassVar[str] = "a multisine through the resonance, or steps sampled fast"
    inverse_note: ClassVar[str] = "not inverted: it takes the second derivative of the target; use smooth targets"
    paper_section: ClassVar[str] = "4.4"
    size_exponent: ClassVar[float] = -0.5

    def kin(self) -> dict[str, dict[str, float]]:
        """Return the amplifier that swings alike: what it drives rings with it."""
        return {"drive_resonance": {"frequency_hz": self.frequency_hz, "damping_ratio": self.damping_ratio}}

    @classmethod
    def screening(cls, evidence: Evidence) -> list[MechanicalResonance]:
        """Return well damped frequencies over the band, and lightly damped ones where the residual's spectrum peaks.

        A peak may be the image of a frequency above half the sample rate, so its image is tried as well.
        """
        rate = 1.0 / evidence.sample_period_s
        slowest = slowest_ringing_hz(evidence)
        n_damped = n_apart(slowest, _FASTEST * rate, _APART)
        trials = [(float(f), 0.1) for f in np.geomspace(slowest, _FASTEST * rate, n_damped)]
        trials += [(float(f), 0.4) for f in np.geomspace(slowest, _FASTEST_DAMPED * rate, n_damped // 2)]
        for peak_hz in ringing_peaks_hz(evidence):
            trials += [(f, damping) for f in (peak_hz, rate - peak_hz) for damping in (0.01, 0.04)]
        return cls.proposed({"frequency_hz": f, "damping_ratio": damping} for f, damping in trials)

"""A part of the stage has a mode of its own."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.ringing import ringing_peaks_hz
from fomrc_core.effects.base.second_order import run_second_order, second_order_form
from fomrc_core.effects.base.step_form import Fields, Number, StepForm

_HALF = 0.5  # of the motion: a mode that takes more of it is the stage's first, ``mechanical_resonance``


def _swing_beside(s: Fields, k: Fields, c: Fields, value: float, step_s: float) -> Number:
    # The step of second_order.py, of which a share is taken.
    sigma = c.damping * c.omega
    damped = c.omega * c.root
    slope = (value - s.before) / step_s
    lag = 2.0 * c.damping / c.omega * slope
    p = s.position - (s.before - lag)
    q = (s.velocity - slope + sigma * p) / damped
    s.velocity = slope + k.decay * (-sigma * (p * k.cosine + q * k.sine) + damped * (q * k.cosine - p * k.sine))
    s.position = value - lag + k.decay * (p * k.cosine + q * k.sine)
    s.before = value
    return value + c.participation * (s.position - value)


@dataclass(frozen=True)
class SecondMode(Effect):
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
    needs_substeps: ClassVar[bool] = True
    rings: ClassVar[bool] = True

    frequency_hz: float
    damping_ratio: float
    participation: float

    def initial_state(self) -> Array:
        """Return (position [um], velocity [um/s], input [um]) of the mode at rest."""
        return np.zeros(3)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement [um] with the mode in it, shape (n_samples,)."""
        out = np.empty(values.size)
        run_second_order(state, 2.0 * np.pi * self.frequency_hz, self.damping_ratio, values, steps_s, out)
        return values + self.participation * (out - values)

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return the participation data would just have shown."""
        return {"participation": min(abs(self.participation) * factor, _HALF)}

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether the mode rings within the band, where records show it as one."""
        return self.frequency_hz * step_s <= 0.5

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        form = second_order_form(2.0 * math.pi * self.frequency_hz, self.damping_ratio)
        return replace(form, constants=(*form.constants, ("participation", self.participation)), forward=_swing_beside)

    @classmethod
    def screening(cls, evidence: Evidence) -> list[SecondMode]:
        """Return lightly damped modes where the residual's spectrum peaks."""
        return cls.proposed(
            {"frequency_hz": peak_hz, "damping_ratio": damping, "participation": 0.05}
            for peak_hz in ringing_peaks_hz(evidence)
            for damping in (0.01, 0.05)
        )

"""The stage is a mass on a spring."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence


@compiled
def _run_resonance(state: Array, omega: float, damping: float, values: Array, steps_s: Array, out: Array) -> None:
    # x'' + 2 d w x' + w^2 x = w^2 f with f linear over the step: particular solution a line, the rest decays.
    position, velocity, before = state[0], state[1], state[2]
    root = math.sqrt(1.0 - damping * damping)
    step = -1.0
    c, s, decay = 1.0, 0.0, 1.0
    sigma, damped = damping * omega, omega * root
    for k in range(values.size):
        if steps_s[k] != step:
            step = steps_s[k]
            decay = math.exp(-sigma * step)
            c, s = math.cos(damped * step), math.sin(damped * step)
        slope = (values[k] - before) / step
        lag = 2.0 * damping / omega * slope
        p = position - (before - lag)
        v = velocity - slope
        q = (v + sigma * p) / damped
        new_p = decay * (p * c + q * s)
        velocity = slope + decay * (-sigma * (p * c + q * s) + damped * (q * c - p * s))
        position = values[k] - lag + new_p
        before = values[k]
        out[k] = position
    state[0], state[1], state[2] = position, velocity, before


@dataclass(frozen=True)
class MechanicalResonance(Effect):
    """Second-order response of the displacement, equation (3), exact for a force linear between samples."""

    name: ClassVar[str] = "mechanical_resonance"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 20.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("frequency_hz", "Hz", 1e-2, 1e6, is_log=True, description="undamped natural frequency"),
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
    needs_substeps: ClassVar[bool] = True
    rings: ClassVar[bool] = True
    size_exponent: ClassVar[float] = -0.5

    frequency_hz: float
    damping_ratio: float

    def initial_state(self) -> Array:
        """Return (position [um], velocity [um/s], input [um]) at rest."""
        return np.zeros(3)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement of the mass [um], shape (n_samples,)."""
        out = np.empty(values.size)
        _run_resonance(state, 2.0 * np.pi * self.frequency_hz, self.damping_ratio, values, steps_s, out)
        return out

    @classmethod
    def screening(cls, evidence: Evidence) -> list[Effect]:
        """Return well damped frequencies over the band, and lightly damped ones where the residual's spectrum peaks.

        A peak may be the image of a frequency above half the sample rate, so its image is tried as well.
        """
        from scipy.signal import welch  # slow to import, and only a diagnosis needs it

        rate = 1.0 / evidence.sample_period_s
        trials: list[Effect] = [cls(float(f), 0.1) for f in rate * np.geomspace(0.02, 0.49, 8)]
        trials += [cls(float(f), 0.4) for f in rate * np.geomspace(0.02, 0.8, 4)]
        longest = max(evidence.records, key=lambda record: record.time_s.size)
        frequency, power = welch(longest.residual_um, fs=rate, nperseg=min(1024, longest.time_s.size))
        power = np.where(frequency > 0.01 * rate, power, 0.0)
        for _ in range(3):
            peak = int(np.argmax(power))
            if power[peak] == 0.0:
                break
            for f in (frequency[peak], rate - frequency[peak]):
                trials += [cls(float(f), damping) for damping in (0.01, 0.04)]
            power[max(0, peak - 6) : peak + 7] = 0.0
        return trials

"""The mains couple into the reading."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.kernels import elapsed_times


@dataclass(frozen=True)
class MainsHum(Effect):
    """One sine in time added to the reading."""

    name: ClassVar[str] = "mains_hum"
    stage: ClassVar[Stage] = Stage.SENSED
    order: ClassVar[float] = 60.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        # a share of the frequency that turns the phase little, even at the end of an hour
        Parameter("frequency_hz", "Hz", 1e-2, 1e6, is_log=True, description="frequency", difference=1e-8),
        Parameter("amplitude_um", "um", -1e3, 1e3, description="amplitude"),
        Parameter("phase_rad", "rad", -1e6, 1e6, description="phase at the record's first sample"),
    )
    main_parameter: ClassVar[str] = "frequency_hz"
    meaning: ClassVar[str] = "Mains or a fan couples into sensor or amplifier as one steady tone."
    signature: ClassVar[str] = "one line in the residual's spectrum that does not depend on the drive"
    experiment: ClassVar[str] = "hold the drive at rest for seconds and look at the spectrum"
    inverse_note: ClassVar[str] = "not inverted: its phase is not known while running"
    is_record_bound: ClassVar[bool] = True
    linear_parameters: ClassVar[tuple[str, ...]] = ("amplitude_um",)

    frequency_hz: float
    amplitude_um: float
    phase_rad: float = 0.0

    def initial_state(self) -> Array:
        """Return (elapsed [s], started)."""
        return np.zeros(2)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the reading [um] with the tone, shape (n_samples,)."""
        t = np.empty(steps_s.size)
        elapsed_times(state, steps_s, t)
        return values + self.amplitude_um * np.sin(2.0 * np.pi * self.frequency_hz * t + self.phase_rad)

    def scale_of(self, name: str, value: float) -> float:
        """Return one radian as the unit of the phase."""
        return 1.0 if name == "phase_rad" else super().scale_of(name, value)

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return nothing: a tone of any frequency is as visible, see ``smallest_detectable_of_rms``."""
        return {}

    @classmethod
    def smallest_detectable_of_rms(cls, rms_um: float) -> dict[str, float]:
        """Return the amplitude of a sine of this rms [um]."""
        return {"amplitude_um": float(np.sqrt(2.0) * rms_um)}

    @classmethod
    def screening(cls, evidence: Evidence) -> list[Effect]:
        """Return the strongest line of the residual's spectrum, with its amplitude and phase."""
        record = max(evidence.records, key=lambda r: r.time_s.size)
        n = record.time_s.size
        step = float(np.median(record.steps_s))
        window = np.hanning(n)
        spectrum = np.fft.rfft(record.residual_um * window, 4 * n)
        power = np.abs(spectrum)
        frequency = np.fft.rfftfreq(4 * n, step)
        # a line stands out of its own neighbourhood; below some cycles per record it is drift
        neighbourhood = _running_median(power, 801)
        standing = np.where(frequency > max(5.0, 30.0 / (n * step)), power / (neighbourhood + 1e-30), 0.0)
        trials: list[Effect] = []
        for _ in range(2):
            peak = int(np.argmax(standing))
            if standing[peak] < 4.0:
                break
            amplitude = 2.0 * power[peak] / float(np.sum(window))
            trials.append(cls(float(frequency[peak]), float(amplitude), float(np.angle(spectrum[peak]) + np.pi / 2.0)))
            standing[max(0, peak - 40) : peak + 41] = 0.0
        return trials


def _running_median(values: Array, width: int) -> Array:
    # medians of blocks, linear between: a full running median would cost more than the transform
    n_blocks = max(values.size // width, 1)
    blocks = np.array_split(values, n_blocks)
    centres = np.cumsum([b.size for b in blocks]) - np.array([b.size for b in blocks]) / 2.0
    return np.interp(np.arange(values.size), centres, [float(np.median(b)) for b in blocks])

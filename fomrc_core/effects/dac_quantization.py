"""The drive comes from a converter with finite steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence


@dataclass(frozen=True)
class DacQuantization(Effect):
    """Rounding of the drive to multiples of a step, at the samples."""

    name: ClassVar[str] = "dac_quantization"
    stage: ClassVar[Stage] = Stage.SAMPLED_DRIVE
    order: ClassVar[float] = 10.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("step_v", "V", 1e-9, 1e3, is_log=True, description="step of the converter"),
    )
    main_parameter: ClassVar[str] = "step_v"
    meaning: ClassVar[str] = "The converter that makes the drive has too few bits, so the voltage moves in steps."
    signature: ClassVar[str] = "residual is a sawtooth of the commanded voltage, with the step as its period"
    experiment: ClassVar[str] = "a triangle so slow that many samples fall on each step"
    is_scanned: ClassVar[bool] = True
    held_parameters: ClassVar[tuple[str, ...]] = ("step_v",)
    inverse_note: ClassVar[str] = "no inverse: positions between two steps cannot be had"

    step_v: float

    def initial_state(self) -> Array:
        """Return an empty state: rounding has no memory."""
        return np.zeros(0)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the rounded drive [V], shape (n_samples,)."""
        return np.rint(values / self.step_v) * self.step_v

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return nothing: a trial's step is a line of the residual, of which a smaller one says nothing."""
        return {}

    @classmethod
    def screening(cls, evidence: Evidence) -> list[Effect]:
        """Return the steps at which the residual, sorted by voltage, shows a sawtooth.

        Rounding is a sawtooth of the voltage, its first harmonic sin(2 pi u / step): one Fourier transform of the
        residual over voltage finds every step at once.
        """
        low, high = evidence.smallest_v, evidence.largest_v
        span = high - low
        if span <= 0.0:
            return []
        n_bins = 1 << 17
        n_padded = 4 * n_bins
        power = np.zeros(n_padded // 2 + 1)
        for record in evidence.records:
            rate = np.gradient(record.voltage_v) / record.steps_s
            # what is slow in time is not the sawtooth, which is fast in voltage and so in time
            fast = record.residual_um - _running_mean(record.residual_um, 25)
            bins = ((record.voltage_v - low) / span * (n_bins - 1)).astype(np.int64)
            # A lag behind the converter shifts the sawtooth in proportion to the rate: powers of rates are added.
            for group in _groups_of_rate(rate):
                sums = np.bincount(bins[group], weights=fast[group], minlength=n_bins)
                power += np.abs(np.fft.rfft(sums, n_padded)) ** 2
        spectrum = np.sqrt(power)
        spectrum[:80] = 0.0
        width = span * n_padded / (n_bins - 1)
        trials: list[Effect] = []
        for _ in range(3):
            peak = int(np.argmax(spectrum))
            if peak == 0 or spectrum[peak] == 0.0:
                break
            offset = 0.0
            if 0 < peak < spectrum.size - 1:
                left, top, right = spectrum[peak - 1 : peak + 2]
                curvature = left - 2.0 * top + right
                offset = 0.5 * (left - right) / curvature if curvature < 0.0 else 0.0
            trials.append(cls(step_v=width / (peak + offset)))
            spectrum[max(peak - 12, 0) : peak + 13] = 0.0
        return trials


def _groups_of_rate(rate: Array) -> list[Array]:
    """Return the samples that move, in groups of either direction and like rates."""
    groups = []
    for direction in (1.0, -1.0):
        moving = np.flatnonzero(direction * rate > 0.0)
        if moving.size < 100:
            continue
        edges = np.quantile(np.abs(rate[moving]), (0.0, 0.25, 0.5, 0.75, 1.0))
        part = np.searchsorted(edges[1:-1], np.abs(rate[moving]), side="right")
        groups += [moving[part == k] for k in range(4) if np.any(part == k)]
    return groups


def _running_mean(values: Array, half_width: int) -> Array:
    padded = np.concatenate((np.repeat(values[:1], half_width), values, np.repeat(values[-1:], half_width)))
    total = np.concatenate(([0.0], np.cumsum(padded)))
    width = 2 * half_width + 1
    return (total[width:] - total[:-width]) / width

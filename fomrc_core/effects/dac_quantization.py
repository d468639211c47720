"""The drive comes from a converter with finite steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.step_form import Fields, Number, StepForm


def _round(c: Fields, value: float) -> Number:
    return round(value / c.step_v - c.cut_share) * c.step_v


_CUTS = (0.0, 0.5)  # a converter rounds to the nearest level, or cuts off what is above one
_FEWEST_STEPS = 5  # over the range: of fewer each is seen in the displacement itself
_HALF_WIDTH = 25  # samples of the narrowest running mean: passes steps of fewer samples than that, of any size
_WIDER = 5  # from one width to the next: a running mean passes a sawtooth from a tenth of its width to all of it
_N_PEAKS = 3  # of the narrowest width, where lines of the drive may stand beside the step's
_MOST_BINS = 1 << 17  # over the range: a converter of 16 bits, twice
_BINS_PER_STEP = 4  # the sawtooth of the smallest step, and twice as fine
_PADDING = 4  # bins of the spectrum to one of its resolution
_PEAK_REACH = 3 * _PADDING  # about a peak in which it is high itself


@dataclass(frozen=True)
class DacQuantization(Effect):
    """Rounding of the drive to levels a step apart, at the samples."""

    name: ClassVar[str] = "dac_quantization"
    stage: ClassVar[Stage] = Stage.SAMPLED_DRIVE
    order: ClassVar[float] = 10.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("step_v", "V", 1e-12, 1e6, is_log=True, description="step of the converter"),
        Parameter(
            "cut_share",
            "1",
            -0.5,
            0.5,
            description="what is taken off, in steps, before it rounds: 0 rounds to the nearest level, 0.5 cuts off",
        ),
    )
    main_parameter: ClassVar[str] = "step_v"
    meaning: ClassVar[str] = "The converter that makes the drive has too few bits, so the voltage moves in steps."
    signature: ClassVar[str] = "residual is a sawtooth of the commanded voltage, with the step as its period"
    experiment: ClassVar[str] = "a triangle so slow that many samples fall on each step"
    is_scanned: ClassVar[bool] = True
    held_parameters: ClassVar[tuple[str, ...]] = ("step_v", "cut_share")
    inverse_note: ClassVar[str] = "no inverse: positions between two steps cannot be had"

    step_v: float
    cut_share: float = 0.0

    def initial_state(self) -> Array:
        """Return an empty state: rounding has no memory."""
        return np.zeros(0)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the rounded drive [V], shape (n_samples,)."""
        return np.asarray(np.rint(values / self.step_v - self.cut_share) * self.step_v)

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return nothing: a trial's step is a line of the residual, of which a smaller one says nothing."""
        return {}

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=(("step_v", self.step_v), ("cut_share", self.cut_share)),
            forward=_round,
            jumps=("forward",),
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[DacQuantization]:
        """Return the steps at which the residual, sorted by voltage, shows a sawtooth.

        Rounding is a sawtooth of the voltage, its first harmonic sin(2 pi u / step): one Fourier transform of the
        residual over voltage finds every step at once. What is slow beside the sawtooth is taken out in time first;
        how slow that is depends on how long the drive takes for a step, so several widths are tried.
        """
        low, span = evidence.smallest_v, evidence.largest_v - evidence.smallest_v
        if not span > 0.0:
            return []
        n_longest = max(record.time_s.size for record in evidence.records)
        steps_v: list[float] = []
        half_width, n_peaks = _HALF_WIDTH, _N_PEAKS
        while half_width * _FEWEST_STEPS <= n_longest:
            power = _power_over_voltage(evidence, low, span, half_width, n_longest)
            steps_v += _sawtooth_steps(np.sqrt(power), span, n_peaks)
            half_width, n_peaks = _WIDER * half_width, 1
        return cls.proposed({"step_v": step, "cut_share": share} for step in steps_v for share in _CUTS)


def _power_over_voltage(evidence: Evidence, low: float, span: float, half_width: int, n_longest: int) -> Array:
    """Return the power spectrum over voltage of the residual less its running mean, shape (n_frequencies,)."""
    # a step may be passed within one sample, but where the running mean is wide the samples on a step are many
    n_samples_per_step = 1 if half_width == _HALF_WIDTH else half_width // _WIDER
    n_bins = min(_MOST_BINS, 1 << (_BINS_PER_STEP * n_longest // n_samples_per_step).bit_length())
    power = np.zeros(_PADDING * n_bins // 2 + 1)
    for record in evidence.records:
        rate = np.gradient(record.voltage_v) / record.steps_s
        fast = record.residual_um - _running_mean(record.residual_um, half_width)
        bins = ((record.voltage_v - low) / span * (n_bins - 1)).astype(np.int64)
        # A lag behind the converter shifts the sawtooth in proportion to the rate: powers of rates are added.
        for group in _groups_of_rate(rate):
            sums = np.bincount(bins[group], weights=fast[group], minlength=n_bins)
            power += np.abs(np.fft.rfft(sums, _PADDING * n_bins)) ** 2
    return power


def _sawtooth_steps(spectrum: Array, span: float, n_peaks: int) -> list[float]:
    """Return the periods [V] of the highest peaks of a spectrum over voltage."""
    n_bins = 2 * (spectrum.size - 1) // _PADDING
    width = span * _PADDING * n_bins / (n_bins - 1)
    spectrum = spectrum.copy()
    spectrum[: _FEWEST_STEPS * _PADDING] = 0.0
    steps_v: list[float] = []
    for _ in range(n_peaks):
        peak = int(np.argmax(spectrum))
        if peak == 0 or spectrum[peak] == 0.0:
            break
        offset = 0.0
        if 0 < peak < spectrum.size - 1:
            left, top, right = spectrum[peak - 1 : peak + 2]
            curvature = left - 2.0 * top + right
            offset = 0.5 * (left - right) / curvature if curvature < 0.0 else 0.0
        steps_v.append(float(width / (peak + offset)))
        spectrum[max(peak - _PEAK_REACH, 0) : peak + _PEAK_REACH + 1] = 0.0
    return steps_v


def _groups_of_rate(rate: Array) -> list[Array]:
    """Return the samples that move, in groups of either direction and like rates."""
    groups = []
    for direction in (1.0, -1.0):
        moving = np.flatnonzero(direction * rate > 0.0)
        if moving.size < 2 * _FEWEST_STEPS:
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

"""The sensor's interpolator errs in a cycle that repeats with the displacement."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.spectra import Spectrum
from fomrc_core.effects.base.step_form import Fields, Number, StepForm

_TERMS = ("sine_um", "cosine_um", "second_sine_um", "second_cosine_um")
_LEAST_CYCLES = 4.0  # over the stroke: the lines of fewer lie too near each other in a spectrum
# Over the stroke, tried as they are: at two a sine turns four times, a curved scale of second and third order twice.
# Fewer than the first bend as a curve does, and follow a kink as well.
_FEW_CYCLES = (2.0, 2.5, 3.0, 3.5)
_MOST_BINS = 1 << 14  # over the stroke; a cycle of four of them is the shortest that is looked for
_N_TRIALS = 2
_LEAST_FIRST = 0.1  # of its second harmonic: less is a hundredth of the power, and a cycle half as long
# Of the readings: rounding errs in a cycle of one step by itself (Widrow and Kollar, 2008), and says nothing of shorter
# ones.
_LEAST_STEPS = 2.0


@compiled
def _run_cycle(period: float, terms: Array, values: Array, out: Array) -> None:
    for k in range(values.size):
        phase = 2.0 * math.pi * (values[k] / period)
        error = 0.0
        for harmonic in range(2):
            sine, cosine = terms[2 * harmonic], terms[2 * harmonic + 1]
            if sine != 0.0 or cosine != 0.0:
                turned = (harmonic + 1) * phase
                error += sine * math.sin(turned) + cosine * math.cos(turned)
        out[k] = values[k] + error


@compiled
def _slopes(period: float, terms: Array, values: Array, out: Array) -> None:
    for k in range(values.size):
        slope = 1.0
        for harmonic in range(2):
            wave = 2.0 * math.pi * (harmonic + 1) / period
            turned = wave * values[k]
            slope += wave * (terms[2 * harmonic] * math.cos(turned) - terms[2 * harmonic + 1] * math.sin(turned))
        out[k] = slope


def _misread(c: Fields, value: float) -> Number:
    phase = 6.283185307179586 * (value / c.period_um)
    error = c.sine_um * math.sin(phase) + c.cosine_um * math.cos(phase)
    return value + error + (c.second_sine_um * math.sin(2.0 * phase) + c.second_cosine_um * math.cos(2.0 * phase))


@dataclass(frozen=True)
class CyclicSensorError(Effect):
    """A sine of the displacement added to the reading, and its second harmonic."""

    name: ClassVar[str] = "cyclic_sensor_error"
    stage: ClassVar[Stage] = Stage.SENSED
    order: ClassVar[float] = 55.0
    is_of_sensor: ClassVar[bool] = True
    parameters: ClassVar[tuple[Parameter, ...]] = (
        # a share of the period that shifts the phase little, even at the far end of many cycles
        Parameter("period_um", "um", 1e-9, 1e6, is_log=True, description="period of the error", difference=1e-6),
        Parameter("sine_um", "um", -1e6, 1e6, description="its sine"),
        Parameter("cosine_um", "um", -1e6, 1e6, description="its cosine"),
        Parameter("second_sine_um", "um", -1e6, 1e6, description="sine of half the period"),
        Parameter("second_cosine_um", "um", -1e6, 1e6, description="cosine of half the period"),
    )
    main_parameter: ClassVar[str] = "period_um"
    linear_parameters: ClassVar[tuple[str, ...]] = _TERMS
    meaning: ClassVar[str] = "An interpolated scale or interferometer reads its quadrature signals a little wrong."
    signature: ClassVar[str] = "residual repeats with the displacement, many times over the stroke, whatever the speed"
    experiment: ClassVar[str] = "a triangle so slow that many samples fall on each period of the scale"
    inverse_note: ClassVar[str] = "not inverted: the reading errs, not the position"
    slope_depends_on_input: ClassVar[bool] = True

    period_um: float
    sine_um: float = 0.0
    cosine_um: float = 0.0
    second_sine_um: float = 0.0
    second_cosine_um: float = 0.0

    @property
    def cycle_um(self) -> float:
        """Period of the error [um]."""
        return self.period_um

    @property
    def _terms(self) -> Array:
        return np.array([getattr(self, name) for name in _TERMS])

    def initial_state(self) -> Array:
        """Return an empty state: the error has no memory."""
        return np.zeros(0)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the reading [um], shape (n_samples,)."""
        out = np.empty(values.size)
        _run_cycle(self.period_um, self._terms, values, out)
        return out

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes times the slope of the reading where the displacement stands."""
        if values is None:
            return changes
        slopes = np.empty(values.size)
        _slopes(self.period_um, self._terms, values, slopes)
        return np.asarray(changes * slopes[:, None])

    def free_names(self) -> tuple[str, ...]:
        """Return the period, and sine and cosine of every harmonic that is there."""
        free = ["period_um"]
        for pair in (_TERMS[:2], _TERMS[2:]):
            free += pair if any(getattr(self, name) != 0.0 for name in pair) else ()
        return tuple(free)

    def in_shortest_form(self) -> CyclicSensorError:
        """Return the error of half the period where all but its second harmonic is nothing.

        A cycle is the shortest way after which all comes again; a spectrum over few cycles does not tell the two.
        """
        first_um, second_um = np.hypot(*self._terms[:2]), np.hypot(*self._terms[2:])
        if not first_um < _LEAST_FIRST * second_um:
            return self
        return CyclicSensorError(0.5 * self.period_um, self.second_sine_um, self.second_cosine_um)

    def is_shown_over(self, stroke_um: float) -> bool:
        """Return whether it comes again within the stroke."""
        return stroke_um >= _FEW_CYCLES[0] * self.period_um

    def scale_of(self, name: str, value: float) -> float:
        """Return the size of the whole error as the unit of each term."""
        return float(np.max(np.abs(self._terms))) or super().scale_of(name, value)

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return nothing: an error of any period is as visible, see ``smallest_detectable_of_rms``."""
        return {}

    @classmethod
    def smallest_detectable_of_rms(cls, rms_um: float) -> dict[str, float]:
        """Return the size of a sine of this rms [um]."""
        return {"sine_um": float(np.sqrt(2.0) * rms_um)}

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=tuple((name, getattr(self, name)) for name in ("period_um", *_TERMS)), forward=_misread
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[CyclicSensorError]:
        """Return the strongest lines of the residual's spectrum over displacement and a few long cycles.

        Each with its second harmonic.
        """
        low = min(float(np.min(record.predicted_um)) for record in evidence.records)
        stroke_um = evidence.stroke_um
        if not stroke_um > 0.0:
            return []
        n_samples = sum(record.time_s.size for record in evidence.records)
        n_bins = min(_MOST_BINS, 1 << n_samples.bit_length())
        sums, counts = np.zeros(n_bins), np.zeros(n_bins)
        for record in evidence.records:
            place = (record.predicted_um - low) / stroke_um * (n_bins - 1)
            bins = np.clip(place.astype(np.int64), 0, n_bins - 1)
            # what is left of hysteresis differs from branch to branch and changes slowly along each
            fast = record.residual_um - _smoothed(record.residual_um, record.predicted_um, stroke_um / _LEAST_CYCLES)
            sums += np.bincount(bins, weights=fast, minlength=n_bins)
            counts += np.bincount(bins, minlength=n_bins)
        mean = sums / np.maximum(counts, 1.0)
        lines = Spectrum.of(mean, stroke_um / (n_bins - 1)).lines(_LEAST_CYCLES / stroke_um, _N_TRIALS)
        steps_um = [record.sensor_step_um for record in evidence.records if record.sensor_step_um > 0.0]
        shortest_um = _LEAST_STEPS * max(steps_um, default=0.0)
        proposed = [*lines, *(n / stroke_um for n in _FEW_CYCLES)]
        return cls.proposed(_error_of(evidence, 1.0 / line) for line in proposed if line * shortest_um < 1.0)


def _smoothed(values: Array, displacement: Array, length: float) -> Array:
    """Return the values less what is fast along the way, (n_samples,): means over stretches of this way [um]."""
    way = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(displacement)))))
    stretch = (way / (0.5 * length)).astype(np.int64)
    counts = np.maximum(np.bincount(stretch), 1)
    means = np.bincount(stretch, weights=values) / counts
    centres = np.bincount(stretch, weights=way) / counts
    filled = np.bincount(stretch) > 0
    return np.interp(way, centres[filled], means[filled])


def _error_of(evidence: Evidence, period_um: float) -> dict[str, float]:
    """Return the parameters of an error of this period by least squares on the residuals."""
    phases = np.concatenate([2.0 * np.pi * record.predicted_um / period_um for record in evidence.records])
    residual = np.concatenate([record.residual_um for record in evidence.records])
    waves = [np.sin(phases), np.cos(phases), np.sin(2.0 * phases), np.cos(2.0 * phases), np.ones(phases.size)]
    terms = np.linalg.lstsq(np.column_stack(waves), residual, rcond=None)[0]
    return {"period_um": period_um, **{name: float(v) for name, v in zip(_TERMS, terms, strict=False)}}

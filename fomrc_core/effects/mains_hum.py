"""The mains couple into the reading."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence, RecordEvidence
from fomrc_core.effects.base.kernels import elapsed_times
from fomrc_core.effects.base.spectra import DriveLines, Spectrum
from fomrc_core.effects.base.step_form import CLOCK_FIELDS, Fields, Number, StepForm, clock_after

_AMPLITUDES = ("amplitude_um", "second_amplitude_um", "third_amplitude_um")
_PHASES = ("phase_rad", "second_phase_rad", "third_phase_rad")
_LEAST_CYCLES = 10.0  # in a record: fewer are a drift that happens to turn
_N_LINES = 6
_N_TRIALS = 2


def _hum(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    s.elapsed = clock_after(s.elapsed, s.started, step_s)
    s.started = 1
    total = value
    for j in range(len(c.amplitudes_um)):
        total = total + c.amplitudes_um[j] * math.sin(c.omegas[j] * s.elapsed + c.phases_rad[j])
    return total


@dataclass(frozen=True)
class MainsHum(Effect):
    """A tone in time added to the reading: a sine, and where they show its second and third harmonic."""

    name: ClassVar[str] = "mains_hum"
    stage: ClassVar[Stage] = Stage.SENSED
    order: ClassVar[float] = 60.0
    is_of_sensor: ClassVar[bool] = True
    parameters: ClassVar[tuple[Parameter, ...]] = (
        # a share of the frequency that turns the phase little, even at the end of an hour
        Parameter("frequency_hz", "Hz", 1e-7, 1e9, is_log=True, description="fundamental frequency", difference=1e-8),
        Parameter("amplitude_um", "um", -1e6, 1e6, description="amplitude"),
        Parameter("phase_rad", "rad", -1e6, 1e6, description="phase at the record's first sample"),
        Parameter("second_amplitude_um", "um", -1e6, 1e6, description="amplitude at twice the frequency"),
        Parameter("second_phase_rad", "rad", -1e6, 1e6, description="its phase at the first sample"),
        Parameter("third_amplitude_um", "um", -1e6, 1e6, description="amplitude at three times the frequency"),
        Parameter("third_phase_rad", "rad", -1e6, 1e6, description="its phase at the first sample"),
    )
    main_parameter: ClassVar[str] = "frequency_hz"
    meaning: ClassVar[str] = "Mains or a fan couples into sensor or amplifier as one steady tone."
    signature: ClassVar[str] = "one line in the residual's spectrum, or it and its harmonics, whatever the drive does"
    experiment: ClassVar[str] = "hold the drive at rest for seconds and look at the spectrum"
    inverse_note: ClassVar[str] = "not inverted: its phase is not known while running"
    is_record_bound: ClassVar[bool] = True
    is_steady_tone: ClassVar[bool] = True
    linear_parameters: ClassVar[tuple[str, ...]] = _AMPLITUDES

    frequency_hz: float
    amplitude_um: float
    phase_rad: float = 0.0
    second_amplitude_um: float = 0.0
    second_phase_rad: float = 0.0
    third_amplitude_um: float = 0.0
    third_phase_rad: float = 0.0

    def initial_state(self) -> Array:
        """Return (elapsed [s], started)."""
        return np.zeros(2)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the reading [um] with the tone, shape (n_samples,)."""
        t = np.empty(steps_s.size)
        elapsed_times(state, steps_s, t)
        out = values
        for harmonic, (amplitude, phase) in enumerate(zip(_AMPLITUDES, _PHASES, strict=True), start=1):
            size_um = getattr(self, amplitude)
            if size_um != 0.0:
                turned = 2.0 * np.pi * harmonic * self.frequency_hz * t + getattr(self, phase)
                out = out + size_um * np.sin(turned)
        return out

    def free_names(self) -> tuple[str, ...]:
        """Return the frequency, and amplitude and phase of every harmonic that is there."""
        free = ["frequency_hz"]
        for pair in zip(_AMPLITUDES, _PHASES, strict=True):
            free += pair if getattr(self, pair[0]) != 0.0 else ()
        return tuple(free)

    def scale_of(self, name: str, value: float) -> float:
        """Return one radian as the unit of a phase."""
        return 1.0 if name in _PHASES else super().scale_of(name, value)

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return nothing: a tone of any frequency is as visible, see ``smallest_detectable_of_rms``."""
        return {}

    @classmethod
    def smallest_detectable_of_rms(cls, rms_um: float) -> dict[str, float]:
        """Return the amplitude of a sine of this rms [um]."""
        return {"amplitude_um": float(np.sqrt(2.0) * rms_um)}

    def is_confirmed(self, time_s: Array, voltage_v: Array, residual_um: Array) -> bool:
        """Return whether the tone is apart from every line of the record's drive."""
        return not DriveLines.of(voltage_v, float(np.median(np.diff(time_s)))).has(self.frequency_hz)

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        omegas = tuple(2.0 * math.pi * harmonic * self.frequency_hz for harmonic in range(1, len(_AMPLITUDES) + 1))
        return StepForm(
            constants=(
                ("amplitudes_um", tuple(getattr(self, name) for name in _AMPLITUDES)),
                ("phases_rad", tuple(getattr(self, name) for name in _PHASES)),
                ("omegas", omegas),
            ),
            state=CLOCK_FIELDS,
            forward=_hum,
            helpers=(clock_after,),
        )

    def in_other_record(self, evidence: Evidence) -> list[MainsHum]:
        """Return the tone of this frequency, with the harmonics that it has: only their phases are of a record.

        Known from elsewhere it need not stand out from what the drive does in that record.
        """
        found = [number for number, name in enumerate(_AMPLITUDES, start=1) if getattr(self, name) != 0.0]
        harmonics = {number: number * self.frequency_hz for number in found}
        return self.proposed([_tone(evidence.records[0], harmonics)]) if harmonics else []

    @classmethod
    def screening(cls, evidence: Evidence) -> list[MainsHum]:
        """Return the strongest lines of the residual's spectrum, with their harmonics, each with amplitude and phase.

        No line within the resolution of one of a drive is tried, whichever record has that drive, nor of its harmonics
        unless it is higher than what a model may leave of hysteresis there: that is no tone of its own.
        """
        record = max(evidence.records, key=lambda r: r.time_s.size)
        spectrum = Spectrum.of(record.residual_um, float(np.median(record.steps_s)))
        lines_hz = spectrum.lines(_LEAST_CYCLES * spectrum.resolution_hz, _N_LINES)
        if not lines_hz:
            return []
        drives = [
            DriveLines.of(r.voltage_v, float(np.median(r.steps_s))) for r in (*evidence.records, *evidence.beside)
        ]
        lines_hz = [line for line in lines_hz if _is_its_own(line, record, spectrum, drives)]
        trials: list[dict[str, float]] = []
        for line in lines_hz:
            harmonics = _harmonics_with(line, lines_hz, spectrum.resolution_hz)
            is_taken = any(
                abs(line - known * trial["frequency_hz"]) < spectrum.resolution_hz
                for trial in trials
                for known in (1, 2, 3)
            )
            if harmonics and not is_taken:
                if len(harmonics) > 1:
                    # its harmonics tell it, also where a drive is there: they have no other reason to be where they are
                    harmonics.setdefault(1, max(harmonics.values()) / max(harmonics))
                trials.append(_tone(record, harmonics))
        return cls.proposed(trials[:_N_TRIALS])


def _is_its_own(
    line_hz: float,
    record: RecordEvidence,
    spectrum: Spectrum,
    drives: Sequence[DriveLines],
) -> bool:
    """Return whether a line of a record's residual is surely none that its drive, or another, makes."""
    height_um = float(np.interp(line_hz, spectrum.frequency_hz, spectrum.amplitude))
    gain = float(np.ptp(record.predicted_um)) / max(float(np.ptp(record.voltage_v)), 1e-300)
    return not any(drive.may_reach(line_hz, height_um, gain) for drive in drives)


def _harmonics_with(line_hz: float, lines_hz: list[float], resolution_hz: float) -> dict[int, float]:
    """Return the tone a line belongs to, by the numbers of its harmonics [Hz]: the fundamental that has most lines.

    A line may be the second or the third harmonic of a fundamental weaker than itself.
    """
    best: dict[int, float] = {}
    for number in (1, 2, 3):
        fundamental_hz = line_hz / number
        found = {number: line_hz}
        for other in (1, 2, 3):
            near = [v for v in lines_hz if abs(v - other * fundamental_hz) < resolution_hz]
            if other != number and near:
                found[other] = near[0]
        if len(found) > max(len(best), 0 if number == 1 else 1):
            best = found
    return best


def _tone(record: RecordEvidence, harmonics: dict[int, float]) -> dict[str, float]:
    """Return the parameters of a tone whose harmonics stand at these frequencies [Hz] in a record's residual."""
    # the highest one is known best in share of itself
    number = max(harmonics)
    values = {"frequency_hz": harmonics[number] / number, "amplitude_um": 0.0}
    window = np.hanning(record.time_s.size)
    window /= np.sum(window)
    for harmonic in harmonics:
        turned = np.exp(-2.0j * np.pi * harmonic * values["frequency_hz"] * (record.time_s - record.time_s[0]))
        height = 2.0 * complex(np.sum(window * (record.residual_um - np.mean(record.residual_um)) * turned))
        values[_AMPLITUDES[harmonic - 1]] = abs(height)
        values[_PHASES[harmonic - 1]] = math.atan2(height.imag, height.real) + 0.5 * math.pi
    return values

"""Rasters of 1 to 100 Hz on a stage that rings: uncompensated, by static and dynamic inverse, with a sensor.

The stage is the electromechanical one, ringing at 300 Hz (damping 0.02) behind an amplifier of 500 Hz. The model is
diagnosed from recordings of it, with 1 nm of noise; nothing else is known of it. Loop and stage are stepped one by one
in this process, without topics, so that the machine has no part in the figures.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.control.compensation_loop import CompensationLoop, LoopSettings
from fomrc_core.control.feedback import Feedback
from fomrc_core.control.gain_margin import largest_bandwidth_hz
from fomrc_core.control.stage_motion import StageMotion
from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.effects import effect_classes
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.preview_inverse import PreviewInverse
from fomrc_core.plants.electromechanical import table1_plant
from fomrc_core.plants.simulated_rig import SimulatedRig
from fomrc_core.records import excitation
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import nrmse_percent

RATE_HZ = 2000.0
FREQUENCIES_HZ = (1.0, 10.0, 30.0, 100.0)
RANGE_UM = 4.0
ROUNDED_HZ = 150.0
PREVIEW_S = 0.02
_LIMIT_V, _SLEW_V_PER_S = 5.0, 5000.0
_FADE_S, _LEAST_S = 0.3, 1.0
_OF_LARGEST = 0.5  # of the bandwidth that the margin bears: 12 dB, so that harmonics at the resonance stay as they are
_N_SHOWN = 2  # periods at the end that are judged


def fast_stage() -> SimulatedRig:
    """Return the stage with amplifier, converters and 1 nm of noise."""
    return SimulatedRig(table1_plant(40, resonance_hz=300.0, damping_ratio=0.02, substep_s=1.0), 500.0)


@dataclass(frozen=True, eq=False)
class Known:
    """What a user knows of the stage.

    Attributes:
        model: diagnosed.
        gain_um_per_v: of a straight line through a recording.
        words: what was found, in a line.
    """

    model: PiezoModel
    gain_um_per_v: float
    words: str


def diagnosed(stage: SimulatedRig, progress: Callable[[float, str], None]) -> Known:
    """Return what recordings of a stage say of it, by ``diagnose`` as ``fomrc diagnose`` runs it.

    A triangle and a multisine to learn from, a staircase to accept on; the sensor is told to be good: a user knows.

    Args:
        stage: what is recorded.
        progress: called with a fraction and words.
    """
    drives = (
        excitation.triangle(slope_v_per_s=10.0, rate_hz=RATE_HZ),
        # up to a third of the resonance: what rings the mass hides what hysteresis and creep do
        excitation.multisine(1.5, lowest_hz=2.0, highest_hz=100.0, period_s=0.5, rate_hz=RATE_HZ),
    )
    of_sensor = [name for name, kind in effect_classes().items() if kind.is_of_sensor]
    records = [stage.measure(drive, seed=seed) for seed, drive in enumerate(drives)]
    test = stage.measure(excitation.staircase(dwell_s=0.05, step_v=0.5, rate_hz=RATE_HZ), seed=9)
    found = diagnose(records, test=test, excluded_causes=of_sensor, progress=progress)
    model = found.extended_model
    causes = ", ".join(str(cause) for cause in model.causes) or "nothing beside hysteresis and creep"
    return Known(
        model, _gain(records[0]), f"{model.n_elements} elements, creep order {model.creep_order:.4f}; {causes}"
    )


def _gain(record: Recording) -> float:
    return float(np.polyfit(record.voltage_v, record.measured_um, 1)[0])


def raster_um(frequency_hz: float, time_s: Array) -> Array:
    """Return a triangle whose turns are rounded: nothing above ``ROUNDED_HZ``, all below half of it [um]."""
    odd = np.arange(1.0, ROUNDED_HZ / frequency_hz + 1.0, 2.0)
    above = np.clip((odd * frequency_hz - 0.5 * ROUNDED_HZ) / (0.5 * ROUNDED_HZ), 0.0, 1.0)
    weights = (0.5 + 0.5 * np.cos(np.pi * above)) * (-1.0) ** ((odd - 1.0) / 2.0) / odd**2
    course = np.sin(2.0 * np.pi * frequency_hz * np.outer(time_s, odd)) @ weights
    return np.asarray(0.5 * RANGE_UM * 8.0 / np.pi**2 * course)


@dataclass(frozen=True, eq=False)
class Scan:
    """How the stage answered the last periods of a raster.

    Attributes:
        time_s: from the first of the samples shown [s], shape (n_samples,).
        desired_um: where it was to be then [um], shape (n_samples,).
        measured_um: where the sensor saw it [um], shape (n_samples,).
    """

    time_s: Array
    desired_um: Array
    measured_um: Array

    @property
    def percent(self) -> float:
        """NRMSE [%]."""
        return float(nrmse_percent(self.desired_um, self.measured_um))


def scans(stage: SimulatedRig, known: Known, progress: Callable[[float, str], None]) -> dict[str, dict[float, Scan]]:
    """Return each raster by the way of driving the stage and by its frequency [Hz]."""
    static = replace(known.model, effects=())
    bandwidth_hz = _OF_LARGEST * largest_bandwidth_hz(known.model.effects, 1.0 / RATE_HZ)
    ways: dict[str, Callable[[], _Way]] = {
        "uncompensated": lambda: _Straight(known.gain_um_per_v),
        "static inverse": lambda: _Looped(static, 0.0, 0.0),
        "dynamic inverse": lambda: _Looped(known.model, PREVIEW_S, 0.0),
        f"and feedback, {bandwidth_hz:.2g} Hz": lambda: _Looped(known.model, PREVIEW_S, bandwidth_hz),
    }
    found: dict[str, dict[float, Scan]] = {}
    for number, (name, way) in enumerate(ways.items()):
        found[name] = {}
        for frequency_hz in FREQUENCIES_HZ:
            found[name][frequency_hz] = _scanned(stage, way(), frequency_hz)
            done = number + (FREQUENCIES_HZ.index(frequency_hz) + 1.0) / len(FREQUENCIES_HZ)
            progress(done / len(ways), f"{name} at {frequency_hz:g} Hz")
    return found


class _Straight:
    """A constant gain in place of compensation."""

    n_late = 0

    def __init__(self, gain_um_per_v: float) -> None:
        self._gain_um_per_v = gain_um_per_v

    def voltage_v(self, k: int, desired_um: float) -> float:
        return desired_um / self._gain_um_per_v

    def see(self, k: int, measured_um: float) -> None:
        """Take no notice."""


class _Looped:
    """The compensator's loop, with a preview and a sensor where they are asked for."""

    def __init__(self, model: PiezoModel, preview_s: float, bandwidth_hz: float) -> None:
        period_s = 1.0 / RATE_HZ
        limits = VoltageLimits(-_LIMIT_V, _LIMIT_V, _SLEW_V_PER_S, 0.0, _SLEW_V_PER_S)
        settings = LoopSettings(limits, 0.0, False, period_s, 1.0)
        preview = PreviewInverse.of(model, period_s, preview_s) if preview_s else None
        compensator = Compensator(model) if preview is None else preview.core
        self.n_late = 0 if preview is None else preview.n_preview
        self._loop = CompensationLoop(compensator, settings, preview=preview)
        self._feedback = Feedback(bandwidth_hz, period_s) if bandwidth_hz else None
        self._motion = StageMotion(None, self._feedback)

    def voltage_v(self, k: int, desired_um: float) -> float:
        self._loop.set_target(desired_um)
        if self._feedback is not None:
            self._motion.before_tick(self._loop, k / RATE_HZ)
        voltage_v = self._loop.tick(1.0 / RATE_HZ)
        if self._feedback is not None:
            self._motion.after_tick(self._loop, k / RATE_HZ)
        assert voltage_v is not None  # there is a target
        return voltage_v

    def see(self, k: int, measured_um: float) -> None:
        if self._feedback is not None:
            self._feedback.take((k + 0.5) / RATE_HZ, measured_um)


_Way = _Straight | _Looped


def _scanned(stage: SimulatedRig, way: _Way, frequency_hz: float) -> Scan:
    n_shown = round(_N_SHOWN * RATE_HZ / frequency_hz)
    n_after = round(PREVIEW_S * RATE_HZ)  # what comes late comes by then; all ways are judged on the same targets
    n_samples = max(round((_LEAST_S + _FADE_S) * RATE_HZ), round(_FADE_S * RATE_HZ) + n_shown) + n_after
    time_s = np.arange(float(n_samples)) / RATE_HZ
    fade = 0.5 - 0.5 * np.cos(np.pi * np.clip(time_s / _FADE_S, 0.0, 1.0))
    target_um = fade * raster_um(frequency_hz, time_s)
    noise_um = np.random.default_rng(3).normal(0.0, stage.noise_um, n_samples)
    state = stage.initial_state()
    measured_um = np.empty(n_samples)
    for k in range(n_samples):
        true_um = stage.advance(state, way.voltage_v(k, float(target_um[k])), 1.0 / RATE_HZ)
        measured_um[k] = stage.adc_step_um * round((true_um + noise_um[k]) / stage.adc_step_um)
        way.see(k, float(measured_um[k]))
    first = n_samples - n_after - n_shown
    desired_um, answered = target_um[first : first + n_shown], measured_um[first + way.n_late :][:n_shown]
    return Scan(time_s[:n_shown], desired_um, answered)

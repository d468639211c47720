"""What a record says of itself in a line, and what of it a piezo actuator would not have done."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_toeplitz

from fomrc_core.compute.arrays import Array
from fomrc_core.errors import RecordingError
from fomrc_core.records.direction import falls_with_voltage
from fomrc_core.records.drive import turning_points
from fomrc_core.records.quality import examine
from fomrc_core.records.recording import Recording

# From a thin stack to a lever's stage told by its command of 10 V: beyond it units are the likelier reason.
_GAIN_UM_PER_V = (1e-3, 150.0)
# A plate of a single layer gives d33, some 0.3 nm/V, at less than 2 kV and so less than a micrometre; mV read as V make
# more volts than any stack is driven with. Displacements in mm read as um look like a plate's, and cannot be told.
_PLATE_UM_PER_V, _PLATE_V, _PLATE_UM = 1e-4, 2000.0, 1.0
_N_LOOKED_AT = 200_000
# Of a range, rms about the straight line. Loops of 0.3 % of their box lie 5e-4 and more from it, and creep adds to it.
_SAME = 2e-4
_UNRELATED = 0.25  # share of the displacement's power that follows from the voltage
_SIGN = 0.5
_TURN = 0.05
# Loops of piezo ceramics are a percent of their box and more, all of a drive with many small ones at least 0.3 %; read
# the other way round they are negative.
_LEAD = 0.003
_N_TURNS_MIN = 3
_NOISIER = 2.0
_ORDER = 8  # differences of this order leave little of a motion of ten samples a period
_N_TAPS = 256
# Nobody sweeps a stage eight times and more at minutes a sweep, with many samples in each, without saying so.
_SLOW_SWEEP_S, _N_SLOW_SWEEPS, _N_IN_SWEEP = 60.0, 8, 50
# A rate that would be above 10 kHz, were time in ms: few record a stage so fast, and slow motion often so.
_FAST_SAMPLED_HZ = 10.0
_STILL, _RESTING_SHARE = 1e-6, 0.3  # of the range from sample to sample; of the samples


def summary_line(recording: Recording) -> str:
    """Return what was read in one line: ``60 s, 200 Hz, 0..150 V, 110 um, 0.73 um/V``."""
    v = recording.voltage_v
    parts = [
        f"{recording.duration_s:.4g} s",
        f"{1.0 / recording.sample_period_s:.4g} Hz",
        f"{float(np.min(v)):.4g}..{float(np.max(v)):.4g} V",
    ]
    if recording.displacement_um is not None:
        span = float(np.ptp(recording.displacement_um))
        parts.append(f"{span:.4g} um")
        if float(np.ptp(v)) > 0.0:
            parts.append(f"{span / float(np.ptp(v)):.3g} um/V")
    return ", ".join(parts)


def suspicions(recording: Recording) -> list[str]:
    """Return what speaks against this being the voltage, time and displacement of a piezo actuator, a sentence each."""
    if recording.displacement_um is None or recording.n_samples < 100:
        return []
    record, is_sound = recording, True
    if recording.n_samples > _N_LOOKED_AT:
        record = recording.window(float(recording.time_s[0]), float(recording.time_s[_N_LOOKED_AT]))
    try:
        record = examine(record).recording
    except RecordingError:
        # most of it looks wrong: that may be because it is the voltage
        is_sound = False
    v, x = record.voltage_v, record.measured_um
    span_v, span_um = float(np.ptp(v)), float(np.ptp(x))
    if not span_v > 0.0 or not span_um > 0.0:
        return []
    found = _of_units(span_um, span_v) + _of_time(recording)
    correlation = float(np.corrcoef(v, x)[0, 1])
    scale = correlation * float(np.std(x)) / float(np.std(v))
    if float(np.std(x)) * np.sqrt(max(1.0 - correlation**2, 0.0)) <= _SAME * span_um:
        return [
            *found,
            f"displacement is {scale:.4g} times the voltage, without hysteresis or creep: is it the same column, or a "
            "monitor of the amplifier?",
        ]
    if is_sound and correlation**2 < _UNRELATED and _followed_share(v, x) < _UNRELATED:
        return [*found, "displacement has nothing to do with the voltage"]
    if falls_with_voltage(v, x):
        return [
            *found,
            "displacement falls where the voltage rises: is the sign of one reversed? "
            "--units displacement=-1um turns it",
        ]
    if correlation > _SIGN and _leads(v, x) and _noise_share(v) > _NOISIER * _noise_share(x):
        found.append("voltage lags behind displacement and is the noisier of the two: are the columns swapped?")
    return found


def _of_units(span_um: float, span_v: float) -> list[str]:
    gain, (low, high) = span_um / span_v, _GAIN_UM_PER_V
    is_plate = gain >= _PLATE_UM_PER_V and span_v <= _PLATE_V and span_um <= _PLATE_UM
    if low <= gain <= high or is_plate:
        return []
    likely = "mV read as V, or mm as um" if gain < low else "nm read as um, or kV as V"
    return [f"{gain:.3g} um/V is not what piezo actuators give ({low:g} to {high:g}): {likely}?"]


def _of_time(record: Recording) -> list[str]:
    n_sweeps = turning_points(record.voltage_v, _TURN * float(np.ptp(record.voltage_v))).size - 1
    if n_sweeps < _N_SLOW_SWEEPS or record.n_samples < _N_IN_SWEEP * n_sweeps:
        return []
    if record.sample_period_s < 1.0 / _FAST_SAMPLED_HZ:
        return []
    is_still = np.abs(np.diff(record.voltage_v)) <= _STILL * float(np.ptp(record.voltage_v))
    if float(np.mean(is_still)) > _RESTING_SHARE:
        return []  # levels held to see creep
    sweep_s = record.duration_s / n_sweeps
    return (
        [f"{n_sweeps} sweeps of {sweep_s:.3g} s each: is time in ms or us read as s?"]
        if sweep_s > _SLOW_SWEEP_S
        else []
    )


def _followed_share(v: Array, x: Array) -> float:
    """Return the share of the changes of a displacement that follow from the changes of the voltage before them [1].

    A filter of some hundred samples by least squares, long enough for a stage that rings.
    """
    n_taps = min(_N_TAPS, v.size // 20)
    drive, change = np.diff(v), np.diff(x)
    drive, change = drive - np.mean(drive), change - np.mean(change)
    n_padded = 1 << int(np.ceil(np.log2(2 * drive.size)))
    transformed = np.fft.rfft(drive, n_padded)
    own = np.fft.irfft(np.abs(transformed) ** 2, n_padded)[:n_taps]
    both = np.fft.irfft(np.conj(transformed) * np.fft.rfft(change, n_padded), n_padded)[:n_taps]
    own[0] *= 1.0 + 1e-6  # a slow drive leaves taps that cannot be told apart
    return float(both @ solve_toeplitz(own, both)) / float(change @ change)


def _leads(v: Array, x: Array) -> bool:
    """Return whether loops are run through the wrong way: displacement ahead of the voltage."""
    ends = turning_points(v, _TURN * float(np.ptp(v)))
    if ends.size <= _N_TURNS_MIN:
        return False
    a, b = (v - np.mean(v)) / float(np.ptp(v)), (x - np.mean(x)) / float(np.ptp(x))
    first, last = int(ends[1]), int(ends[-1 - (ends.size % 2)])
    a, b = a[first : last + 1], b[first : last + 1]
    area = 0.5 * float(np.sum(a[:-1] * b[1:] - a[1:] * b[:-1]))
    return area / (0.5 * (ends.size - 2)) < -_LEAD


def _noise_share(values: Array) -> float:
    return float(np.median(np.abs(np.diff(values, _ORDER)))) / float(np.ptp(values))

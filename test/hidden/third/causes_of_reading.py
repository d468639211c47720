"""The library's causes between the stage and the file: loads, temperature, a second axis, scales and hum."""

from __future__ import annotations

from typing import Any

import numpy as np

from test.hidden.third.arrays import Array
from test.hidden.third.bench import Bench, log_uniform
from test.hidden.third.effect import Effect, Values
from test.hidden.third.frame import Frame


def _record_s(frame: Frame) -> Array:
    return frame.time_s[frame.recorded]


def _load(reading_um: Array, values: Values, frame: Frame) -> Array:
    share = _record_s(frame) / frame.duration_s
    is_on = (share >= values["onset_share"][frame.index]) & (share < values["release_share"][frame.index])
    return reading_um + values["displacement_um"] * is_on


def _draw_load(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    onset = tuple(float(v) for v in rng.uniform(0.15, 0.6, 3))
    release = tuple(2.0 if rng.random() < 0.5 else float(rng.uniform(0.7, 0.95)) for _ in range(3))
    sign = float(rng.choice([-1.0, 1.0]))
    return {"displacement_um": 0.01 * sign * bench.stroke_um, "onset_share": onset, "release_share": release}


def _leak_over(reading_um: Array, values: Values, frame: Frame) -> Array:
    voltage, displacement = frame.cross_voltage_v, frame.cross_displacement_um
    second = displacement if displacement is not None else voltage
    if second is None:
        raise ValueError("cross_axis: a record without a second axis")
    return reading_um + values["gain"] * second * values["unit"][0 if displacement is not None else 1]


def _draw_cross(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    # The gain is per um; a second axis of which only the voltage is known moves as this one does.
    return {"gain": 0.01 * float(rng.choice([-1.0, 1.0])), "unit": (1.0, bench.stroke_um / bench.span_v)}


def _expand(reading_um: Array, values: Values, frame: Frame) -> Array:
    if frame.temperature_c is not None:
        return reading_um + values["um_per_c"] * (frame.temperature_c - frame.temperature_c[0])
    time_s = _record_s(frame)
    smooth = values["um_per_s"] * time_s + values["um_per_s2"] * time_s**2
    return reading_um + smooth - values["warm_up_um"] * np.expm1(-time_s / values["warm_up_s"])


def _draw_expansion(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    sign, warms_up = float(rng.choice([-1.0, 1.0])), rng.random() < 0.4
    size_um, length_s = 0.01 * sign * bench.stroke_um, bench.duration_s
    return {
        "um_per_c": size_um,
        "um_per_s": 0.0 if warms_up else size_um / length_s,
        "um_per_s2": 0.0 if warms_up else size_um / length_s**2 * float(rng.uniform(-1.0, 1.0)),
        "warm_up_um": size_um if warms_up else 0.0,
        "warm_up_s": length_s * log_uniform(rng, 0.05, 0.5),
    }


def _drift(reading_um: Array, values: Values, frame: Frame) -> Array:
    return reading_um * (1.0 + values["per_s"] * _record_s(frame))


def _curve(reading_um: Array, values: Values, frame: Frame) -> Array:
    return reading_um * (1.0 + values["quadratic_per_um"] * reading_um + values["cubic_per_um2"] * reading_um**2)


def _draw_curve(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    sign = float(rng.choice([-1.0, 1.0]))
    quadratic, cubic = ((1.0, 0.0), (0.0, 1.0), (1.0, 0.7))[int(rng.integers(3))]
    unit = 1.0 / bench.stroke_um
    return {"quadratic_per_um": 0.02 * sign * quadratic * unit, "cubic_per_um2": 0.02 * sign * cubic * unit**2}


def _interpolate(reading_um: Array, values: Values, frame: Frame) -> Array:
    phase = 2.0 * np.pi * reading_um / values["period_um"]
    first = values["sine_um"] * np.sin(phase) + values["cosine_um"] * (np.cos(phase) - 1.0)
    return reading_um + first + values["second_sine_um"] * np.sin(2.0 * phase)


def _draw_scale(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    phase, size_um = 2.0 * np.pi * rng.random(), 0.005 * bench.stroke_um
    return {
        "period_um": bench.stroke_um / log_uniform(rng, 4.0, 50.0),
        "sine_um": size_um * float(np.sin(phase)),
        "cosine_um": size_um * float(np.cos(phase)),
        "second_sine_um": 0.5 * size_um * float(rng.choice([0.0, rng.uniform(-1.0, 1.0)])),
    }


def _hum(reading_um: Array, values: Values, frame: Frame) -> Array:
    phase = 2.0 * np.pi * values["frequency_hz"] * _record_s(frame)
    for harmonic, size_um in enumerate(values["amplitudes_um"], start=1):
        own = values["phases_rad"][frame.index]
        reading_um = reading_um + size_um * np.sin(harmonic * phase + harmonic**2 * own)
    return reading_um


def _draw_hum(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    slowest_hz = min(bench.rates_hz)
    is_mains = 150.0 < slowest_hz < 50.0 * min(bench.n_samples) / 10.0
    frequency_hz = float(rng.choice([50.0, 60.0])) if is_mains else slowest_hz * float(rng.uniform(0.06, 0.3))
    sizes = (1.0, float(rng.choice([0.0, 0.3])), float(rng.choice([0.0, 0.3])))
    return {
        "frequency_hz": frequency_hz,
        "amplitudes_um": tuple(0.005 * bench.stroke_um * s for s in sizes),
        "phases_rad": tuple(float(v) for v in rng.uniform(0.0, 2.0 * np.pi, 3)),
    }


CAUSES_OF_READING = (
    Effect("external_load", _draw_load, {"reading": _load}, {"displacement_um": 1.0}),
    Effect("cross_axis", _draw_cross, {"reading": _leak_over}, {"gain": 1.0}, (0.01, 30.0), frozenset({"second_axis"})),
    Effect(
        "thermal_drift",
        _draw_expansion,
        {"reading": _expand},
        {"um_per_c": 1.0, "um_per_s": 1.0, "um_per_s2": 1.0, "warm_up_um": 1.0},
        needs=frozenset({"perhaps_temperature"}),
    ),
    Effect(
        "gain_drift",
        lambda bench, rng: {"per_s": 0.02 * float(rng.choice([-1.0, 1.0])) / bench.duration_s},
        {"reading": _drift},
        {"per_s": 1.0},
        (0.02, 20.0),
    ),
    Effect(
        "sensor_nonlinearity",
        _draw_curve,
        {"reading": _curve},
        {"quadratic_per_um": 1.0, "cubic_per_um2": 1.0},
        (0.02, 12.0),
    ),
    Effect(
        "cyclic_sensor_error",
        _draw_scale,
        {"reading": _interpolate},
        {"sine_um": 1.0, "cosine_um": 1.0, "second_sine_um": 1.0},
        (0.02, 8.0),
    ),
    Effect("mains_hum", _draw_hum, {"reading": _hum}, {"amplitudes_um": 1.0}),
)

"""What may act on a stage and has no name in docs/causes.md."""

from __future__ import annotations

from typing import Any

import numpy as np

from test.hidden.third.arrays import Array
from test.hidden.third.bench import Bench, log_uniform
from test.hidden.third.effect import Effect, Values
from test.hidden.third.frame import Frame
from test.hidden.third.linear_filters import lag
from test.hidden.third.path_dynamics import stick_slip, switched_lag


def _usual_rate(bench: Bench) -> float:
    """Return the rate of a sine over the range with fifty samples a period [V/s]."""
    return np.pi * bench.span_v / 50.0 / bench.dt_s


def _heat_itself(motion_um: Array, values: Values, frame: Frame) -> Array:
    """Expand by the power lost in the ceramic, which goes with the square of the drive's rate."""
    rate = np.diff(np.interp(frame.fine_time_s, frame.time_s, frame.command_v), prepend=0.0) / frame.step_s
    # One sample's jump is not a loss without bound: the amplifier's current is limited.
    power = np.minimum((rate / _usual_rate(frame.bench)) ** 2, 2.0)
    return motion_um + values["expansion_um"] * lag(power, values["time_constant_s"], frame.step_s)


def _tilt(reading_um: Array, values: Values, frame: Frame) -> Array:
    """Add the building's slow tilt: a narrow band of microseism, in every record another stretch of it."""
    time_s = frame.time_s[frame.recorded]
    for period_s, phase in zip(values["periods_s"], values["phases_rad"][frame.index], strict=True):
        reading_um = reading_um + values["tilt_um"] * np.sin(2.0 * np.pi * time_s / period_s + phase)
    return reading_um


def _draw_tilt(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    periods = bench.duration_s / rng.uniform(6.0, 16.0, 7)
    phases = rng.uniform(0.0, 2.0 * np.pi, (3, 7))
    return {
        "tilt_um": 0.004 * bench.stroke_um,
        "periods_s": tuple(map(float, periods)),
        "phases_rad": tuple(tuple(map(float, row)) for row in phases),
    }


def _stick(motion_um: Array, values: Values, frame: Frame) -> Array:
    return stick_slip(motion_um, values["breakaway_um"], values["left_over"])


def _depolarise(strain_um: Array, values: Values, frame: Frame) -> Array:
    """Lose a share of the response, and a little of the length, from one moment on."""
    is_after = frame.fine_time_s >= values["moment_share"][frame.index] * frame.duration_s
    steps = np.diff(strain_um) * (1.0 - values["lost_share"] * is_after[1:])
    return strain_um[0] + np.concatenate([[0.0], np.cumsum(steps)]) - values["lost_um"] * is_after


def _cross_over_at_turns(path_v: Array, values: Values, frame: Frame) -> Array:
    """Kick the voltage where the current changes its sign, which into a capacitor is where the drive turns."""
    step = np.diff(path_v, prepend=path_v[0])
    moving = np.flatnonzero(step)
    turned = moving[1:][np.sign(step[moving[1:]]) != np.sign(step[moving[:-1]])]
    kicks = np.zeros_like(path_v)
    kicks[turned] = -np.sign(step[turned])
    decay = np.exp(-np.arange(int(12.0 * frame.n_fine)) / (values["decay_samples"] * frame.n_fine))
    return path_v + values["kick_v"] * np.convolve(kicks, decay)[: path_v.size]


def _ring_cable(reading_um: Array, values: Values, frame: Frame) -> Array:
    """Add a cable's microphonics: a tone that sweeps, in bursts."""
    share = frame.time_s[frame.recorded] / frame.duration_s
    slow, fast = values["cycles"]
    for centre in values["bursts_share"][frame.index]:
        burst = np.exp(-0.5 * ((share - centre) / 0.05) ** 2)
        phase = 2.0 * np.pi * (slow * share + 0.5 * (fast - slow) * share**2)
        reading_um = reading_um + values["size_um"] * burst * np.sin(phase)
    return reading_um


def _draw_cable(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    slow = min(bench.n_samples) / rng.uniform(60.0, 120.0)
    bursts = tuple(tuple(map(float, rng.uniform(0.1, 0.9, 3))) for _ in range(3))
    cycles = (float(slow), float(slow * rng.uniform(2.0, 4.0)))
    return {"size_um": 0.01 * bench.stroke_um, "cycles": cycles, "bursts_share": bursts}


def _yield_by_stress(motion_um: Array, values: Values, frame: Frame) -> Array:
    """Add a glue that thins under shear: the more it is behind, the faster it follows."""
    time_constant_s, scale_um = values["time_constant_s"], 0.02 * frame.bench.stroke_um
    followed = switched_lag(motion_um, lambda _, gap: time_constant_s / (1.0 + (gap / scale_um) ** 2), frame.step_s)
    return motion_um + values["share"] * followed


def _miss_codes(reading_um: Array, values: Values, frame: Frame) -> Array:
    """Read by a converter whose bits weigh a little wrong: codes are missing where the large ones carry."""
    lsb_um = frame.bench.stroke_um / 2.0**14
    code = np.round(reading_um / lsb_um).astype(np.int64) + 2**15
    wrong = sum(w * ((code >> (13 - k)) & 1) for k, w in enumerate(values["bit_errors_um"]))
    zero = sum(w * ((2**15 >> (13 - k)) & 1) for k, w in enumerate(values["bit_errors_um"]))
    return np.asarray(lsb_um * (code - 2**15) + wrong - zero)


def _ripple(path_v: Array, values: Values, frame: Frame) -> Array:
    ripple = np.sin(2.0 * np.pi * values["frequency_hz"] * frame.fine_time_s + values["phases_rad"][frame.index])
    return path_v * (1.0 + values["modulation"] * ripple)


def _sag(path_v: Array, values: Values, frame: Frame) -> Array:
    """Lower the supply, and with it the gain, by the current that was drawn of late."""
    current = np.abs(np.diff(path_v, prepend=path_v[0])) / frame.step_s / _usual_rate(frame.bench)
    drawn = lag(np.minimum(current, 3.0), values["time_constant_s"], frame.step_s)
    return np.asarray(path_v / (1.0 + values["sag_share"] * drawn))


def _wow(time_s: Array, values: Values, frame: Frame) -> Array:
    phase = 2.0 * np.pi * values["cycles"] * time_s / frame.bench.duration_s
    return np.asarray(time_s + values["swing_s"] * (np.sin(phase + 1.0) - np.sin(1.0)))


UNLISTED = (
    Effect(
        "self_heating",
        lambda bench, rng: {
            "expansion_um": 0.05 * bench.stroke_um,
            "time_constant_s": bench.duration_s * log_uniform(rng, 0.02, 0.15),
        },
        {"motion": _heat_itself},
        {"expansion_um": 1.0},
    ),
    Effect("floor_tilt", _draw_tilt, {"reading": _tilt}, {"tilt_um": 1.0}),
    Effect(
        "guide_stick_slip",
        lambda bench, rng: {"breakaway_um": 0.02 * bench.stroke_um, "left_over": float(rng.uniform(0.0, 0.5))},
        {"motion": _stick},
        {"breakaway_um": 1.0},
        (0.02, 10.0),
    ),
    Effect(
        "depolarisation_step",
        lambda bench, rng: {
            "lost_share": 0.02,
            "lost_um": 0.005 * bench.stroke_um,
            "moment_share": tuple(map(float, rng.uniform(0.3, 0.7, 3))),
        },
        {"strain": _depolarise},
        {"lost_share": 1.0, "lost_um": 1.0},
        (0.05, 15.0),
    ),
    Effect(
        "crossover_at_turns",
        lambda bench, rng: {"kick_v": 0.02 * bench.span_v, "decay_samples": float(rng.uniform(1.0, 4.0))},
        {"drive": _cross_over_at_turns},
        {"kick_v": 1.0},
        (0.05, 10.0),
    ),
    Effect("cable_microphonics", _draw_cable, {"reading": _ring_cable}, {"size_um": 1.0}),
    Effect(
        "shear_thinning_glue",
        lambda bench, rng: {
            "share": 0.05,
            "time_constant_s": bench.duration_s * log_uniform(rng, 0.02, 0.2),
        },
        {"motion": _yield_by_stress},
        {"share": 1.0},
        (0.02, 10.0),
    ),
    Effect(
        "missing_codes",
        lambda bench, rng: {
            "bit_errors_um": tuple(float(0.005 * bench.stroke_um * v) for v in rng.standard_normal(5)),
        },
        {"reading": _miss_codes},
        {"bit_errors_um": 1.0},
        (0.02, 8.0),
    ),
    Effect(
        "supply_ripple_on_gain",
        lambda bench, rng: {
            "modulation": 0.01,
            "frequency_hz": min(bench.rates_hz) * log_uniform(rng, 0.01, 0.2),
            "phases_rad": tuple(map(float, rng.uniform(0.0, 2.0 * np.pi, 3))),
        },
        {"drive": _ripple},
        {"modulation": 1.0},
        (0.02, 10.0),
    ),
    Effect(
        "supply_sag",
        lambda bench, rng: {"sag_share": 0.02, "time_constant_s": bench.duration_s * log_uniform(rng, 0.01, 0.1)},
        {"drive": _sag},
        {"sag_share": 1.0},
    ),
    Effect(
        "clock_wow",
        lambda bench, rng: {"swing_s": bench.dt_s, "cycles": float(rng.uniform(3.0, 9.0))},
        {"clock": _wow},
        {"swing_s": 1.0},
        (0.05, 60.0),
    ),
)

"""The library's causes in guides, joints, masses and in the clocks between drive and sensor."""

from __future__ import annotations

from typing import Any

import numpy as np

from test.hidden.third.arrays import Array
from test.hidden.third.bench import Bench, log_uniform
from test.hidden.third.effect import Effect, Values
from test.hidden.third.frame import Frame
from test.hidden.third.linear_filters import poles, respond, ring
from test.hidden.third.path_dynamics import play


def _give_way(motion_um: Array, values: Values, frame: Frame) -> Array:
    kink_um, change = values["kink_um"], values["slope_change"]

    def bent(um: Array) -> Array:
        return um + change * np.minimum(um - kink_um, 0.0)

    # The sensor was zeroed while the stage was at rest.
    return bent(motion_um) - bent(np.zeros(1))


def _wait_at_turns(motion_um: Array, values: Values, frame: Frame) -> Array:
    return play(motion_um, 0.5 * values["gap_um"])


def _swing(motion_um: Array, values: Values, frame: Frame) -> Array:
    return ring(motion_um, values["frequency_hz"], values["damping_ratio"], frame.step_s)


def _swing_partly(motion_um: Array, values: Values, frame: Frame) -> Array:
    omega, damping, part = 2.0 * np.pi * values["frequency_hz"], values["damping_ratio"], values["participation"]
    mode = [part * values["rate_share"] / omega, part] if values["rate_share"] else [part]
    swung = respond(motion_um, mode, [omega**-2, 2.0 * damping / omega, 1.0], frame.step_s)
    return (1.0 - part) * motion_um + swung


def _smooth_reading(motion_um: Array, values: Values, frame: Frame) -> Array:
    return poles(motion_um, values["cutoff_hz"], values["n_poles"], frame.step_s)


def _delayed(time_s: Array, values: Values, frame: Frame) -> Array:
    return np.asarray(time_s - values["delay_s"])


def _skewed(time_s: Array, values: Values, frame: Frame) -> Array:
    return time_s * (1.0 + 1e-6 * values["ppm"])


def _touch(reading_um: Array, values: Values, frame: Frame) -> Array:
    if values["kind"] != "contact":
        return reading_um
    contact_um, lost, clings_um = values["contact_um"], values["stiffness_share"], values["adhesion_um"]
    out, touches = [], False
    for value in reading_um.tolist():
        touches = value > contact_um or (touches and value > contact_um - clings_um)
        out.append(value - lost * (value - contact_um) if touches else value)
    return np.array(out)


def _lose_lead(path_v: Array, values: Values, frame: Frame) -> Array:
    if values["kind"] != "lead":
        return path_v
    out, time_s = path_v.copy(), frame.fine_time_s
    for start in values["opens_share"][frame.index]:
        first, last = np.searchsorted(time_s, frame.duration_s * np.array([start, start + values["open_share"]]))
        out[first:last] = path_v[first]
    return out


def _draw_contact(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    if rng.random() < 0.6:
        clings = bench.stroke_um * float(rng.uniform(0.01, 0.05)) if rng.random() < 0.5 else 0.0
        contact_um = float(rng.uniform(0.35, 0.8)) * bench.top_um
        return {"kind": "contact", "contact_um": contact_um, "stiffness_share": 0.05, "adhesion_um": clings}
    opens = tuple(tuple((np.arange(n) + rng.uniform(0.2, 0.8, n)) / n) for n in rng.integers(2, 6, 3))
    return {"kind": "lead", "opens_share": opens, "open_share": 0.01}


def _draw_preload(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    bottom_um = float(bench.curve(np.array([bench.low_v]))[0])
    kink_um = bottom_um + bench.stroke_um * float(rng.uniform(0.2, 0.6))
    return {"kink_um": kink_um, "slope_change": 0.05 * float(rng.choice([-0.5, 1.0]))}


def _draw_mode(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    return {
        "frequency_hz": 1.0 / (log_uniform(rng, 5.0, 80.0) * bench.dt_s),
        "damping_ratio": log_uniform(rng, 0.005, 0.1),
        "participation": 0.03 * float(rng.choice([-1.0, 1.0])),
        "rate_share": float(rng.choice([0.0, rng.uniform(-0.5, 0.5)])),
    }


CAUSES_OF_STAGE = (
    Effect("lost_preload", _draw_preload, {"motion": _give_way}, {"slope_change": 1.0}, (0.02, 15.0)),
    Effect(
        "backlash",
        lambda bench, rng: {"gap_um": 0.03 * bench.stroke_um},
        {"motion": _wait_at_turns},
        {"gap_um": 1.0},
        (0.05, 6.0),
    ),
    Effect(
        "mechanical_resonance",
        lambda bench, rng: {"frequency_hz": 0.1 / bench.dt_s, "damping_ratio": log_uniform(rng, 0.005, 0.3)},
        {"motion": _swing},
        {"frequency_hz": -1.0},
        (0.2, 20.0),
    ),
    Effect("second_mode", _draw_mode, {"motion": _swing_partly}, {"participation": 1.0}, (0.02, 14.0)),
    Effect(
        "sensor_bandwidth",
        lambda bench, rng: {"cutoff_hz": 1.0 / (2.0 * np.pi * bench.dt_s), "n_poles": int(rng.integers(1, 5))},
        {"motion": _smooth_reading},
        {"cutoff_hz": -1.0},
        (0.05, 60.0),
    ),
    Effect(
        "transport_delay",
        lambda bench, rng: {"delay_s": bench.dt_s},
        {"clock": _delayed},
        {"delay_s": 1.0},
        (0.05, 60.0),
    ),
    Effect(
        "clock_skew",
        # One sample of the training record at its end.
        lambda bench, rng: {"ppm": float(rng.choice([-1e6, 1e6])) / bench.n_samples[0]},
        {"clock": _skewed},
        {"ppm": 1.0},
        (0.05, 60.0),
    ),
    Effect(
        "intermittent_contact",
        _draw_contact,
        {"drive": _lose_lead, "reading": _touch},
        {"stiffness_share": 1.0, "open_share": 1.0},
        (0.05, 10.0),
    ),
)

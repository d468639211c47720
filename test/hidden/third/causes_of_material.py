"""The library's causes in the ceramic itself: hysteresis, its past, and creep."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from test.hidden.third.arrays import Array
from test.hidden.third.bench import Bench, log_uniform
from test.hidden.third.creep_kernel import Modes, late, log_law
from test.hidden.third.effect import Effect, Values
from test.hidden.third.frame import Frame
from test.hidden.third.masing import masing
from test.hidden.third.path_dynamics import domain_walls
from test.hidden.third.virgin_curves import VirginCurve

# Nothing that acts: a model with too few elements is handed over.
MISSING = "missing_hysteresis"
# Nothing that acts either: the beginning of the drive is not recorded.
IN_MOTION = "in_motion"


def _lean(drive_v: Array, values: Values, frame: Frame) -> Array:
    """Return a response that is easier one way: a bent drive, and domains that only see it beyond a knee."""
    bench = frame.bench
    bent_v = drive_v * (1.0 + values["warp_per_v"] * drive_v + values["warp_per_v2"] * drive_v**2)
    way = values["direction"]
    beyond_v = np.maximum(way * drive_v - values["knee_v"], 0.0)
    one_sided = VirginCurve("exponential", 0.0, values["weight_um_per_v"], 0.2 * bench.reach_v)
    return bench.hysteresis_um(bent_v) + way * masing(beyond_v, one_sided)


def _draw_lean(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    kind = rng.choice(["warp", "one_sided", "both"])
    warp = 0.05 * float(rng.choice([-1.0, 1.0])) if kind != "one_sided" else 0.0
    cubic = 0.02 * rng.uniform(-1.0, 1.0) if kind == "warp" else 0.0
    way = float(rng.choice([-1.0, 1.0])) if bench.is_bipolar else 1.0
    weight = 0.2 * bench.stroke_um / bench.span_v if kind != "warp" else 0.0
    return {
        "warp_per_v": warp / bench.reach_v,
        "warp_per_v2": cubic / bench.reach_v**2,
        "weight_um_per_v": weight,
        "knee_v": float(rng.uniform(0.0, 0.5)) * bench.reach_v,
        "direction": way,
    }


def _widen(drive_v: Array, values: Values, frame: Frame) -> Array:
    stride = max(frame.n_fine // 2, 1)
    coarse_v = drive_v[::stride]
    bench = frame.bench
    moved = domain_walls(coarse_v, bench.curve, bench.reach_v, values["per_v_per_s"], stride * frame.step_s)
    return np.interp(np.arange(drive_v.size), stride * np.arange(coarse_v.size), moved)


def _excursion(frame: Frame, values: Values) -> Frame:
    """Put an excursion and a rest before the record, if it does not begin in the middle of a motion."""
    if values["kind"] == IN_MOTION:
        return frame
    n_held, n_resting = (max(int(values[k][frame.index] / frame.dt_s), 4) for k in ("held_s", "resting_s"))
    n_ramp = max(n_held // 8, 3)
    extreme_v = values["extreme_v"][frame.index]
    way = np.concatenate([np.linspace(0.0, 1.0, n_ramp), np.ones(n_held), np.linspace(1.0, 0.0, n_ramp)])
    past_v = np.concatenate([extreme_v * way, np.zeros(n_resting)])
    return replace(frame, command_v=np.concatenate([past_v, frame.command_v]), n_past=past_v.size + frame.n_past)


def _draw_past(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    if rng.random() < 0.4:
        return {"kind": IN_MOTION}
    lengths_s = [n / r for n, r in zip(bench.n_samples, bench.rates_hz, strict=True)]
    way = -1.0 if bench.is_bipolar and rng.random() < 0.5 else 1.0
    return {
        "kind": "excursion",
        "extreme_v": tuple(0.4 * way * bench.high_v * rng.uniform(0.7, 1.0) for _ in lengths_s),
        "held_s": tuple(float(t * log_uniform(rng, 0.03, 0.3)) for t in lengths_s),
        "resting_s": tuple(float(t * log_uniform(rng, 0.003, 0.1)) for t in lengths_s),
    }


def _settle_otherwise(strain_um: Array, values: Values, frame: Frame) -> Array:
    span_s = float(np.ptp(frame.fine_time_s))
    if values["kind"] == "log":
        law = log_law(values["onset_s"], frame.step_s, span_s)
        return strain_um + values["per_decade"] * law.respond(strain_um, frame.step_s)
    spread = Modes(1.0, np.array(values["shares"]), np.array(values["times_s"]))
    return spread.respond(strain_um, frame.step_s)


def _draw_creep(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    shortest_s, longest_s = 10.0 * bench.dt_s, bench.duration_s / 4.0
    if rng.random() < 0.5:
        return {"kind": "log", "per_decade": 0.02, "onset_s": log_uniform(rng, shortest_s, longest_s)}
    times_s = np.geomspace(shortest_s, longest_s, int(rng.integers(2, 4))) * rng.uniform(0.7, 1.4)
    shares = tuple(float(0.01 * rng.uniform(0.5, 1.5)) for _ in times_s)
    return {"kind": "spread", "shares": shares, "times_s": tuple(float(t) for t in times_s)}


def _creep_of_large(strain_um: Array, values: Values, frame: Frame) -> Array:
    """Return creep of what a large step moves more than in proportion, in log time."""
    reach_um = values["reach_um"]
    if values["kind"] == "switched":
        switched = masing(strain_um, VirginCurve("exponential", 0.0, 1.0, reach_um))
        gain = values["switched_per_decade"]
    else:
        # Twice the half step squared, from turn to turn: y |y| / 2 of a step from a turn.
        switched = masing(strain_um, lambda um: np.asarray(um * np.abs(um)))
        gain = values["per_decade_per_um"]
    law = log_law(values["onset_s"], frame.step_s, float(np.ptp(frame.fine_time_s)))
    return np.asarray(gain * law.respond(switched, frame.step_s))


def _draw_large(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    return {
        "kind": str(rng.choice(["switched", "quadratic"])),
        "switched_per_decade": 0.02,
        "per_decade_per_um": 0.02 / bench.stroke_um,
        "onset_s": log_uniform(rng, 0.3, 3.0) * bench.dt_s,
        "reach_um": bench.stroke_um * float(rng.uniform(0.2, 0.8)),
    }


def _yield_slowly(motion_um: Array, values: Values, frame: Frame) -> Array:
    return motion_um + values["amplitude"] * late(motion_um, frame.step_s, values["time_constant_s"])


CAUSES_OF_MATERIAL = (
    Effect(
        "asymmetric_hysteresis",
        _draw_lean,
        {"hysteresis": _lean},
        {"warp_per_v": 1.0, "warp_per_v2": 1.0, "weight_um_per_v": 1.0},
        (0.01, 6.0),
    ),
    Effect(MISSING, lambda bench, rng: {"n_elements": int(rng.integers(1, 4))}),
    Effect(
        "rate_dependent_hysteresis",
        # At the rate of a sine with fifty samples a period, thresholds are a fifth wider.
        lambda bench, rng: {"per_v_per_s": 0.2 * 50.0 * bench.dt_s / (np.pi * bench.span_v)},
        {"hysteresis": _widen},
        {"per_v_per_s": 1.0},
        (0.05, 1000.0),
        frozenset({"smooth"}),
    ),
    Effect("initial_state", _draw_past, {}, {"extreme_v": 1.0}, (0.05, 2.4), before=_excursion),
    Effect("creep_law", _draw_creep, {"creep": _settle_otherwise}, {"per_decade": 1.0, "shares": 1.0}, (0.1, 15.0)),
    Effect(
        "amplitude_dependent_creep",
        _draw_large,
        {"late": _creep_of_large},
        {"switched_per_decade": 1.0, "per_decade_per_um": 1.0},
        (0.02, 15.0),
    ),
    Effect(
        "slow_relaxation",
        lambda bench, rng: {
            "amplitude": 0.03,
            "time_constant_s": log_uniform(rng, 10.0 * bench.dt_s, bench.duration_s / 8.0),
        },
        {"motion": _yield_slowly},
        {"amplitude": 1.0},
        (0.05, 15.0),
    ),
)

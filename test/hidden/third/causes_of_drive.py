"""The library's causes on the way from the command to the ceramic, as a laboratory would meet them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from test.hidden.third.arrays import Array
from test.hidden.third.bench import Bench, log_uniform
from test.hidden.third.effect import Effect, Values
from test.hidden.third.frame import Frame
from test.hidden.third.linear_filters import lag, respond, ring
from test.hidden.third.path_dynamics import slew_limited, switched_lag

# A lag of one sample, as a cutoff, is where strength one lies for all that is late.
_LAGS = (0.05, 60.0)


def _quantise(command_v: Array, values: Values, frame: Frame) -> Array:
    step_v = values["step_v"]
    return np.asarray(step_v * np.round(command_v / step_v - values["cut_share"]))


def _hold(command_v: Array, values: Values, frame: Frame) -> Array:
    n_held = max(round(values["hold_s"] / frame.bench.slowest_dt_s), 1)
    n_held = round(n_held * frame.bench.slowest_dt_s / frame.dt_s)
    updates = np.arange(command_v.size)
    # The converter's clock starts with the record.
    held = np.maximum((updates - frame.n_past) // n_held * n_held + frame.n_past, 0)
    return np.repeat(command_v[held], frame.n_fine)[: frame.fine_time_s.size]


def _slew(path_v: Array, values: Values, frame: Frame) -> Array:
    return slew_limited(path_v, values["slew_v_per_s"] * frame.step_s)


def _charge(path_v: Array, values: Values, frame: Frame) -> Array:
    return lag(path_v, 1.0 / (2.0 * math.pi * values["cutoff_hz"]), frame.step_s)


def _ring(path_v: Array, values: Values, frame: Frame) -> Array:
    return ring(path_v, values["frequency_hz"], values["damping_ratio"], frame.step_s)


def _lag_unequally(path_v: Array, values: Values, frame: Frame) -> Array:
    rising_s, falling_s = values["rising_s"], values["falling_s"]
    return switched_lag(path_v, lambda _, behind: rising_s if behind > 0.0 else falling_s, frame.step_s)


def _charge_what_varies(path_v: Array, values: Values, frame: Frame) -> Array:
    time_constant_s, per_v = values["time_constant_s"], values["per_v"]
    return switched_lag(path_v, lambda at_v, _: time_constant_s * max(1.0 + per_v * at_v, 0.02), frame.step_s)


def _saturate(path_v: Array, values: Values, frame: Frame) -> Array:
    bench = frame.bench
    low_v = bench.low_v + values["low_share"] * bench.span_v if values["low_share"] else -np.inf
    return np.clip(path_v, low_v, bench.high_v - values["high_share"] * bench.span_v)


def _cross_over(path_v: Array, values: Values, frame: Frame) -> Array:
    return np.asarray(np.sign(path_v) * np.maximum(np.abs(path_v) - values["half_width_v"], 0.0))


def _leak(path_v: Array, values: Values, frame: Frame) -> Array:
    time_constant_s = values["time_constant_s"]
    return respond(path_v, [time_constant_s, 0.0], [time_constant_s, 1.0], frame.step_s)


def _draw_slew(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    # A sine over the range with fifty samples a period goes at this rate at most.
    return {"slew_v_per_s": math.pi * bench.span_v / 50.0 / bench.dt_s}


def _draw_unequal(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    ratio = log_uniform(rng, 1.7, 5.0) ** float(rng.choice([-0.5, 0.5]))
    return {"rising_s": bench.dt_s * ratio, "falling_s": bench.dt_s / ratio}


def _draw_varying(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    # Within the range the capacitance changes by up to this share of what it is at zero volts.
    share = float(rng.choice([rng.uniform(0.5, 1.5), rng.uniform(-0.7, -0.35)]))
    return {"time_constant_s": bench.dt_s, "per_v": share / bench.reach_v}


def _draw_saturation(bench: Bench, rng: np.random.Generator) -> dict[str, Any]:
    both = bench.low_v < 0.0 and rng.random() < 0.5
    return {"high_share": 0.03, "low_share": 0.03 * rng.uniform(0.5, 1.0) if both else 0.0}


CAUSES_OF_DRIVE = (
    Effect(
        "dac_quantization",
        lambda bench, rng: {"step_v": bench.span_v / 500.0, "cut_share": float(rng.choice([0.0, 0.5]))},
        {"command": _quantise},
        {"step_v": 1.0},
        (0.05, 30.0),
    ),
    Effect(
        "zero_order_hold",
        lambda bench, rng: {"hold_s": 3.0 * bench.slowest_dt_s},
        {"path": _hold},
        {"hold_s": 1.0},
        (0.5, 20.0),
    ),
    Effect("amplifier_slew_limit", _draw_slew, {"drive": _slew}, {"slew_v_per_s": -1.0}, (0.02, 1000.0)),
    Effect(
        "amplifier_bandwidth",
        lambda bench, rng: {"cutoff_hz": 1.0 / (2.0 * math.pi * bench.dt_s)},
        {"drive": _charge},
        {"cutoff_hz": -1.0},
        _LAGS,
    ),
    Effect(
        "drive_resonance",
        lambda bench, rng: {"frequency_hz": 0.1 / bench.dt_s, "damping_ratio": log_uniform(rng, 0.05, 0.6)},
        {"drive": _ring},
        {"frequency_hz": -1.0},
        (0.2, 30.0),
    ),
    Effect("unequal_lag", _draw_unequal, {"drive": _lag_unequally}, {"rising_s": 1.0, "falling_s": 1.0}, _LAGS),
    Effect(
        "voltage_dependent_capacitance", _draw_varying, {"drive": _charge_what_varies}, {"time_constant_s": 1.0}, _LAGS
    ),
    Effect(
        "amplifier_saturation",
        _draw_saturation,
        {"drive": _saturate},
        {"high_share": 1.0, "low_share": 1.0},
        (0.1, 8.0),
    ),
    Effect(
        "dead_zone",
        lambda bench, rng: {"half_width_v": 0.01 * bench.span_v},
        {"drive": _cross_over},
        {"half_width_v": 1.0},
        (0.05, 10.0),
        frozenset({"bipolar"}),
    ),
    Effect(
        "charge_leak",
        lambda bench, rng: {"time_constant_s": 10.0 * bench.duration_s},
        {"drive": _leak},
        {"time_constant_s": -1.0},
        (0.02, 50.0),
    ),
)

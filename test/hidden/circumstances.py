"""What is particular to each record: weather, second axis, hands that touch, and what was done before."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from test.hidden.hysteresis import draw_plane
from test.hidden.world import Circumstance, Load


def temperature(n_samples: int, rate_hz: float, rng: np.random.Generator) -> np.ndarray:
    """Draw a room's temperature [degC] since its start: a trend, a slow swing, a door opened."""
    time_s = np.arange(n_samples) / rate_hz
    span = time_s[-1]
    swing_hz = rng.uniform(0.7, 2.5) / span
    phase = rng.uniform(0.0, 2.0 * np.pi)
    room = rng.normal(0.0, 0.4) * time_s / span
    room += rng.uniform(0.1, 0.4) * (np.sin(2.0 * np.pi * swing_hz * time_s + phase) - np.sin(phase))
    since = np.maximum(time_s - rng.uniform(0.1, 0.6) * span, 0.0)
    return room - rng.uniform(0.0, 0.5) * (1.0 - np.exp(-since / (0.15 * span)))


def second_axis(n_samples: int, rate_hz: float, is_voltage: bool, rng: np.random.Generator) -> np.ndarray:
    """Draw what the second axis did: moves and pauses, as voltage [V] or displacement [um]."""
    drive = [np.zeros(round(rng.uniform(0.2, 1.5) * rate_hz))]
    total, now = drive[0].size, 0.0
    while total < n_samples:
        goal = rng.uniform(-2.5, 2.5)
        n_move = round(np.exp(rng.uniform(np.log(0.02), np.log(3.0))) * rate_hz)
        n_stay = round(rng.uniform(0.05, 1.5) * rate_hz)
        drive += [now + (goal - now) * np.arange(1, n_move + 1) / n_move, np.full(n_stay, goal)]
        total += n_move + n_stay
        now = goal
    voltage_v = np.concatenate(drive)[:n_samples]
    if is_voltage:
        return voltage_v
    return draw_plane(8.0, 0.12, 5.0, rng).run(voltage_v)


def loads(size_um: float, duration_s: float, rng: np.random.Generator) -> tuple[Load, ...]:
    """Draw when a weight is put on and, mostly, taken off again."""
    on_s = rng.uniform(0.15, 0.6) * duration_s
    rise_s = rng.uniform(2e-3, 20e-3)
    first = Load(on_s, rise_s, size_um)
    if rng.random() < 0.25:
        return (first,)
    off_s = on_s + rng.uniform(0.12, 0.35) * duration_s
    return (first, Load(off_s, rise_s, -size_um))


def excursion(level_v: float, hold_s: float, wait_s: float, rate_hz: float) -> np.ndarray:
    """Return the drive [V] of an earlier move to a level and back, up to one sample before the start."""
    n_move = max(2, round(0.25 * rate_hz))
    up = level_v * np.arange(n_move + 1) / n_move
    stay, after = np.full(round(hold_s * rate_hz), level_v), np.zeros(max(1, round(wait_s * rate_hz)))
    return np.concatenate([up, stay, up[::-1], after])


def draw_circumstance(
    effects: Mapping[str, Mapping[str, Any]],
    n_samples: int,
    rate_hz: float,
    part: str,
    in_all_parts: bool,
    *,
    has_temperature: bool,
    cross_kind: str,
    has_offset: bool,
    rng: np.random.Generator,
) -> Circumstance:
    """Draw the circumstance of one record.

    Args:
        effects: causes with their parameters.
        n_samples: length of the record.
        rate_hz: rate of the record [Hz].
        part: "train", "test" or "report".
        in_all_parts: whether loads and earlier excursions befall the held-out records too.
        has_temperature: whether a thermometer was recorded.
        cross_kind: what of the second axis was recorded: "none", "displacement" or "voltage".
        has_offset: whether the sensor's zero is arbitrary.
        rng: source of chance.
    """
    # A stream for each, so that one effect more or less changes nothing of the others.
    streams = [np.random.default_rng(rng.integers(2**63)) for _ in range(6)]
    befalls = part == "train" or in_all_parts
    duration_s = n_samples / rate_hz
    before_v: np.ndarray = np.zeros(0)
    if "initial_state" in effects and befalls:
        earlier = effects["initial_state"]
        share = 1.0 if part == "train" else streams[0].uniform(0.5, 1.0)
        before_v = excursion(share * earlier["level_v"], earlier["hold_s"], earlier["wait_s"], rate_hz)
    touched: tuple[Load, ...] = ()
    if "external_load" in effects and befalls:
        touched = loads(effects["external_load"]["size_um"], duration_s, streams[1])
    return Circumstance(
        before_v=before_v,
        loads=touched,
        temperature_c=temperature(n_samples, rate_hz, streams[2]) if has_temperature else None,
        cross=None if cross_kind == "none" else second_axis(n_samples, rate_hz, cross_kind == "voltage", streams[3]),
        hum_phase=streams[4].uniform(0.0, 2.0 * np.pi),
        offset_um=streams[5].uniform(-1.0, 1.0) if has_offset else 0.0,
    )

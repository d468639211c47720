"""What is particular to each record: weather, second axis, hands that touch, and what was done before."""

from __future__ import annotations

import numpy as np

from test.hidden.second.actuator import Circumstance, Effects, Load
from test.hidden.second.scale import Scale


def temperature_c(n: int, rng: np.random.Generator) -> np.ndarray:
    """Draw a room's temperature [degC] since the record's start: a slow wander, shape (n,)."""
    knots = np.cumsum(rng.normal(0.0, 0.25, 9))
    along = np.linspace(0.0, 8.0, n)
    smooth = np.interp(along, np.arange(9), knots)
    width = max(3, n // 10)
    smooth = np.convolve(np.pad(smooth, width, mode="edge"), np.hanning(width) / np.hanning(width).sum(), "same")
    return smooth[width:-width] - smooth[width]


def second_axis(n: int, rng: np.random.Generator) -> np.ndarray:
    """Draw what a second axis did in shares of its range: moves and pauses, shape (n,)."""
    out, now = [np.zeros(round(rng.uniform(0.02, 0.1) * n))], 0.0
    while sum(piece.size for piece in out) < n:
        goal = rng.uniform(0.0, 1.0)
        n_move, n_stay = round(rng.uniform(0.01, 0.12) * n) + 2, round(rng.uniform(0.005, 0.1) * n) + 1
        turn = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, n_move + 1) / n_move)
        out += [now + (goal - now) * turn, np.full(n_stay, goal)]
        now = goal
    return np.concatenate(out)[:n]


def excursion(level_v: float, held: int, rested: int) -> np.ndarray:
    """Return the drive [V] of an earlier move to a level and back, up to one sample before the start."""
    way = level_v * np.arange(41) / 40.0
    return np.concatenate([way, np.full(held, level_v), way[::-1], np.zeros(max(1, rested))])


def loads(size_um: float, duration_s: float, step_s: float, rng: np.random.Generator) -> tuple[Load, ...]:
    """Draw when a weight is put on and, mostly, taken off again."""
    on_s, rise_s = rng.uniform(0.15, 0.5) * duration_s, rng.uniform(0.5, 5.0) * step_s
    first = Load(on_s, rise_s, size_um)
    if rng.random() < 0.25:
        return (first,)
    return (first, Load(on_s + rng.uniform(0.12, 0.35) * duration_s, rise_s, -size_um))


def openings(share: float, many: int, duration_s: float, rng: np.random.Generator) -> tuple[tuple[float, float], ...]:
    """Draw when the lead has no contact: begin and end [s] of each time, apart from one another."""
    slots = np.sort(rng.choice(np.arange(2, 19), many, replace=False)) / 20.0
    begins = (slots + rng.uniform(0.0, 0.015, many)) * duration_s
    return tuple((float(b), float(b + share * duration_s * rng.uniform(0.7, 1.3))) for b in begins)


def draw_circumstance(
    effects: Effects, scale: Scale, n: int, step_s: float, *, befalls: bool, rng: np.random.Generator
) -> Circumstance:
    """Draw the circumstance of one record.

    Args:
        effects: causes with their parameters.
        scale: of the bench.
        n: samples of the record.
        step_s: time between them [s].
        befalls: whether loads and earlier excursions befall this record.
        rng: source of chance.
    """
    # A stream for each, so that one effect more or less changes nothing of the others.
    streams = [np.random.default_rng(rng.integers(2**63)) for _ in range(7)]
    before_v, touched, open_s, room, cross = np.zeros(0), (), (), None, None
    if "initial_state" in effects and befalls:
        earlier = effects["initial_state"]
        # Seconds are those of the training record, whatever this one's length and rate.
        held, rested = (round(earlier[name] / step_s) for name in ("held_s", "rested_s"))
        before_v = excursion(earlier["level_v"], held, rested)
    if "external_load" in effects and befalls:
        touched = loads(effects["external_load"]["size_um"], n * step_s, step_s, streams[1])
    if "intermittent_contact" in effects:
        bad = effects["intermittent_contact"]
        open_s = openings(bad["share_of_record"], bad["n_openings"], n * step_s, streams[2])
    if "um_per_degc" in effects.get("thermal_drift", {}):
        room = temperature_c(n, streams[3])
    if "cross_axis" in effects:
        unit = scale.stroke_um if effects["cross_axis"]["kind"] == "displacement" else scale.span_v
        cross = unit * second_axis(n, streams[4])
    return Circumstance(
        before_v=before_v,
        loads=touched,
        temperature_c=room,
        cross=cross,
        hum_phases=tuple(streams[5].uniform(0.0, 2.0 * np.pi, 3)),
        open_s=open_s,
        offset_um=scale.stroke_um * streams[6].uniform(-0.3, 0.3),
    )

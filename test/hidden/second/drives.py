"""What laboratories drive their stages with: seven kinds, joined to programmes.

A drive is the voltage at the samples, straight between them. All lengths are in samples, for what a record can
show depends on them and not on seconds. Levels are shares of the range: 0 its lower end, 1 its upper.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import butter, sosfiltfilt

from test.hidden.second.scale import Scale, log_uniform

_LEAD_IN = 0.02  # share of a piece in which the drive goes to where it begins
_SHORT_RECORD = 1000  # samples below which a programme has fewer pieces


def triangles(n: int, reach: float, rng: np.random.Generator) -> np.ndarray:
    """Sweep straight to and fro, ever less far, with a small loop inside each sweep."""
    n_sweeps = int(rng.integers(3, 7))
    centre, turns = rng.uniform(0.4, 0.6), [0.0]
    for k in range(n_sweeps):
        shrink = reach * (1.0 - 0.8 * k / n_sweeps)
        top, bottom = centre + (1.0 - centre) * shrink, centre - centre * shrink
        way, back = rng.uniform(0.4, 0.8), rng.uniform(0.1, 0.35)
        inner = bottom + way * (top - bottom)
        turns += [bottom, inner, inner - back * (top - bottom), top]
    return _polyline(np.array(turns[1:]), n)


def chirp(n: int, reach: float, rng: np.random.Generator) -> np.ndarray:
    """Swing ever faster, from some periods in all to one in ten or thirty samples."""
    slow, fast = rng.uniform(1.0, 3.0) / n, 1.0 / rng.uniform(10.0, 30.0)
    k = np.arange(n)
    growth = np.log(fast / slow) / n
    phase = 2.0 * np.pi * slow * np.expm1(growth * k) / growth
    # Less and less far once the whole way has been gone there and back.
    later = np.maximum(phase / (2.0 * np.pi) - 1.0, 0.0)
    swing = 0.5 * reach * (1.0 - rng.uniform(0.3, 0.9) * later / later[-1])
    return 0.5 - swing * np.cos(phase)


def raster(n: int, reach: float, rng: np.random.Generator) -> np.ndarray:
    """Scan lines with a fast triangle while the field shifts line by line."""
    period = int(rng.integers(16, 100))
    width = rng.uniform(0.3, 0.7) * reach
    k = np.arange(n)
    line = np.abs((k % period) / period * 2.0 - 1.0)
    field = (k // period) / max(1, (n - 1) // period)
    return 0.5 + 0.5 * reach * (2.0 * field - 1.0) * (1.0 - width / reach) + width * (line - 0.5)


def staircase(n: int, reach: float, rng: np.random.Generator) -> np.ndarray:
    """Climb and descend in equal steps, each held."""
    n_steps = int(rng.integers(4, 11))
    up = np.arange(n_steps + 1) / n_steps
    levels = 0.5 + reach * (np.concatenate([up, up[-2::-1]]) - 0.5)
    return levels[np.minimum(np.arange(n) * levels.size // n, levels.size - 1)]


def random_steps(n: int, reach: float, rng: np.random.Generator) -> np.ndarray:
    """Step to levels at random, each held for a time at random."""
    levels = np.empty(0)
    while levels.size < n:
        held = round(log_uniform(rng, max(8.0, n / 100.0), n / 5.0))
        levels = np.append(levels, np.full(held, 0.5 + reach * (rng.random() - 0.5)))
    return levels[:n]


def noise_band(n: int, reach: float, rng: np.random.Generator) -> np.ndarray:
    """Follow noise of a limited band."""
    edge = 1.0 / log_uniform(rng, 20.0, max(30.0, n / 40.0))
    wave = sosfiltfilt(butter(3, 2.0 * edge, output="sos"), rng.standard_normal(n))
    wave = np.clip(wave / np.std(wave), -2.5, 2.5)
    return 0.5 + reach * ((wave - wave.min()) / np.ptp(wave) - 0.5)


def multisine(n: int, reach: float, rng: np.random.Generator) -> np.ndarray:
    """Repeat one sum of sines of random phase, at least twice."""
    period = n // int(rng.integers(2, 5))
    lines = np.unique(np.round(np.geomspace(1.0, max(3.0, period / rng.uniform(12.0, 40.0)), 24)).astype(int))
    phase = rng.uniform(0.0, 2.0 * np.pi, lines.size)
    angle = 2.0 * np.pi * np.arange(n)[:, None] * lines / period
    wave = np.sum(np.cos(angle + phase) / np.sqrt(lines), axis=1)
    return 0.5 + 0.5 * reach * wave / np.max(np.abs(wave))


KINDS: dict[str, Callable[[int, float, np.random.Generator], np.ndarray]] = {
    "triangles": triangles,
    "chirp": chirp,
    "raster": raster,
    "staircase": staircase,
    "random_steps": random_steps,
    "noise_band": noise_band,
    "multisine": multisine,
}
_WIDE = ("triangles", "noise_band", "chirp")  # meet every threshold of the range


def draw_kinds(part: str, n_samples: int, used: tuple[str, ...], rng: np.random.Generator) -> tuple[str, ...]:
    """Draw the kinds of a record's programme; a held-out record has kinds the training has not."""
    if part == "train":
        first = _WIDE[int(rng.integers(len(_WIDE)))]
        n_more = int(rng.integers(2, 4)) if n_samples >= _SHORT_RECORD else 1
        others = [kind for kind in KINDS if kind != first]
        return (first, *rng.choice(others, n_more, replace=False).tolist())
    fresh = [kind for kind in KINDS if kind not in used]
    n_kinds = int(rng.integers(1, 3)) if n_samples >= _SHORT_RECORD else 1
    return tuple(rng.choice(fresh, min(n_kinds, len(fresh)), replace=False).tolist())


def programme(scale: Scale, n_samples: int, kinds: tuple[str, ...], part: str, rng: np.random.Generator) -> np.ndarray:
    """Return a drive [V] of some kinds one after the other, from rest at 0 V and, mostly, back to it."""
    rest = max(2, round(rng.uniform(0.01, 0.03) * n_samples))
    zero = -scale.low_v / scale.span_v
    n_tail = round(rng.uniform(0.03, 0.1) * n_samples) if rng.random() < 0.7 else 0
    lengths = rng.uniform(0.7, 1.3, len(kinds))
    lengths = np.round(lengths / lengths.sum() * (n_samples - rest - n_tail)).astype(int)
    lengths[-1] = n_samples - rest - n_tail - lengths[:-1].sum()
    pieces, now = [np.full(rest, zero)], zero
    for which, (kind, n) in enumerate(zip(kinds, lengths, strict=True)):
        # The first of the training covers the whole range, so that no other record leaves what was learnt.
        reach = 1.0 if part == "train" and which == 0 else rng.uniform(0.55, 0.97)
        n_lead = max(4, round(_LEAD_IN * n))
        levels = KINDS[kind](n - n_lead, reach, rng)
        pieces += [now + (levels[0] - now) * np.arange(1, n_lead + 1) / n_lead, levels]
        now = levels[-1]
    if n_tail:
        n_lead = max(4, n_tail // 4)
        pieces += [now + (zero - now) * np.arange(1, n_lead + 1) / n_lead, np.full(n_tail - n_lead, zero)]
    levels = np.clip(np.concatenate(pieces)[:n_samples], 0.0, 1.0)
    drive_v = scale.low_v + scale.span_v * levels
    drive_v[:rest] = 0.0
    return drive_v


def _polyline(turns: np.ndarray, n: int) -> np.ndarray:
    """Return n samples along straight lines from turn to turn, at one speed."""
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(turns)))])
    return np.interp(np.linspace(0.0, way[-1], n), way, turns)

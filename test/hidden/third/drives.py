"""Drives as laboratories make them, over -1 to 1 and sample by sample."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from scipy.signal import butter, sawtooth, sosfiltfilt

from test.hidden.third.arrays import Array
from test.hidden.third.bench import Bench

Shape = Callable[[np.random.Generator, int], Array]


def _falling_sines(rng: np.random.Generator, n: int) -> Array:
    share = np.arange(n) / n
    return (1.0 - rng.uniform(0.6, 0.95) * share) * np.sin(2.0 * np.pi * rng.integers(4, 15) * share)


def _triangle(rng: np.random.Generator, n: int) -> Array:
    cycles = rng.uniform(2.0, 12.0)
    return np.asarray(sawtooth(2.0 * np.pi * cycles * np.arange(n) / n + 0.5 * np.pi, width=0.5))


def _staircase(rng: np.random.Generator, n: int) -> Array:
    rising = np.linspace(-1.0, 1.0, int(rng.integers(4, 10)))
    cycle = np.concatenate([rising, rising[-2:0:-1]])
    levels = np.tile(cycle, int(rng.integers(1, 3)))
    return levels[np.minimum(np.arange(n) * levels.size // n, levels.size - 1)]


def _random_steps(rng: np.random.Generator, n: int) -> Array:
    clock = max(n // int(rng.integers(20, 80)), 3)
    n_levels = -(-n // clock)
    two = rng.choice([-0.8, 0.8], n_levels)
    levels = two if rng.random() < 0.5 else rng.uniform(-1.0, 1.0, n_levels)
    return np.repeat(levels, clock)[:n]


def _chirp(rng: np.random.Generator, n: int) -> Array:
    low, high = rng.uniform(1.0, 4.0) / n, 1.0 / rng.uniform(15.0, 70.0)
    growth = np.log(high / low)
    phase = low * n / growth * np.expm1(growth * np.arange(n) / n)
    return rng.uniform(0.5, 1.0) * np.sin(2.0 * np.pi * phase)


def _raster(rng: np.random.Generator, n: int) -> Array:
    lines, flyback = int(rng.integers(6, 25)), rng.uniform(0.1, 0.3)
    scan = sawtooth(2.0 * np.pi * lines * np.arange(n) / n, width=1.0 - flyback)
    slow = rng.uniform(0.0, 0.4)
    return np.asarray((1.0 - slow) * scan + slow * np.linspace(-1.0, 1.0, n))


def _band_noise(rng: np.random.Generator, n: int) -> Array:
    sos = butter(4, 2.0 / rng.uniform(30.0, 200.0), output="sos")
    noise = sosfiltfilt(sos, rng.standard_normal(n))
    return np.asarray(noise / np.max(np.abs(noise)))


def _tones(rng: np.random.Generator, n: int) -> Array:
    cycles = np.exp(rng.uniform(np.log(2.0), np.log(n / 30.0), int(rng.integers(3, 7))))
    phase = 2.0 * np.pi * (cycles[:, None] * np.arange(n) / n + rng.random((cycles.size, 1)))
    total = rng.uniform(0.3, 1.0, cycles.size) @ np.sin(phase)
    return np.asarray(total / np.max(np.abs(total)))


def _hand_typed(rng: np.random.Generator, n: int) -> Array:
    n_points = int(rng.integers(8, 26))
    dwell = rng.lognormal(0.0, 0.7, n_points)
    ends = np.maximum(np.round(np.cumsum(dwell) / dwell.sum() * n).astype(int), 1)
    levels = np.round(rng.uniform(-1.0, 1.0, n_points), 1)
    return levels[np.minimum(np.searchsorted(ends, np.arange(n), side="right"), n_points - 1)]


SMOOTH: Mapping[str, Shape] = {
    "falling_sines": _falling_sines,
    "triangle": _triangle,
    "chirp": _chirp,
    "raster": _raster,
    "band_noise": _band_noise,
    "tones": _tones,
}
STEPPED: Mapping[str, Shape] = {
    "staircase": _staircase,
    "random_steps": _random_steps,
    "hand_typed": _hand_typed,
}


def draw_kinds(rng: np.random.Generator, is_smooth: bool) -> tuple[tuple[str, ...], ...]:
    """Draw which kinds of drive follow each other in each of three records.

    A careful lab trains on steps and motion, a hasty one on one kind; what is held out is mostly of other kinds.

    Args:
        rng: source of chance.
        is_smooth: whether to do without steps.
    """
    smooth, stepped = rng.permutation(list(SMOOTH)), rng.permutation(list(STEPPED))
    if is_smooth:
        order = [str(k) for k in smooth]
        return tuple(order[:2]), tuple(order[2:4]), tuple(order[4:6])
    if rng.random() < 0.25:
        single = [str(k) for k in rng.permutation([*SMOOTH, *STEPPED])]
        return (single[0],), tuple(single[1:3]), tuple(single[3:5])
    train = (str(stepped[0]), str(smooth[0]), *((str(smooth[1]),) if rng.random() < 0.4 else ()))
    return train, (str(smooth[2]), str(stepped[1]))[:: int(rng.choice([-1, 1]))], (str(smooth[3]), str(stepped[2]))


def draw_drive(rng: np.random.Generator, kinds: tuple[str, ...], n: int, bench: Bench) -> Array:
    """Draw a drive from zero volts through one kind after the other, ramps between them [V].

    Args:
        rng: source of chance.
        kinds: of SMOOTH and STEPPED.
        n: number of samples.
        bench: whose range it takes.
    """
    n_ramp = max(n // 60, 5)
    rest = n // 20 if rng.random() < 0.4 else 1
    shares = rng.dirichlet(np.full(len(kinds), 20.0))
    left = n - rest - n_ramp * len(kinds)
    lengths = np.floor(shares * left).astype(int)
    lengths[-1] += left - int(lengths.sum())
    middle_v, half_v = 0.5 * (bench.low_v + bench.high_v), 0.5 * bench.span_v
    parts, at_v = [np.zeros(rest)], 0.0
    for k, kind in enumerate(kinds):
        # The first part takes the whole range, so that every later one lies within what was learned.
        size = 1.0 if k == 0 else float(rng.uniform(0.7, 1.0))
        part = middle_v + half_v * size * {**SMOOTH, **STEPPED}[kind](rng, int(lengths[k]))
        parts += [at_v + (part[0] - at_v) * np.arange(n_ramp) / n_ramp, part]
        at_v = float(part[-1])
    return np.concatenate(parts)

"""Drives of the hidden-effect records: what a careful person would apply, and what a careless one would.

A drive is the command at the record's samples; between samples it is linear. Every drive starts at 0 V.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

EXCITATIONS = (
    "rich",
    "short",
    "slow_triangle",
    "single_sine",
    "slow_sines",
    "level_hold",
    "steps_only",
    "staircase_only",
    "multisine_only",
)


class Drive:
    """A drive under construction: pieces joined by straight lines at a slope the amplifier takes easily."""

    def __init__(self, low_v: float, high_v: float, rate_hz: float) -> None:
        self.low_v, self.high_v, self.rate_hz = low_v, high_v, rate_hz
        self.pieces: list[np.ndarray] = [np.zeros(1)]

    @property
    def now_v(self) -> float:
        """Last value [V]."""
        return float(self.pieces[-1][-1])

    def level(self, fraction: float) -> float:
        """Return the voltage at a fraction of the range."""
        return self.low_v + fraction * (self.high_v - self.low_v)

    def line(self, to_v: float, slope_v_per_s: float) -> None:
        """Go straight to a value."""
        n = max(1, round(abs(to_v - self.now_v) / slope_v_per_s * self.rate_hz))
        self.pieces.append(self.now_v + (to_v - self.now_v) * np.arange(1, n + 1) / n)

    def hold(self, duration_s: float) -> None:
        """Stay."""
        self.pieces.append(np.full(max(1, round(duration_s * self.rate_hz)), self.now_v))

    def append(self, values_v: np.ndarray) -> None:
        """Append samples, led in by a straight line."""
        self.line(float(values_v[0]), 60.0)
        self.pieces.append(values_v[1:])

    def values(self) -> np.ndarray:
        """Return all samples [V]."""
        return np.concatenate(self.pieces)


def slow_triangle(drive: Drive, rng: np.random.Generator, slope_v_per_s: float, n_turns: int) -> None:
    """Sweep the whole range, then ever smaller parts of it."""
    centre = rng.uniform(0.4, 0.6)
    for k in range(n_turns):
        shrink = 1.0 - 0.8 * k / max(1, n_turns - 1) if n_turns > 1 else 1.0
        drive.line(drive.level(centre + (1.0 - centre) * shrink), slope_v_per_s)
        drive.line(drive.level(centre - centre * shrink), slope_v_per_s)


def fast_triangle(drive: Drive, rng: np.random.Generator, slope_v_per_s: float, duration_s: float) -> None:
    """Go to and fro at one slope over a large part of the range."""
    low, high = drive.level(rng.uniform(0.0, 0.2)), drive.level(rng.uniform(0.75, 1.0))
    drive.line(low, 40.0)
    for _ in range(max(2, round(duration_s * slope_v_per_s / (2.0 * (high - low))))):
        drive.line(high, slope_v_per_s)
        drive.line(low, slope_v_per_s)


def staircase(drive: Drive, rng: np.random.Generator, n_steps: int, hold_s: float) -> None:
    """Climb and descend in equal steps, each held."""
    low, high = rng.uniform(0.0, 0.15), rng.uniform(0.85, 1.0)
    stairs = low + (high - low) * np.arange(n_steps + 1) / n_steps
    drive.line(drive.level(low), 20.0)
    for fraction in np.concatenate([stairs[1:], stairs[-2::-1]]):
        drive.line(drive.level(fraction), 1e9)
        drive.hold(hold_s)


def steps(drive: Drive, rng: np.random.Generator, duration_s: float) -> None:
    """Step to levels at random, each held for a time at random."""
    total = 0.0
    while total < duration_s:
        hold_s = float(np.exp(rng.uniform(np.log(0.15), np.log(4.0))))
        drive.line(drive.level(rng.uniform(0.0, 1.0)), 1e9)
        drive.hold(hold_s)
        total += hold_s


def multisine(
    drive: Drive,
    rng: np.random.Generator,
    period_s: float,
    n_periods: int,
    top_hz: float,
    rms_fraction: float,
) -> None:
    """Repeat one random-phase multisine about a level; the first period is the lead-in."""
    n = round(period_s * drive.rate_hz)
    spectrum = np.zeros(n // 2 + 1, dtype=complex)
    lines = np.arange(1, min(n // 2, int(top_hz * period_s)))
    spectrum[lines] = np.exp(2j * np.pi * rng.random(lines.size)) / np.sqrt(1.0 + lines / (20.0 * period_s))
    wave = np.fft.irfft(spectrum, n)
    wave *= rms_fraction * (drive.high_v - drive.low_v) / np.sqrt(np.mean(wave**2))
    room = np.max(np.abs(wave)) / (drive.high_v - drive.low_v)
    level = drive.level(rng.uniform(min(room, 0.5), max(1.0 - room, 0.5)))
    drive.append(np.clip(level + np.tile(wave, n_periods), drive.low_v, drive.high_v))


def _rich(drive: Drive, rng: np.random.Generator, share: float) -> None:
    """Excite everything, for a share of the full length of about 75 s."""
    drive.hold(rng.uniform(0.2, 0.6))
    slow_triangle(drive, rng, rng.uniform(3.0, 6.0), 5 if share > 0.8 else 3)
    pieces: list[Callable[[], None]] = [
        lambda: fast_triangle(drive, rng, rng.uniform(20.0, 60.0), 4.0 * share),
        lambda: fast_triangle(drive, rng, rng.uniform(200.0, 400.0), 2.5 * share),
        lambda: staircase(drive, rng, int(rng.integers(6, 12)), 0.45 * max(share, 0.5)),
        lambda: steps(drive, rng, 22.0 * share),
        lambda: multisine(
            drive,
            rng,
            2.0 if share > 0.5 else 1.0,
            5 if share > 0.5 else 4,
            rng.uniform(200.0, 300.0),
            rng.uniform(0.012, 0.03),
        ),
    ]
    if share > 0.8:
        pieces.append(lambda: slow_triangle(drive, rng, rng.uniform(8.0, 12.0), 4))
    for k in rng.permutation(len(pieces)):
        pieces[k]()
    drive.line(drive.level(rng.uniform(0.3, 0.9)), 1e9)
    drive.hold(5.0 * share)
    drive.line(0.0, 20.0)
    drive.hold(4.0 * share)


def _sine(drive: Drive, frequency_hz: float, duration_s: float, part: float) -> None:
    """Append a sine over a part of the range about its middle, led in from its trough."""
    time_s = np.arange(round(duration_s * drive.rate_hz)) / drive.rate_hz
    middle, swing = drive.level(0.5), 0.5 * part * (drive.high_v - drive.low_v)
    drive.append(middle - swing * np.cos(2.0 * np.pi * frequency_hz * time_s))


def draw_drive(
    excitation: str, part: str, low_v: float, high_v: float, rate_hz: float, rng: np.random.Generator
) -> np.ndarray:
    """Draw the drive [V] of one record of a kind (see EXCITATIONS) and part ("train", "test", "report")."""
    drive = Drive(low_v, high_v, rate_hz)
    if excitation == "rich":
        _rich(drive, rng, 1.0 if part == "train" else 0.55)
    elif excitation == "short":
        _rich(drive, rng, 0.34 if part == "train" else 0.25)
    elif excitation == "slow_triangle":
        slope = rng.uniform(0.8, 1.6)
        for _ in range(2):
            drive.line(high_v * rng.uniform(0.9, 1.0) if part != "train" else high_v, slope)
            drive.line(low_v * rng.uniform(0.9, 1.0) if part != "train" else low_v, slope)
        drive.line(0.0, slope)
    elif excitation == "single_sine":
        _sine(drive, rng.uniform(0.5, 2.0), 30.0, 1.0 if part == "train" else 0.9)
    elif excitation == "slow_sines":
        # Fast enough to show a lag, too slow to show of what kind it is.
        for frequency_hz in (0.5, 1.5, 4.0):
            _sine(drive, frequency_hz * rng.uniform(0.9, 1.1), 10.0, 1.0 if part == "train" else 0.9)
    elif excitation == "level_hold":
        slow_triangle(drive, rng, 4.0, 2)
        drive.line(drive.level(rng.uniform(0.75, 0.9)), 4.0)
        drive.hold(40.0)
    elif excitation == "steps_only":
        drive.hold(0.5)
        steps(drive, rng, 30.0)
    elif excitation == "staircase_only":
        drive.hold(0.5)
        staircase(drive, rng, 10, 1.5)
    elif excitation == "multisine_only":
        drive.hold(0.5)
        multisine(drive, rng, 4.0, 6, rng.uniform(100.0, 250.0), 0.03)
    else:
        raise ValueError(f"excitation {excitation!r}, one of {EXCITATIONS}")
    return drive.values()

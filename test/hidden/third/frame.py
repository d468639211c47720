"""One record's clock, command and company: all an effect may look at beside the signal it changes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from test.hidden.third.arrays import Array
from test.hidden.third.bench import Bench
from test.hidden.third.drives import draw_drive

# Beyond its end a drive goes on for a while, for clocks that run ahead.
_TAIL_SHARE = 0.05


@dataclass(frozen=True)
class Frame:
    """A record before anything is read.

    Args:
        bench: it is made on.
        index: 0 to train, 1 to test, 2 to report.
        command_v: at all samples: past, record, tail.
        n_past: samples before the record.
        temperature_c: of the record's own samples, where recorded.
        cross_voltage_v: likewise.
        cross_displacement_um: likewise.
        n_fine: steps of the dynamics in a sample.
    """

    bench: Bench
    index: int
    command_v: Array
    n_past: int = 0
    temperature_c: Array | None = None
    cross_voltage_v: Array | None = None
    cross_displacement_um: Array | None = None
    n_fine: int = 6

    @property
    def dt_s(self) -> float:
        """Sampling [s]."""
        return 1.0 / self.bench.rates_hz[self.index]

    @property
    def step_s(self) -> float:
        """Of the fine grid [s]."""
        return self.dt_s / self.n_fine

    @property
    def n_samples(self) -> int:
        """Of the record."""
        return self.bench.n_samples[self.index]

    @property
    def time_s(self) -> Array:
        """Of all samples, zero at the record's first [s]."""
        return (np.arange(self.command_v.size) - self.n_past) * self.dt_s

    @property
    def fine_time_s(self) -> Array:
        """Of the fine grid [s]."""
        n = (self.command_v.size - 1) * self.n_fine + 1
        return np.arange(n) * self.step_s - self.n_past * self.dt_s

    @property
    def duration_s(self) -> float:
        """Of the record [s]."""
        return self.n_samples * self.dt_s

    @property
    def recorded(self) -> slice:
        """Which of all samples the record holds."""
        return slice(self.n_past, self.n_past + self.n_samples)

    @property
    def recorded_v(self) -> Array:
        """The command as recorded [V]."""
        return self.command_v[self.recorded]


def _wander_c(rng: np.random.Generator, n: int) -> Array:
    """Draw the temperature of a room: an air conditioner's cycle on a slow way."""
    share = np.arange(n) / n
    cycle = 0.3 * np.sin(2.0 * np.pi * (rng.uniform(1.5, 6.0) * share + rng.random()))
    way = rng.uniform(-1.0, 1.0) * share + rng.uniform(-0.5, 0.5) * share**2
    size = rng.uniform(0.3, 2.0)
    # A logger's own noise, small beside what it follows.
    return np.asarray(21.0 + size * (cycle + way) + 1e-3 * size * rng.standard_normal(n))


def draw_frame(
    rng: np.random.Generator, bench: Bench, index: int, kinds: tuple[str, ...], wanted: frozenset[str]
) -> Frame:
    """Draw a record's command and what is recorded beside it.

    Args:
        rng: source of chance.
        bench: it is made on.
        index: of the record.
        kinds: of drive, one after the other.
        wanted: of "temperature", "cross_voltage", "cross_displacement", and "motion" where it starts in mid-motion.
    """
    n = bench.n_samples[index]
    n_past = n // 3 if "motion" in wanted else 0
    command_v = draw_drive(rng, kinds, n_past + n + int(_TAIL_SHARE * n) + 2, bench)
    second = draw_drive(rng, ("tones", "staircase")[:: int(rng.choice([-1, 1]))], n, bench)
    return Frame(
        bench,
        index,
        command_v,
        n_past,
        _wander_c(rng, n) if "temperature" in wanted else None,
        second if "cross_voltage" in wanted else None,
        second * bench.stroke_um / bench.span_v if "cross_displacement" in wanted else None,
    )

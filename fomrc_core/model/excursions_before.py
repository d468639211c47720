"""What the drive may have done before a record that begins in mid-motion: a level held, excursions, and the way in.

Hysteresis forgets all but the extremes of its past, the last ones first to be met again (Madelung's rules; Mayergoyz,
"Mathematical models of hysteresis", 1991, ch. 1), so a few extremes stand for any past. Creep remembers the level about
which the drive was. The last excursion ends at the first sample with the rate the record begins with, or what lags
behind the drive would begin with a jump.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array

_LONG_S = 1000.0  # creep of an order of some hundredths has come to rest by then
_N_HOLD = 40
_N_RAMP = 40
_N_CYCLES = 3  # of the outer excursions: more change what creep has seen by some percent of itself
_STILL = 1e-3  # of the mean rate: the record begins at rest
_N_LAST = 60  # samples of the way in that are stepped as the record is
_MOMENT_S = 0.5


@dataclass(frozen=True)
class ExcursionsBefore:
    """A past of the drive.

    Attributes:
        level_v: voltage held for long before [V].
        first_v, second_v: extremes of the outer excursions, to and fro [V].
        last_v: extreme from which the drive came into the record [V].
    """

    level_v: float
    first_v: float
    second_v: float
    last_v: float

    def __str__(self) -> str:
        return (
            f"in motion, about {self.level_v:.4g} V, between {self.first_v:.4g} and {self.second_v:.4g} V, "
            f"last from {self.last_v:.4g} V"
        )

    def drive(self, entry: Entry) -> tuple[Array, Array]:
        """Return steps [s] and voltages [V] of this past, up to just before the first sample, each (n_steps,)."""
        steps, voltages = [np.diff(np.geomspace(1e-3, _LONG_S, _N_HOLD + 1))], [np.full(_N_HOLD, self.level_v)]
        now = self.level_v
        for extreme in (*(self.first_v, self.second_v) * _N_CYCLES, self.last_v):
            duration = max(abs(extreme - now) / entry.mean_rate, entry.step_s)
            steps.append(np.full(_N_RAMP, duration / _N_RAMP))
            voltages.append(now + (extreme - now) * np.arange(1, _N_RAMP + 1) / _N_RAMP)
            now = extreme
        # the first sample itself is the end of the first step of the record
        end = entry.first_v - entry.rate * entry.step_s
        way = end - now
        if entry.is_still or way * entry.rate <= 0.0:
            steps.append(np.full(_N_RAMP, _MOMENT_S / _N_RAMP))
            voltages.append(np.full(_N_RAMP, end))
            return np.concatenate(steps), np.concatenate(voltages)
        n_way = max(int(way / (entry.rate * entry.step_s)), 1)
        n_fine = min(n_way, _N_LAST)
        fine = end - entry.rate * entry.step_s * np.arange(n_fine - 1, -1, -1)
        coarse = np.linspace(now, fine[0], _N_RAMP + 1)[1:-1] if n_way > n_fine else np.zeros(0)
        rate = abs(entry.rate)
        steps += [np.abs(np.diff(np.concatenate(([now], coarse)))) / rate, np.full(n_fine, entry.step_s)]
        voltages += [coarse, fine]
        joined = np.concatenate(steps)
        return np.maximum(joined, 1e-9), np.concatenate(voltages)


@dataclass(frozen=True)
class Entry:
    """How a record begins: first voltage [V], rate there [V/s], step [s], and the mean rate of its motion [V/s]."""

    first_v: float
    rate: float
    step_s: float
    mean_rate: float

    @classmethod
    def of(cls, steps_s: Array, voltage_v: Array) -> Entry:
        """Return how a drive [V] with these steps [s] begins."""
        rates = np.abs(np.diff(voltage_v)) / steps_s[1:]
        moving = rates[rates > _STILL * float(np.max(rates, initial=0.0))]
        mean = float(np.mean(moving)) if moving.size else 1.0
        first = float(voltage_v[1] - voltage_v[0]) / float(steps_s[1])
        return cls(float(voltage_v[0]), first, float(steps_s[1]), mean)

    @property
    def is_still(self) -> bool:
        """Whether the drive rests when the record begins."""
        return abs(self.rate) <= _STILL * self.mean_rate

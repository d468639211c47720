"""Voltages and displacements, heard each at its own times, as one stream of samples."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Where no voltage comes, the last one holds; so long is waited for it.
_PATIENCE_S = 0.5
# A voltage is late where so many periods have passed since the last one.
_LATE_PERIODS = 1.5
# Displacements further apart than this, where a timer's jitter may leave one period out, had others between them.
_LOST_PERIODS = 2.5
# A longer silence of the sensor begins a new record.
LONGEST_GAP_S = 1.0


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples that follow each other, arrays of shape (n_samples,).

    Attributes:
        time_s: when each displacement was measured [s].
        steps_s: step that leads to each [s].
        voltage_v: voltage at that time [V].
        displacement_um: displacement [um]; not a number where it was lost, for the stage moved on there, too.
        begins_anew: whether a gap lies before the first one.
    """

    time_s: Array
    steps_s: Array
    voltage_v: Array
    displacement_um: Array
    begins_anew: bool


class StageStream:
    """Brings voltages to the times of the displacements; keeps no more than what still waits.

    Args:
        lag_s: how long after a voltage was sent the displacement it makes is told [s].
        period_s: nominal period of the voltages [s]; one that came later than that was held until then.
        sample_period_s: nominal period of the displacements [s]; between two further apart some were lost.
    """

    def __init__(self, lag_s: float, period_s: float, sample_period_s: float) -> None:
        self._lag_s, self._period_s, self._sample_period_s = lag_s, period_s, sample_period_s
        self._sent = np.zeros((0, 2))
        self._seen = np.zeros((0, 2))
        self._last_s = np.nan

    def add(self, sent: Array, seen: Array, now_s: float) -> list[Samples]:
        """Take in what was heard; return what is complete.

        Args:
            sent: times [s] and voltages [V], shape (n, 2), in order.
            seen: times [s] and displacements [um], shape (m, 2), in order.
            now_s: the time now [s].
        """
        # From the last one that is known already, so that a late voltage is seen to be late.
        sent = np.concatenate((self._sent[-1:], sent.reshape(-1, 2)))
        self._sent = np.concatenate((self._sent[:-1], with_held_voltages(sent, self._period_s)))
        self._seen = np.concatenate((self._seen, seen.reshape(-1, 2)))
        if not self._sent.size or not self._seen.size:
            return []
        known_s = max(float(self._sent[-1, 0]) + self._lag_s, now_s - _PATIENCE_S)
        n = int(np.searchsorted(self._seen[:, 0], known_s, side="right"))
        # What was measured before the first voltage was heard cannot be used.
        first = int(np.searchsorted(self._seen[:n, 0], self._sent[0, 0] + self._lag_s))
        done, self._seen = self._seen[first:n], self._seen[n:]
        if not done.size:
            return []
        done = self._with_lost(done)
        voltage_v = np.interp(done[:, 0] - self._lag_s, self._sent[:, 0], self._sent[:, 1])
        still = int(np.searchsorted(self._sent[:, 0], done[-1, 0] - self._lag_s, side="right")) - 1
        self._sent = self._sent[max(still, 0) :]
        return self._split(done, voltage_v)

    def _with_lost(self, done: Array) -> Array:
        times_s = np.concatenate(([self._last_s], done[:, 0]))
        gaps_s = np.diff(times_s)
        lost = []
        for k in np.flatnonzero((gaps_s > _LOST_PERIODS * self._sample_period_s) & (gaps_s <= LONGEST_GAP_S)):
            n_parts = round(gaps_s[k] / self._sample_period_s)
            lost.append(times_s[k] + gaps_s[k] * np.arange(1, n_parts) / n_parts)
        if not lost:
            return done
        at_s = np.concatenate(lost)
        whole = np.concatenate((done, np.column_stack((at_s, np.full(at_s.size, np.nan)))))
        return np.asarray(whole[np.argsort(whole[:, 0], kind="stable")])

    def _split(self, done: Array, voltage_v: Array) -> list[Samples]:
        steps_s = np.diff(done[:, 0], prepend=self._last_s)
        edges = [0, *(int(k) for k in np.flatnonzero(~(steps_s <= LONGEST_GAP_S)) if k > 0), done.shape[0]]
        is_new = not steps_s[0] <= LONGEST_GAP_S
        usual_s = float(np.median(steps_s[1:])) if steps_s.size > 1 else 1e-3
        self._last_s = float(done[-1, 0])
        found = []
        for start, stop in pairwise(edges):
            part = slice(start, stop)
            steps = steps_s[part].copy()
            begins_anew = is_new if start == 0 else True
            if begins_anew:
                steps[0] = usual_s
            found.append(Samples(done[part, 0], steps, voltage_v[part], done[part, 1], begins_anew))
        return found


def with_held_voltages(sent: Array, period_s: float) -> Array:
    """Return voltages with one more before each that came late: until a period before it the last one was held.

    Args:
        sent: times [s] and voltages [V], shape (n, 2), in order.
        period_s: nominal period [s].
    """
    late = np.flatnonzero(np.diff(sent[:, 0]) > _LATE_PERIODS * period_s) + 1
    held = np.column_stack((sent[late, 0] - period_s, sent[late - 1, 1]))
    return np.asarray(np.insert(sent, late, held, axis=0))

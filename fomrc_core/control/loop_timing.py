"""How well a timed loop keeps time."""

from __future__ import annotations

import time
from dataclasses import dataclass

# Ticks between two reports of which the time spent is kept.
_MOST_KEPT = 10_000


@dataclass(frozen=True)
class TimingReport:
    """What a loop did since the last report.

    Attributes:
        rate_hz: ticks per second [Hz], real time.
        n_late: ticks that came more than half a period late.
        latest_s: largest gap between two ticks [s].
        busy_mean_s: mean time from a tick to after its publish [s].
        busy_p99_s: 99th percentile of it [s].
        busy_max_s: longest of it [s].
    """

    rate_hz: float
    n_late: int
    latest_s: float
    busy_mean_s: float
    busy_p99_s: float
    busy_max_s: float


class LoopTiming:
    """Counts ticks, gaps and time spent."""

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self.n_late_total = 0
        self._since = self._last = time.perf_counter()
        self._clear()

    def _clear(self) -> None:
        self._n_ticks, self._n_late = 0, 0
        self._gap_max = 0.0
        self._busy: list[float] = []

    def begin(self) -> float:
        """Note that a tick begins; return the time it does [s]."""
        now = time.perf_counter()
        gap = now - self._last
        self._last = now
        self._n_ticks += 1
        if gap > 1.5 * self.period_s:
            self._n_late += 1
            self.n_late_total += 1
        if gap > self._gap_max:
            self._gap_max = gap
        return now

    def end(self, began: float) -> None:
        """Note that the tick that began then has published."""
        if len(self._busy) < _MOST_KEPT:
            self._busy.append(time.perf_counter() - began)

    def report(self) -> TimingReport:
        """Return what happened since the last report, and start anew."""
        now = time.perf_counter()
        busy = sorted(self._busy) or [0.0]
        report = TimingReport(
            self._n_ticks / max(now - self._since, 1e-9),
            self._n_late,
            self._gap_max,
            sum(busy) / len(busy),
            busy[int(0.99 * (len(busy) - 1))],
            busy[-1],
        )
        self._since = now
        self._clear()
        return report

"""Processor time, and one line of the table."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One line of the table: what, the figure, the bar, and whether it is met (None: no bar)."""

    what: str
    figure: str
    bar: str = ""
    is_met: bool | None = None


def best_of(work: Callable[[], object], n_repeats: int = 7) -> float:
    """Return the least processor time of this thread [s]; what else the machine does counts least there."""
    best = float("inf")
    for _ in range(n_repeats):
        start = time.thread_time()
        work()
        best = min(best, time.thread_time() - start)
    return best


def interleaved(works: dict[str, Callable[[], object]], n_rounds: int = 7) -> dict[str, float]:
    """Return the least processor time [s] of each, taken in turns, so that all see the same machine."""
    best = dict.fromkeys(works, float("inf"))
    for work in works.values():
        work()
    for _ in range(n_rounds):
        for name, work in works.items():
            best[name] = min(best[name], best_of(work, 1))
    return best

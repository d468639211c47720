"""What workers are doing with recordings: kept in memory their parent sees, and told by it in words.

Each recording has an entry that one worker at a time writes and the parent reads. No lock is held meanwhile: a worker
that is killed stops nobody.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import get_context
from typing import Any

from fomrc_core.compute.pulse import heard_by

_WAITING, _AT_WORK, _DONE = range(3)
_STILL_S = 3.0  # as long without a step is said: about as often as it is told at all
_N_NAMED = 3  # recordings at work named in a line; the others are counted
_LONGEST_KIND = 40


class _Entry(ctypes.Structure):
    _fields_ = [("state", ctypes.c_int), ("n_steps", ctypes.c_uint64), ("kind", ctypes.c_char * _LONGEST_KIND)]


class WorkAccount:
    """What is being done with each of some recordings.

    Args:
        names: of the recordings.
        clock_s: a clock [s].
    """

    def __init__(self, names: Sequence[str], clock_s: Callable[[], float] = time.monotonic) -> None:
        self.entries: Any = get_context("spawn").RawArray(_Entry, len(names))
        self._names = tuple(names)
        self._clock_s = clock_s
        self._seen = [(_WAITING, 0)] * len(names)
        self._news_s = clock_s()

    def told(self) -> str:
        """Return in a line what is at work, how many steps each has done, and for how long nothing was done."""
        seen = [(int(entry.state), int(entry.n_steps)) for entry in self.entries]
        now_s = self._clock_s()
        if seen != self._seen:
            self._seen, self._news_s = seen, now_s
        still_s = now_s - self._news_s
        for_how_long = f" for {still_s:.0f} s" if still_s >= _STILL_S else ""
        at_work = [number for number, (state, _) in enumerate(seen) if state == _AT_WORK]
        if not at_work:
            return f"no recording at work{for_how_long}: workers start or end"
        parts = [self._told_of(number) for number in at_work[:_N_NAMED]]
        if len(at_work) > _N_NAMED:
            parts.append(f"{len(at_work) - _N_NAMED} more")
        return f"at work: {', '.join(parts)}" + (f"; no step{for_how_long}" if for_how_long else "")

    def _told_of(self, number: int) -> str:
        entry = self.entries[number]
        if not entry.n_steps:
            return f"{self._names[number]} (begun)"
        return f"{self._names[number]} ({entry.n_steps} steps, {entry.kind.decode(errors='replace')})"


@contextmanager
def at_work(entries: Any, number: int) -> Iterator[None]:
    """Have a recording's entry say what is done with it meanwhile: in the worker.

    Args:
        entries: of a ``WorkAccount``.
        number: of the recording.
    """
    entry = entries[number]

    def count(what: str, _n_done: int) -> None:
        entry.n_steps += 1
        entry.kind = what.encode()[:_LONGEST_KIND]

    entry.n_steps, entry.state = 0, _AT_WORK
    try:
        with heard_by(count):
            yield
    finally:
        entry.state = _DONE

"""How long processes had to wait for a processor while they wanted to run: Linux counts it for every thread."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from pathlib import Path


class ProcessorWaits:
    """Watches all threads that some processes have now.

    The second number of /proc/PID/task/TID/schedstat is the time a thread has waited on a run queue [ns]. Where the
    system does not count it, nothing ever waited.

    Args:
        pids: process numbers.
    """

    def __init__(self, pids: Sequence[int]) -> None:
        self._files: list[int] = []
        for pid in pids:
            for path in Path(f"/proc/{pid}/task").glob("*/schedstat"):
                with contextlib.suppress(OSError):  # a thread may just have ended
                    self._files.append(os.open(path, os.O_RDONLY))
        self._before_s = self._waited_s()

    def longest_s(self) -> float:
        """Return the longest that one thread has waited since the last call, in all [s]."""
        before, self._before_s = self._before_s, self._waited_s()
        return max((now - then for now, then in zip(self._before_s, before, strict=True)), default=0.0)

    def close(self) -> None:
        """Stop watching."""
        for file in self._files:
            os.close(file)
        self._files, self._before_s = [], []

    def _waited_s(self) -> list[float]:
        return [_waited_s(file) for file in self._files]


def _waited_s(file: int) -> float:
    try:
        return 1e-9 * float(os.pread(file, 128, 0).split()[1])
    except (OSError, IndexError):  # the thread has ended, or the system does not count
        return 0.0

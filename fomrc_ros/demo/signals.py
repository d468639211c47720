"""Signals to end, noted while the client library spins."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def signals_noted() -> Iterator[Callable[[], bool]]:
    """Note SIGINT and SIGTERM instead of raising them where they come; yield whether one has come.

    A spinning executor turns what a handler raises while it converts a message into an error of its own
    (``RuntimeError: Unable to convert call argument``), and who waits for the interrupt does not get it.

    Raises:
        KeyboardInterrupt: at the end, if one has come.
    """
    noted: list[int] = []

    def note(number: int, frame: FrameType | None) -> None:
        noted.append(number)

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: bool(noted)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if noted:
        raise KeyboardInterrupt

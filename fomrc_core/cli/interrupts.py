"""An interrupt ends a command, also one that comes where nobody can be told of it."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

_AGAIN_S = 0.05


@dataclass
class Interrupts:
    """Whether an interrupt has come since the command began."""

    have_come: bool = False


@contextmanager
def interrupts_kept() -> Iterator[Interrupts]:
    """Keep that an interrupt came, and raise it again where it was swallowed.

    A compiler that calls back into Python, and a finaliser, report what is raised in them and go on: the command would
    run to its end, or end some lines later with an error that nobody made. The interrupt comes again a moment later.
    Where the main thread does not hear interrupts as Python does from its start, nothing is changed.
    """
    kept = Interrupts()
    is_heard = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if not is_heard or threading.current_thread() is not threading.main_thread():
        yield kept
        return
    report = sys.unraisablehook

    def interrupt(number: int, frame: FrameType | None) -> None:
        kept.have_come = True
        raise KeyboardInterrupt

    def swallowed(unraisable: Any) -> None:
        if kept.have_come and unraisable.exc_type is KeyboardInterrupt:
            signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
        else:
            report(unraisable)

    before = signal.signal(signal.SIGINT, interrupt), signal.signal(signal.SIGALRM, interrupt)
    sys.unraisablehook = swallowed
    try:
        yield kept
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGINT, before[0])
        signal.signal(signal.SIGALRM, before[1])
        sys.unraisablehook = report

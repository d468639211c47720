"""One process at a time compiles a kernel: the others wait for it and take what it left on disk."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from pathlib import Path

from fomrc_core.compute.pulse import beat

try:
    import fcntl
except ImportError:  # pragma: no cover - where there is none each process compiles for itself
    fcntl = None  # type: ignore[assignment]

_LOOK_PERIOD_S = 0.02


@contextlib.contextmanager
def one_process_at_a_time(file: Path, longest_wait_s: float = 10.0) -> Iterator[None]:
    """Hold this file locked among processes; go on without a lock where it cannot be made.

    The system takes the lock from a process that dies. A thread that holds it must not wait for another thread of its
    process that wants a lock as well.

    Args:
        file: made where there is none, its folder too.
        longest_wait_s: then it goes on without the lock [s]: a process that was stopped, or that hardly gets a
            processor, must not hold up all others.
    """
    with contextlib.ExitStack() as stack:
        if fcntl is not None:
            with contextlib.suppress(OSError):
                file.parent.mkdir(parents=True, exist_ok=True)
                handle = stack.enter_context(file.open("ab"))
                give_up_s = time.monotonic() + longest_wait_s
                while not _is_locked(handle.fileno()) and time.monotonic() < give_up_s:
                    beat("kernels compiled", 0)
                    time.sleep(_LOOK_PERIOD_S)
        yield


def _is_locked(number: int) -> bool:
    """Lock an open file; return whether no other process has it.

    Raises:
        OSError: files here cannot be locked.
    """
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True

"""A sign of life from where work is done, heard by whoever shows progress, and free where nobody listens.

Stages of a work are told by what runs them. Within a stage, fits and simulations say that another one is done: who
shows progress can tell a long stage from one that stands still.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar

Listener = Callable[[str, int], None]

_LISTENER: ContextVar[Listener | None] = ContextVar("fomrc_pulse_listener", default=None)


def beat(what: str, n_done: int = 1) -> None:
    """Say that more is done.

    Args:
        what: of what, in the plural, such as "simulations".
        n_done: how many of them; 0 where a step towards the next one is done.
    """
    listener = _LISTENER.get()
    if listener is not None:
        listener(what, n_done)


@contextmanager
def heard_by(listener: Listener) -> Iterator[None]:
    """Have what is done meanwhile heard, also in threads of ``heard_threads``; it is called from any of them."""
    before = _LISTENER.set(listener)
    try:
        yield
    finally:
        _LISTENER.reset(before)


def heard_threads(n_threads: int) -> ThreadPoolExecutor:
    """Return threads whose work is heard by whoever listens now."""
    return ThreadPoolExecutor(n_threads, initializer=_LISTENER.set, initargs=(_LISTENER.get(),))

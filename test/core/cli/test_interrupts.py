"""An interrupt that is swallowed by who calls back into Python comes again, and ends what runs."""

from __future__ import annotations

import ctypes
import signal
import sys
import threading
import time
from collections.abc import Iterator

import pytest

from fomrc_core.cli.interrupts import interrupts_kept

_CALLBACK = ctypes.CFUNCTYPE(None)


@pytest.fixture
def _hearing() -> Iterator[None]:
    """Hear interrupts as Python does from its start: whoever runs the tests in the background has them ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("_hearing")
def test_an_interrupt_swallowed_in_a_callback_comes_again() -> None:
    def interrupted() -> None:
        signal.raise_signal(signal.SIGINT)

    before = sys.unraisablehook, signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM)
    with interrupts_kept() as kept:
        assert not kept.have_come
        _CALLBACK(interrupted)()
        assert kept.have_come  # and the line before has raised nothing here
        with pytest.raises(KeyboardInterrupt):
            time.sleep(30.0)
    assert (sys.unraisablehook, signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGALRM)) == before


@pytest.mark.usefixtures("_hearing")
def test_an_interrupt_that_is_heard_comes_once() -> None:
    with interrupts_kept() as kept:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        time.sleep(0.2)
    assert kept.have_come


def test_other_errors_of_a_callback_are_reported_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    reported = []
    monkeypatch.setattr(sys, "unraisablehook", reported.append)

    def failing() -> None:
        raise ValueError("no matter")

    with interrupts_kept() as kept:
        _CALLBACK(failing)()
    assert [type(told.exc_value) for told in reported] == [ValueError]
    assert not kept.have_come


def test_a_thread_and_a_process_that_ignores_interrupts_are_left_as_they_are() -> None:
    handlers = []

    def within() -> None:
        with interrupts_kept():
            handlers.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=within)
    thread.start()
    thread.join()
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        within()
    finally:
        signal.signal(signal.SIGINT, before)
    assert handlers == [before, signal.SIG_IGN]

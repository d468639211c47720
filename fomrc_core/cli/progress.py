"""How commands show that they work, and how far they have come: a bar on a terminal, lines elsewhere."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.progress import Progress as Bars

Progress = Callable[[float, str], None]

_BETWEEN_LINES_S = 2.5  # a line as often, where something is done: the longest piece of work, some 2 s, comes on top
_BETWEEN_FRAMES_S = 0.2  # the same of a bar
_FIRST_TIMES_S = 5.0  # who is done before needs no times
_LOADED = "modules loaded"
_LEAST_SHARE = 0.03  # what is left is not foreseen from less


_said_s = -float("inf")  # when something was said last: of the whole process, as its standard error is


def say(text: str) -> None:
    """Tell the user something beside the results: standard output stays free for those."""
    global _said_s
    print(text, file=sys.stderr, flush=True)
    _said_s = time.monotonic()


class _LoadingFinder:
    """Asked for each module before it is loaded, says so, and leaves it to others to find it."""

    n_asked = 0

    @classmethod
    def find_spec(cls, name: str, path: object = None, target: object = None) -> None:
        from fomrc_core.compute.pulse import beat

        cls.n_asked += 1
        beat(_LOADED)


@contextmanager
def loading_told(clock_s: Callable[[], float] = time.monotonic) -> Iterator[None]:
    """Have modules heard as they are loaded, and say so where nothing else is said: it takes long on a busy machine.

    Args:
        clock_s: a clock [s], the one by which ``say`` remembers.
    """
    from fomrc_core.compute.pulse import heard_by

    begun_s = clock_s()

    def tell(what: str, _n_done: int) -> None:
        if what == _LOADED and clock_s() - max(begun_s, _said_s) >= _BETWEEN_LINES_S:
            say(f"loading: {_LoadingFinder.n_asked} modules so far")

    finder: Any = _LoadingFinder
    _LoadingFinder.n_asked = 0
    sys.meta_path.insert(0, finder)
    try:
        with heard_by(tell):
            yield
    finally:
        sys.meta_path.remove(finder)


@contextmanager
def progress_shown(title: str) -> Iterator[Progress]:
    """Show how far a long work has come: a bar on a terminal, a line per stage and in long stages elsewhere."""
    from rich.console import Console

    from fomrc_core.compute.pulse import heard_by

    console = Console(stderr=True)
    if not console.is_terminal:
        shown = Shown(lambda share, text: say(f"{title}: {100.0 * share:3.0f} % {text}"), _BETWEEN_LINES_S)
        with heard_by(shown.beat):
            yield shown.tell
        return
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn
    from rich.progress import Progress as Bars

    columns = (TextColumn("{task.fields[title]}"), BarColumn(), TaskProgressColumn(), TextColumn("{task.description}"))
    with Bars(*columns, console=console, transient=True) as bars:
        bar = Shown(_moved_bar(bars, title), _BETWEEN_FRAMES_S)
        with heard_by(bar.beat):
            yield bar.tell


@contextmanager
def sign_of_life(title: str) -> Iterator[None]:
    """Say what has been done in a work without stages that takes long; nothing of one that does not."""
    from fomrc_core.compute.pulse import heard_by

    shown = Shown(lambda _share, text: say(f"{title}: {text}"), _BETWEEN_LINES_S)
    with heard_by(shown.beat):
        yield


@contextmanager
def worker_threads() -> Iterator[ThreadPoolExecutor | None]:
    """Give one thread per processor to work in; None where there is one only.

    Kernels and linear algebra release the interpreter; processes would spend longer on passing the records' columns
    to and fro than on working with them. Begun within ``progress_shown``, they are heard by it.
    """
    from fomrc_core.compute.pulse import heard_threads

    n_processors = os.cpu_count() or 1
    if n_processors < 2:
        yield None
        return
    with heard_threads(n_processors) as executor:
        yield executor


class Shown:
    """Stages of a work, and what is done within them where they are long, each written at its time.

    Args:
        write: called with the share done and what is being done.
        between_s: how often what is done within a stage is written [s].
        clock_s: a clock [s].
    """

    def __init__(
        self, write: Callable[[float, str], None], between_s: float, clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._write = write
        self._between_s = between_s
        self._clock_s = clock_s
        self._begun_s = self._written_s = clock_s()
        self._share, self._text = 0.0, ""
        self._done: Counter[str] = Counter()
        # Pieces of work end in several threads, and in one of them writing may load a module, which is heard too.
        self._lock = threading.RLock()

    def tell(self, share: float, text: str) -> None:
        """Take down a stage, and write it where it is another."""
        with self._lock:
            self._share = min(max(share, 0.0), 1.0)
            if text != self._text:
                self._text = text
                self._done.clear()
                self._write_now()

    def beat(self, what: str, n_done: int) -> None:
        """Count pieces of work, and write how many are done where nothing was written for a while."""
        with self._lock:
            self._done[what] += n_done
            if self._clock_s() - self._written_s >= self._between_s:
                self._write_now()

    def _write_now(self) -> None:
        self._written_s = self._clock_s()
        counts = [f"{number} {what}" for what, number in self._done.items() if number]
        parts = [part for part in (self._text, *counts) if part]
        self._write(self._share, ", ".join(parts) + self._times())

    def _times(self) -> str:
        so_far_s = self._written_s - self._begun_s
        if so_far_s < _FIRST_TIMES_S or self._share >= 1.0:
            return ""
        if self._share < _LEAST_SHARE:
            return f" ({_minutes(so_far_s)})"
        return f" ({_minutes(so_far_s)}, up to about {_minutes(so_far_s * (1.0 / self._share - 1.0))} left)"


def _minutes(duration_s: float) -> str:
    return f"{int(duration_s) // 60}:{int(duration_s) % 60:02d}"


def _moved_bar(bars: Bars, title: str) -> Callable[[float, str], None]:
    task = bars.add_task("", total=1.0, title=title)
    return lambda share, text: bars.update(task, completed=share, description=text)

"""Options several commands share, and how they talk while they work."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from fomrc_core.records.recording import Recording

Progress = Callable[[float, str], None]

_COLUMNS_HELP = "Which column (from 0) is what, in a file without header: time=none,voltage=0,displacement=4."
_RATE_HELP = "Sample rate [Hz] of a file without time."
_TOPICS_HELP = "Which topic is what, in a rosbag2 folder: voltage=/x/voltage,displacement=/x/displacement."

Columns = Annotated[str | None, typer.Option("--columns", help=_COLUMNS_HELP)]
Rate = Annotated[float | None, typer.Option("--rate", help=_RATE_HELP)]
Topics = Annotated[str | None, typer.Option("--topics", help=_TOPICS_HELP)]
Recordings = Annotated[
    list[Path],
    typer.Argument(metavar="REC...", help="CSV (.gz), column file or rosbag2 folder; one or more."),
]
OutputDirectory = Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results.")]


def say(text: str) -> None:
    """Tell the user something beside the results: standard output stays free for those."""
    print(text, file=sys.stderr, flush=True)


def read(path: Path, columns: str | None, rate_hz: float | None, topics: str | None) -> Recording:
    """Read a recording as the options say."""
    from fomrc_core.storage import read_recording
    from fomrc_core.storage.told_columns import column_numbers, named_once

    return read_recording(
        path,
        columns=None if columns is None else column_numbers(columns, "--columns"),
        rate_hz=rate_hz,
        topics=None if topics is None else named_once(topics, "--topics"),
    )


@contextmanager
def worker_threads() -> Iterator[ThreadPoolExecutor | None]:
    """Give one thread per processor to work in; None where there is one only.

    Kernels and linear algebra release the interpreter; processes would spend longer on passing the records' columns
    to and fro than on working with them.
    """
    n_processors = os.cpu_count() or 1
    if n_processors < 2:
        yield None
        return
    with ThreadPoolExecutor(n_processors) as executor:
        yield executor


@contextmanager
def progress_shown(title: str) -> Iterator[Progress]:
    """Show how far a long work has come: a bar on a terminal, a line per stage elsewhere."""
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    console = Console(stderr=True)
    if not console.is_terminal:
        last = ""

        def tell(share: float, text: str) -> None:
            nonlocal last
            if text != last:
                say(f"{title}: {100.0 * min(max(share, 0.0), 1.0):3.0f} % {text}")
            last = text

        yield tell
        return
    shown = (TextColumn("{task.fields[title]}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Bars(*shown, TextColumn("{task.description}"), console=console, transient=True) as bars:
        task = bars.add_task("", total=1.0, title=title)
        yield lambda share, text: bars.update(task, completed=share, description=text)

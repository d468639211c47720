"""Options several commands share, and how recordings are read by them."""

from __future__ import annotations

from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fomrc_core.cli.progress import say, sign_of_life
from fomrc_core.errors import RecordingError

if TYPE_CHECKING:
    from fomrc_core.records.recording import Recording
    from fomrc_core.storage.reading import ReadingOptions

_COLUMNS_HELP = "Which column (from 0) is what, in a file without header: time=none,voltage=0,displacement=4."
_RATE_HELP = "Sample rate [Hz] of a file without time."
_TOPICS_HELP = "Which topic is what, in a rosbag2 folder: voltage=/x/voltage,displacement=/x/displacement."

Columns = Annotated[str | None, typer.Option("--columns", help=_COLUMNS_HELP)]
Rate = Annotated[float | None, typer.Option("--rate", help=_RATE_HELP)]
Topics = Annotated[str | None, typer.Option("--topics", help=_TOPICS_HELP)]
Units = Annotated[
    str | None,
    typer.Option(
        "--units", help="Units the file does not tell: time=ms,voltage=mV,displacement=nm; 15V is 15 V a count."
    ),
]
Accept = Annotated[bool, typer.Option("--accept", help="Go on where a recording looks wrong.")]
DropNan = Annotated[bool, typer.Option("--drop-nan", help="Leave out rows that hold no number.")]
Sort = Annotated[bool, typer.Option("--sort", help="Sort rows by time, keep the first of those of one time.")]
Despike = Annotated[bool, typer.Option("--despike", help="Replace spikes and dropouts by straight lines.")]
Resample = Annotated[float | None, typer.Option("--resample", metavar="HZ", help="Interpolate to an even rate [Hz].")]
MaxMemory = Annotated[
    float,
    typer.Option(
        "--max-memory", metavar="GB", help="Bound of memory: longer recordings are thinned, which the result states."
    ),
]
Recordings = Annotated[
    list[Path],
    typer.Argument(metavar="REC...", help="CSV (.gz), a table of another program, or rosbag2 folder; one or more."),
]
OutputDirectory = Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results.")]


# The command line as it was given, for results to say how they are made again.
COMMAND: ContextVar[tuple[str, ...]] = ContextVar("fomrc_command", default=())


@dataclass(frozen=True)
class Reading:
    """How a command reads its recordings, as the options say it."""

    columns: str | None = None
    rate_hz: float | None = None
    topics: str | None = None
    units: str | None = None
    drop_nan: bool = False
    sort: bool = False
    despike: bool = False
    resample_hz: float | None = None
    is_accepted: bool = False

    def read(self, path: Path, *, is_judged: bool = True) -> Recording:
        """Read a recording, say in a line what was read, and what was changed.

        Args:
            path: file or folder.
            is_judged: refuse what no piezo actuator does, unless that was accepted; only say it where not.

        Raises:
            RecordingError: what was read looks wrong.
        """
        from fomrc_core.records.plausibility import summary_line, suspicions
        from fomrc_core.storage.reading import read_as

        with sign_of_life(f"read {path.name}"):
            found = read_as(path, self.options())
        recording = found.recording
        say(f"read {recording.name}: {summary_line(recording)}")
        for change in found.changes:
            say(f"read {recording.name}: {change}")
        doubts = suspicions(recording)
        if doubts and is_judged and not self.is_accepted:
            raise RecordingError(
                "; ".join(doubts), where=recording.name, value=summary_line(recording), allowed="--accept to go on"
            )
        for doubt in doubts:
            say(f"read {recording.name}: {doubt}")
        return recording

    def options(self) -> ReadingOptions:
        """Return the same as the reader takes it."""
        from fomrc_core.storage.foreign import told_units
        from fomrc_core.storage.reading import ReadingOptions
        from fomrc_core.storage.told_columns import column_numbers, named_once

        return ReadingOptions(
            columns=None if self.columns is None else column_numbers(self.columns, "--columns"),
            rate_hz=self.rate_hz,
            topics=None if self.topics is None else named_once(self.topics, "--topics"),
            units=None if self.units is None else told_units(self.units),
            drop_nan=self.drop_nan,
            sort=self.sort,
            despike=self.despike,
            resample_hz=self.resample_hz,
        )

"""``fomrc check``: what recordings are good for, and what to record next."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated

import typer

from fomrc_core.cli.options import (
    Accept,
    Columns,
    Despike,
    DropNan,
    Rate,
    Reading,
    Recordings,
    Resample,
    Sort,
    Topics,
    Units,
)
from fomrc_core.cli.progress import progress_shown


def check(
    recordings: Recordings,
    max_voltage: Annotated[
        float | None, typer.Option(metavar="V", help="Largest voltage of what is to be recorded next, of either sign.")
    ] = None,
    max_rate: Annotated[float, typer.Option(metavar="V/S", help="Fastest change of it.")] = math.inf,
    max_time: Annotated[float, typer.Option(metavar="S", help="Longest duration of it.")] = math.inf,
    elements: Annotated[int, typer.Option(metavar="N", help="Elements of the model to be identified.")] = 10,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="F", help="Also write the result as JSON.")] = (
        None
    ),
    columns: Columns = None,
    rate: Rate = None,
    topics: Topics = None,
    units: Units = None,
    drop_nan: DropNan = False,
    sort: Sort = False,
    despike: Despike = False,
    resample: Resample = None,
    accept: Accept = False,
) -> None:
    """Say what recordings are good for: how sure parameters would be, which causes would show, what to record next."""
    from fomrc_core.report.check_results import check_results
    from fomrc_core.report.drive_to_add import DriveLimits
    from fomrc_core.report.recording_check import check_recordings
    from fomrc_core.storage import check_outputs, write_text

    if json_file is not None:
        check_outputs({"--json": json_file}, recordings)
    reading = Reading(columns, rate, topics, units, drop_nan, sort, despike, resample, accept)
    records = [reading.read(path) for path in recordings]
    largest = max(float(abs(record.voltage_v).max()) for record in records)
    limits = DriveLimits(largest if max_voltage is None else max_voltage, max_rate, max_time)
    with progress_shown("check") as progress:
        found = check_recordings(records, limits=limits, n_elements=elements, progress=progress)
    if json_file is not None:
        write_text(json.dumps(check_results(found), indent=2, allow_nan=False) + "\n", json_file)
    print(found)

"""``fomrc compare``, ``reproduce``, ``data`` and ``demo``: the field, the paper, measured data, the whole."""

from __future__ import annotations

import importlib.util
import os
import random
import sys
from pathlib import Path
from typing import Annotated

import typer

from fomrc_core.cli.options import (
    Accept,
    Columns,
    Despike,
    DropNan,
    OutputDirectory,
    Rate,
    Reading,
    Recordings,
    Resample,
    Sort,
    Topics,
    Units,
)
from fomrc_core.cli.progress import progress_shown, say
from fomrc_core.errors import DataUnavailableError, FomrcError


def compare(
    recordings: Recordings,
    test: Annotated[Path, typer.Option("--test", metavar="T.csv", help="Recording held out of every fit.")],
    output: OutputDirectory,
    model: Annotated[
        Path | None,
        typer.Option("--model", "-m", metavar="M.yaml", help="Extended model to score beside the others."),
    ] = None,
    models: Annotated[
        str | None,
        typer.Option(metavar="PART,...", help="Only those with one of these in their names, beside ours."),
    ] = None,
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
    """Compare the model with those of the field, on the same data with the same split.

    Minutes for each model on a long recording. Each is kept in the folder as it is done; run again after an
    interruption to go on.
    """
    from fomrc_core.comparison.comparison import FILE_NAMES, rivals_named
    from fomrc_core.comparison.comparison import compare as score_all
    from fomrc_core.storage import check_outputs, files_in, make_directory, read_model

    check_outputs(files_in(output, FILE_NAMES), [*recordings, test, *([model] if model else [])])
    extended = read_model(model) if model else None
    rivals = None if models is None else rivals_named([part.strip() for part in models.split(",")])
    reading = Reading(columns, rate, topics, units, drop_nan, sort, despike, resample, accept)
    records = [reading.read(path) for path in recordings]
    held_out = reading.read(test)
    folder = make_directory(output)
    with progress_shown("compare") as progress:
        comparison = score_all(records, held_out, folder, progress, rivals=rivals, extended_model=extended)
    print(comparison)


def reproduce(output: OutputDirectory) -> None:
    """Reproduce the paper's tables and figures on simulated data with the same excitations."""
    from fomrc_core.storage import make_directory

    folder = make_directory(output)
    with progress_shown("reproduce") as progress:
        progress(0.0, "loading models, fits and diagnosis")
        from fomrc_core.reproduction.reproduction import reproduce as reproduce_all

        reproduction = reproduce_all(folder, progress=progress)
    print(reproduction)


def data(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]...", help="Data sets; all of them unless told.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Also write the recordings as CSV.")
    ] = None,
) -> None:
    """Find measured examples, fetching what is not on this machine."""
    from fomrc_core.storage import make_directory
    from fomrc_core.storage.measured_examples import DATA_SETS, locate

    missing = []
    for name in names or DATA_SETS:
        try:
            paths = locate(name)
        except DataUnavailableError as error:
            missing.append(error)
            continue
        measured = DATA_SETS[name]
        print(f"{name}: {measured.description} ({measured.licence})")
        for path in paths:
            print(f"  {path}")
        if output is not None:
            for path in _exported(name, make_directory(output)):
                print(f"  {path}")
    if missing:
        for reason in missing[:-1]:
            say(f"fomrc: {reason}")
        raise missing[-1]


def demo(context: typer.Context) -> None:
    """Linearise a piezo stage through ROS, and identify a measured one; needs ROS 2.

    --fast drives fast rasters on a stage that rings instead; --output DIR is where pictures and models go.
    """
    needed = [name for name in ("fomrc_ros", "rclpy") if importlib.util.find_spec(name) is None]
    if needed:
        raise FomrcError(f"demo needs {' and '.join(needed)}: source a ROS 2 installation or pip install '.[ros]'")
    # The ROS wheels restart Python once and leave this mark, with which a further Python would not do so.
    environment = {name: value for name, value in os.environ.items() if name != "_ROS_WHEELS_BOOTSTRAP_COMPLETE"}
    environment.setdefault("ROS_DOMAIN_ID", str(random.randint(1, 100)))
    environment.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    sys.stdout.flush()
    # In place of this process, so that signals and the exit status need nobody to pass them on.
    os.execve(sys.executable, [sys.executable, "-m", "fomrc_ros.demo", *context.args], environment)


def _exported(name: str, folder: Path) -> list[Path]:
    from fomrc_core.storage import write_recording
    from fomrc_core.storage.measured_examples import fsm, pea_1hz

    if name == "pea_1hz":
        train, test = pea_1hz()
        records = {"pea_1hz_train.csv": train, "pea_1hz_test.csv": test}
    else:
        records = {f"fsm_{amplitude}mv.csv": fsm(amplitude_mv=amplitude) for amplitude in (100, 300)}
    for file_name, record in records.items():
        write_recording(record, folder / file_name)
    return [folder / file_name for file_name in records]

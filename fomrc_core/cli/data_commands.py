"""``fomrc import`` and ``fomrc doctor``: files of other programs, and what this installation has."""

from __future__ import annotations

import importlib.util
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
    Resample,
    Sort,
    Topics,
    Units,
)
from fomrc_core.cli.progress import say, sign_of_life

_LIBRARIES = {
    "numba": "kernels at the speed of C; without it everything takes some hundred times as long",
    "bokeh": "figures to zoom on the pages; without it they have pictures only (pip install bokeh)",
    "rclpy": "the ROS nodes and `fomrc demo` (a ROS 2 installation, or pip install 'fomrc_ros[ros]')",
    "rosbags": "rosbag2 recordings (pip install 'fomrc_ros[bags]')",
    "pandas": "parquet and Excel files (pip install 'fomrc_ros[formats]')",
    "h5py": "HDF5 and MATLAB 7.3 files (pip install 'fomrc_ros[formats]')",
    "nptdms": "LabVIEW TDMS files (pip install 'fomrc_ros[formats]')",
    "distributed": "fleets over Dask (pip install distributed)",
}


def import_file(
    recording: Annotated[
        Path, typer.Argument(metavar="FILE", help="Text, .npz, .mat, .h5, .parquet, .xlsx, .tdms or rosbag2 folder.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="CSV", help="Recording to write.")],
    plot: Annotated[Path | None, typer.Option("--plot", metavar="PNG", help="Also draw what was read.")] = None,
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
    """Read a recording of another program, say how it was understood, and write it as a CSV of ours.

    Columns and units are read from the headers; a unit that is not told is asked for (--units), never assumed.
    """
    from fomrc_core.records.quality import examine
    from fomrc_core.report.recording_figure import recording_png
    from fomrc_core.storage import check_outputs, write_recording
    from fomrc_core.storage.atomic import write_bytes
    from fomrc_core.storage.reading import understood_file

    check_outputs({"--output": output, **({"--plot": plot} if plot else {})}, [recording])
    reading = Reading(columns, rate, topics, units, drop_nan, sort, despike, resample, accept)
    record = reading.read(recording)
    with sign_of_life("import"):
        # columns the user told of are understood as told
        if recording.is_file() and columns is None:
            say(f"understood: {understood_file(recording, reading.options()).description}")
        if record.displacement_um is not None:
            for line in str(examine(record).quality).splitlines():
                say(f"data quality: {line}")
        write_recording(record, output)
        if plot:
            write_bytes(recording_png(record), plot)
    print(record)


def doctor() -> None:
    """Say what this installation has, what it lacks, and what that costs."""
    import os
    import platform

    from fomrc_core import __version__
    from fomrc_core.compute.compiled import IS_COMPILED

    print(f"fomrc {__version__}, Python {platform.python_version()}, {os.cpu_count()} processors")
    print(f"compiled kernels: {'yes' if IS_COMPILED else 'no'}")
    for name, purpose in _LIBRARIES.items():
        state = "there" if importlib.util.find_spec(name) is not None else "missing"
        print(f"{name}: {state}, {'for' if state == 'there' else 'needed for'} {purpose}")
    folder = os.environ.get("FOMRC_DATA")
    print(f"measured examples: {folder or 'in the cache of the user (FOMRC_DATA is not set)'}")

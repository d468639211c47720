"""``fomrc identify-axes`` and ``fomrc benchmark``: several axes on one body."""

from __future__ import annotations

import json
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from fomrc_core.cli.options import OutputDirectory
from fomrc_core.cli.progress import progress_shown, say
from fomrc_core.errors import ParameterError


class Benchmark(Enum):
    """Which benchmark."""

    FSM = "fsm"


def identify_axes(
    recordings: Annotated[
        list[Path], typer.Argument(metavar="REC...", help="CSV or npz files, one for each realisation.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="M.yaml", help="Model file to write.")],
    modes: Annotated[str, typer.Option(metavar="auto|N", help="Number of modes.")] = "auto",
    periods: Annotated[int | None, typer.Option(metavar="P", help="Periods in each file.")] = None,
    parameters: Annotated[int, typer.Option(metavar="N", help="At most so many parameters.")] = 300,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="F", help="Also write the result as JSON.")] = (
        None
    ),
) -> None:
    """Identify several axes that share a body, from periodic records.

    Columns: time_s, voltage_1_v, ... displacement_1_um, ...; periods one after another, told by --periods or by a
    column period. Of a rosbag2: a topic voltage and displacement of each axis, or a JointState of all. Records whose
    periods disagree are named and left out. Stopped, it keeps what is done in M.yaml.unfinished, and goes on there
    when it is run again.
    """
    from fomrc_core.identification.axes import AxesOptions, kept_identification, periodic_record
    from fomrc_core.identification.axes import identify_axes as identify
    from fomrc_core.report.axes_fit_results import axes_fit_results
    from fomrc_core.storage import check_outputs, write_text
    from fomrc_core.storage.atomic import is_pipe_or_device
    from fomrc_core.storage.axes_files import read_axes_recording, write_axes_model

    outputs = {"--output": output} if json_file is None else {"--output": output, "--json": json_file}
    check_outputs(outputs, recordings)
    unfinished = None if is_pipe_or_device(output) else Path(f"{output}.unfinished")
    if unfinished is not None:
        check_outputs({**outputs, "--output (.unfinished)": unfinished}, recordings)
    options = AxesOptions(n_modes=_mode_count(modes), n_parameters_max=parameters)
    records, lines = [], None
    for path in recordings:
        found = read_axes_recording(path, periods)
        record = periodic_record(found.voltage_v, found.displacement_um, found.rate_hz, name=found.name, lines=lines)
        lines = record.lines if lines is None else lines
        records.append(record)
    kept = kept_identification(unfinished, tuple(records), options)
    if len(kept):
        say(f"goes on where it stopped: {len(kept)} fits in {unfinished}")
    try:
        with progress_shown("identify-axes") as progress:
            identification = identify(tuple(records), options, progress, kept)
    except KeyboardInterrupt:
        kept.write()
        if len(kept) and unfinished is not None:
            say(f"fomrc: stopped; {len(kept)} fits are kept in {unfinished}, the same command goes on there")
        raise
    write_axes_model(identification.model, output, identification.worst_error)
    if json_file is not None:
        results = axes_fit_results(identification)
        write_text(json.dumps(results, indent=2, allow_nan=False) + "\n", json_file)
    kept.remove()
    print(identification)


def benchmark(
    which: Annotated[Benchmark, typer.Argument(metavar="fsm", help="Which benchmark.")],
    train: Annotated[Path, typer.Option(metavar="DIR", help="Folder of u_100mV_train.npy, y_100mV_train.npy, ...")],
    output: OutputDirectory,
    test: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of u_100mV_test.npy, ...; else realisation 5 is scored.")
    ] = None,
    levels: Annotated[
        str | None, typer.Option(metavar="MV,...", help="Learn from these levels only, such as 100,300.")
    ] = None,
    parameters: Annotated[int, typer.Option(metavar="N", help="At most so many parameters.")] = 300,
) -> None:
    """Train on a published benchmark's training sets and score; the last lines are the scores, one for each level.

    Writes model.yaml, benchmark.md and benchmark.png.
    """
    from fomrc_core.comparison import mirror_benchmark
    from fomrc_core.comparison.mirror_figure import mirror_figure
    from fomrc_core.identification.axes import AxesOptions
    from fomrc_core.storage import make_directory, write_text
    from fomrc_core.storage.axes_files import write_axes_model

    del which  # there is one as yet
    chosen = _levels(levels)
    folder = make_directory(output)
    options = AxesOptions(n_parameters_max=parameters)
    with progress_shown("benchmark fsm") as progress:
        found = mirror_benchmark.run_benchmark(train, test, progress, levels_mv=chosen, options=options)
    write_axes_model(found.identification.model, folder / "model.yaml")
    write_text(mirror_benchmark.page(found), folder / "benchmark.md")
    mirror_figure(mirror_benchmark.RATE_HZ, found.spectra).savefig(folder / "benchmark.png", dpi=110)
    print(found)


def _mode_count(text: str) -> int | None:
    if text == "auto":
        return None
    if not text.isdecimal() or not 1 <= int(text) <= 40:
        raise ParameterError("not a number of modes", where="--modes", value=text, allowed="auto, or 1 to 40")
    return int(text)


def _levels(text: str | None) -> tuple[int, ...]:
    if text is None:
        return ()
    parts = text.split(",")
    if not all(part.strip().isdecimal() for part in parts):
        raise ParameterError("not a list of levels", where="--levels", value=text, allowed="such as 100,300 [mV]")
    return tuple(int(part) for part in parts)

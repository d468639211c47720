"""``fomrc identify`` and ``fomrc diagnose``: a model from data, and what it misses."""

from __future__ import annotations

import json
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from fomrc_core.cli.axes_diagnosis import diagnose_several_axes
from fomrc_core.cli.options import (
    COMMAND,
    Accept,
    Columns,
    Despike,
    DropNan,
    MaxMemory,
    OutputDirectory,
    Rate,
    Reading,
    Recordings,
    Resample,
    Sort,
    Topics,
    Units,
)
from fomrc_core.cli.progress import progress_shown, say, worker_threads
from fomrc_core.errors import ParameterError

HeldOut = Annotated[Path | None, typer.Option("--test", metavar="T.csv", help="Recording held out of the fit.")]


class Method(str, Enum):
    """How a model is fitted."""

    CONVEX = "convex"
    PAPER = "paper"


def identify(
    recordings: Recordings,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="M.yaml", help="Model file to write.")],
    test: HeldOut = None,
    elements: Annotated[str, typer.Option(metavar="N|auto", help="Number of elements that saturate.")] = "10",
    method: Annotated[Method, typer.Option(help="convex: no start values; paper: the route of section 3.")] = (
        Method.CONVEX
    ),
    json_file: Annotated[Path | None, typer.Option("--json", metavar="F", help="Also write the result as JSON.")] = (
        None
    ),
    uncertainty: Annotated[
        bool, typer.Option("--uncertainty", help="Also bootstrap how sure each parameter is, and what would tell more.")
    ] = False,
    columns: Columns = None,
    rate: Rate = None,
    topics: Topics = None,
    units: Units = None,
    drop_nan: DropNan = False,
    sort: Sort = False,
    despike: Despike = False,
    resample: Resample = None,
    accept: Accept = False,
    max_memory: MaxMemory = 2.0,
) -> None:
    """Identify a model from recordings of voltage and displacement.

    Writes a model file, which is a ROS parameter file as well. How good the fit is stands on standard output.
    """
    from fomrc_core.storage import check_outputs, write_model, write_text

    n_elements = _element_count(elements)
    outputs = {"--output": output} if json_file is None else {"--output": output, "--json": json_file}
    check_outputs(outputs, [*recordings, *([test] if test else [])])
    reading = Reading(columns, rate, topics, units, drop_nan, sort, despike, resample, accept)
    records = [reading.read(path) for path in recordings]
    held_out = reading.read(test) if test else None
    # what takes a second to import comes after the first word
    from fomrc_core.identification.convex import identify as fit_to
    from fomrc_core.identification.uncertainty import estimate_uncertainty
    from fomrc_core.report.fit_results import fit_results, uncertainty_results

    with progress_shown("identify") as progress:
        fit = fit_to(
            records,
            n_elements=n_elements,
            method=method.value,
            test=held_out,
            progress=progress,
            max_memory_gb=max_memory,
        )
    sure = None
    if uncertainty:
        with progress_shown("bootstrap") as progress:
            sure = estimate_uncertainty(fit, records, progress=progress)
    write_model(fit.model, output, fit.rms_um)
    if json_file:
        results = fit_results(fit, [record.name for record in records], method.value)
        if sure is not None:
            results["uncertainty"] = uncertainty_results(sure)
        write_text(json.dumps(results, indent=2, allow_nan=False) + "\n", json_file)
    # The error on held-out data is the last line.
    print(fit if held_out is None else f"{fit} ({held_out.name})")
    if sure is not None:
        print(sure)
    for record, start in zip(records, fit.starts, strict=True):
        say(f"{record.name}: taken to begin {start}")


def diagnose(
    recordings: Recordings,
    output: OutputDirectory,
    test: HeldOut = None,
    report: Annotated[
        Path | None,
        typer.Option(metavar="R.csv", help="Third recording, on which before and after are quoted."),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option("--model", "-m", metavar="M.yaml", help="Base model; fitted where not given."),
    ] = None,
    periods: Annotated[
        int | None, typer.Option(metavar="P", help="Periods in each file, of recordings of several axes.")
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
    max_memory: MaxMemory = 2.0,
    thorough: Annotated[
        bool, typer.Option("--thorough", help="Go on where the search would be cut short: minutes.")
    ] = False,
) -> None:
    """Find what a simulation gets wrong, name the cause, extend the model and measure the gain.

    Recordings of several axes (columns voltage_1_v, ..., displacement_1_um, ..., or topics of each in a bag) are
    diagnosed against --model.
    Writes diagnosis.json, extended_model.yaml and report.html into the folder.
    """
    from fomrc_core.storage.axes_files import is_axes_recording

    if recordings and topics is None and is_axes_recording(recordings[0]):
        if report is not None:
            raise ParameterError("not with several axes", where="--report", value=str(report), allowed="--test")
        if thorough:
            raise ParameterError("not with several axes", where="--thorough", value="given", allowed="nothing")
        return diagnose_several_axes(recordings, output, test, model, periods)
    from fomrc_core.fitting.memory_plan import DIAGNOSING
    from fomrc_core.records.usability import check_usable
    from fomrc_core.report.diagnosis_names import FILE_NAMES
    from fomrc_core.storage import check_outputs, files_in, make_directory, read_model

    inputs = [*recordings, *(path for path in (test, report, model) if path is not None)]
    check_outputs(files_in(output, FILE_NAMES), inputs)
    base = read_model(model) if model else None
    reading = Reading(columns, rate, topics, units, drop_nan, sort, despike, resample, accept)
    records = [reading.read(path) for path in recordings]
    held_out = reading.read(test) if test else None
    third = reading.read(report) if report else None
    given = [record for record in (*records, held_out, third) if record is not None]
    if sum(record.n_samples for record in given) <= DIAGNOSING.n_whole_max:  # longer ones are looked at in parts
        check_usable(given)
    from fomrc_core.report.provenance import Provenance

    read = [("recording", path) for path in recordings]
    read += [(role, path) for role, path in (("test", test), ("report", report), ("model", model)) if path is not None]
    provenance = Provenance.of(COMMAND.get(), read)
    folder = make_directory(output)
    with progress_shown("diagnose") as progress, worker_threads() as executor:
        progress(0.0, "loading the library of causes")  # which takes seconds
        from fomrc_core.diagnosis.diagnosis import diagnose as find_causes
        from fomrc_core.report.diagnosis_files import write_report

        diagnosis = find_causes(
            records,
            test=held_out,
            report=third,
            model=base,
            progress=progress,
            executor=executor,
            max_memory_gb=max_memory,
            thorough=thorough,
        )
        progress(1.0, "report")
        write_report(diagnosis, folder, provenance)
    print(diagnosis)
    if diagnosis.left_out and not thorough:
        say("--thorough goes on where the search was cut short, for some minutes")
    say(f"{folder / 'report.html'}")


def _element_count(text: str) -> int | str:
    if text == "auto":
        return text
    try:
        return int(text)
    except ValueError:
        raise ParameterError("not a number", where="--elements", value=text, allowed="1 to 60, or auto") from None

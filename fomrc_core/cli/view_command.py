"""``fomrc view``: a page to look at a recording, a model, two models, or models on a recording."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from fomrc_core.cli.options import (
    COMMAND,
    Columns,
    DropNan,
    Rate,
    Reading,
    Sort,
    Topics,
    Units,
)
from fomrc_core.cli.progress import say, sign_of_life
from fomrc_core.errors import ParameterError

_MODEL_SUFFIXES = (".yaml", ".yml")
_N_MODELS_MAX, _N_RECORDINGS_MAX = 2, 1


def view(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="REC_OR_MODEL...", help="A recording, a model (.yaml), two models, or both kinds."),
    ],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Page to write; by default NAME_view.html here."),
    ] = None,
    no_open: Annotated[bool, typer.Option("--no-open", help="Write the page, open no browser.")] = False,
    max_voltage: Annotated[
        float | None, typer.Option(metavar="V", help="Largest voltage of the drive models are shown on.")
    ] = None,
    columns: Columns = None,
    rate: Rate = None,
    topics: Topics = None,
    units: Units = None,
    drop_nan: DropNan = False,
    sort: Sort = False,
) -> None:
    """Write a page to look at a recording, a model, two models, or what models leave of a recording.

    One file that loads nothing and opens in the browser: a figure to zoom and to mark samples in, tables, checksums.
    """
    from fomrc_core.report.provenance import Provenance
    from fomrc_core.report.view_pages import comparison_page, model_page, recording_page, residual_page
    from fomrc_core.storage import check_outputs, read_model, write_text

    model_files = [path for path in files if path.suffix.lower() in _MODEL_SUFFIXES]
    recordings = [path for path in files if path not in model_files]
    _check_kinds(model_files, recordings)
    if max_voltage is not None and not 0.0 < max_voltage < float("inf"):
        raise ParameterError("out of range", where="--max-voltage", value=max_voltage, allowed="above 0, in V")
    page = output or Path("_and_".join(path.name.partition(".")[0] or "page" for path in files) + "_view.html")
    check_outputs({"--output": page}, files)
    models = dict(zip(_names(model_files), map(read_model, model_files), strict=True))
    reading = Reading(columns, rate, topics, units, drop_nan, sort)
    records = [reading.read(path, is_judged=False) for path in recordings]
    roles = [("model", path) for path in model_files] + [("recording", path) for path in recordings]
    origin = Provenance.of(COMMAND.get(), roles)
    with sign_of_life("view"):
        if records and models:
            text = residual_page(models, records[0], origin)
        elif records:
            text = recording_page(records[0], origin)
        elif len(models) > 1:
            text = comparison_page(models, max_voltage, origin)
        else:
            ((name, model),) = models.items()
            text = model_page(name, model, max_voltage, origin)
    write_text(text, page)
    print(page)
    if not no_open and not webbrowser.open(page.resolve().as_uri()):
        say("no browser could be opened; open the page by hand")


def _check_kinds(models: list[Path], recordings: list[Path]) -> None:
    if len(models) > _N_MODELS_MAX or len(recordings) > _N_RECORDINGS_MAX:
        raise ParameterError(
            "too many files",
            where="REC_OR_MODEL",
            value=f"{len(models)} models and {len(recordings)} recordings",
            allowed=f"up to {_N_MODELS_MAX} models (.yaml) and {_N_RECORDINGS_MAX} recording",
        )


def _names(paths: list[Path]) -> list[str]:
    """Return the names of files, with their folders where the names alone are the same."""
    names = [path.name for path in paths]
    if len(set(names)) == len(names):
        return names
    told = [str(path) for path in paths]
    return told if len(set(told)) == len(told) else [f"{k}. {text}" for k, text in enumerate(told, 1)]

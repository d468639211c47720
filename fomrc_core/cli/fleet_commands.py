"""``fomrc identify-fleet`` and ``diagnose-fleet``: one model, or one diagnosis, for each recording of a folder."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from fomrc_core.cli.fit_commands import Method, _element_count
from fomrc_core.cli.options import Columns, OutputDirectory, Rate
from fomrc_core.cli.progress import progress_shown, say
from fomrc_core.errors import ParameterError

Folder = Annotated[Path, typer.Argument(metavar="DIR", help="Folder of recordings, one for each actuator.")]
Workers = Annotated[
    int | None, typer.Option(metavar="N", help="Processes side by side; as many as processors by default.")
]
Scheduler = Annotated[
    str | None, typer.Option(metavar="HOST:PORT", help="A Dask scheduler whose workers see the same folders.")
]


def identify_fleet(
    folder: Folder,
    output: OutputDirectory,
    elements: Annotated[str, typer.Option(metavar="N|auto", help="Number of elements that saturate.")] = "10",
    method: Annotated[Method, typer.Option(help="As for identify.")] = Method.CONVEX,
    columns: Columns = None,
    rate: Rate = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> int:
    """Identify a model for each recording of a folder.

    Writes NAME.model.yaml and NAME.fit.json for each. Run again after an interruption to go on: what is done is
    kept. A record that fails is told and passed over; exit status 2 says that there were such.
    """
    from fomrc_core.identification import fleet
    from fomrc_core.storage import make_directory
    from fomrc_core.storage.told_columns import column_numbers

    numbers = column_numbers(columns, "--columns") if columns is not None else None
    options = fleet.FleetOptions(
        n_elements=_element_count(elements),
        method=method.value,
        columns=tuple(numbers.items()) if numbers else None,
        rate_hz=rate,
    )
    recordings = fleet.records_in(folder)
    make_directory(output)
    with progress_shown("identify-fleet") as progress, _workers_of(scheduler) as executor:
        records = fleet.identify_fleet(
            recordings, output, options=options, executor=executor, n_workers=workers, progress=progress
        )
    failed = [record for record in records if not record.is_done]
    for record in records:
        if record.is_done:
            print(record)
    for record in failed:
        say(f"fomrc: {record}")
    print(f"{len(records) - len(failed)} of {len(records)} recordings identified, models in {output}")
    return 2 if failed else 0


def diagnose_fleet(
    folder: Folder,
    output: OutputDirectory,
    columns: Columns = None,
    rate: Rate = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> int:
    """Diagnose each recording of a folder by itself, and tell which share a cause and which one is alone.

    Writes the files of diagnose into NAME.diagnosis/ for each, and fleet.csv with a row for each. Run again after an
    interruption to go on: what is done is kept. A record that fails is told and passed over; exit status 2 says that
    there were such.
    """
    from fomrc_core.report.diagnosis_fleet import DiagnosisFleetOptions
    from fomrc_core.report.diagnosis_fleet import diagnose_fleet as diagnose_all
    from fomrc_core.storage import make_directory
    from fomrc_core.storage.record_work import records_in
    from fomrc_core.storage.told_columns import column_numbers

    numbers = column_numbers(columns, "--columns") if columns is not None else None
    options = DiagnosisFleetOptions(tuple(numbers.items()) if numbers else None, rate)
    recordings = records_in(folder)
    make_directory(output)
    with progress_shown("diagnose-fleet") as progress, _workers_of(scheduler) as executor:
        found = diagnose_all(
            recordings, output, options=options, executor=executor, n_workers=workers, progress=progress
        )
    failed = [record for record in found.records if not record.is_done]
    for record in found.records:
        if record.is_done:
            print(record)
    for record in failed:
        say(f"fomrc: {record}")
    print(found)
    print(f"{len(found.records) - len(failed)} of {len(found.records)} recordings diagnosed, reports in {output}")
    return 2 if failed else 0


@contextmanager
def _workers_of(scheduler: str | None) -> Iterator[Executor | None]:
    if scheduler is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        raise ParameterError(
            "Dask is not installed", where="--scheduler", value=scheduler, allowed="after: pip install distributed"
        ) from None
    try:
        client = Client(scheduler, timeout=10)
    except (OSError, ValueError) as error:
        raise ParameterError(
            f"no scheduler reached ({error})",
            where="--scheduler",
            value=scheduler,
            allowed="HOST:PORT of a running one",
        ) from None
    with client, client.get_executor() as executor:
        yield executor

"""``fomrc watch``: is the stage still its model?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fomrc_core.cli.model_commands import ModelFile
from fomrc_core.cli.options import (
    Columns,
    Rate,
    Reading,
    Recordings,
    Topics,
    Units,
)
from fomrc_core.cli.progress import say

# What is simulated at a time of a long recording.
_N_CHUNK = 100_000
_SAME_PERIOD = 0.01


def watch(
    recordings: Recordings,
    model: ModelFile,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder for a page of each change.")
    ] = None,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="F.json", help="What was noticed, for programs.")
    ] = None,
    false_alarms_per_day: Annotated[
        float, typer.Option("--false-alarms-per-day", metavar="N", help="Wanted in normal work, in the mean.")
    ] = 0.1,
    learn_s: Annotated[
        float, typer.Option("--learn", metavar="S", help="Motion that normal work is learnt from [s].")
    ] = 120.0,
    columns: Columns = None,
    rate: Rate = None,
    topics: Topics = None,
    units: Units = None,
) -> None:
    """Run the model beside recordings of one stage, in their order, and say when the stage is no longer that model.

    What is normal is learnt from the first motion. Prints a line for each change: since when, what it is, how sure.
    """
    import json

    from fomrc_core.diagnosis.watch.model_watch import ModelWatch, WatchSettings, WatchState
    from fomrc_core.diagnosis.watch.naming import name_case
    from fomrc_core.errors import RecordingError
    from fomrc_core.report.change_files import change_line, change_results, write_change
    from fomrc_core.storage import check_outputs, make_directory, read_fit_error, read_model, write_text

    outputs = {"--json": json_file} if json_file is not None else {}
    check_outputs(outputs, [model, *recordings])
    actuator, fit_rms_um = read_model(model), read_fit_error(model)
    settings = WatchSettings(false_alarms_per_day, learn_s=learn_s)
    folder: Path | None = None
    watcher: ModelWatch | None = None
    changes: list[dict[str, object]] = []

    def tell(*, is_last: bool) -> None:
        assert watcher is not None
        while (case := watcher.next_case(is_last=is_last)) is not None:
            found = name_case(case)
            print(change_line(case.alarm, found, case.began_s), flush=True)
            changes.append(change_results(case.alarm, found, case.began_s))
            if folder is not None:
                write_change(case, found, make_directory(folder / f"change_{len(changes)}"))

    reading = Reading(columns, rate, topics, units)
    for path in recordings:
        record = reading.read(path, is_judged=False)
        moved_um = record.measured_um
        if watcher is None:
            # not before there is something to watch: a refused recording leaves no folder behind
            folder = make_directory(output) if output is not None else None
            watcher = ModelWatch(actuator, record.sample_period_s, settings, fit_rms_um)
        elif abs(record.sample_period_s - watcher.period_s) > _SAME_PERIOD * watcher.period_s:
            raise RecordingError(
                "sampled at another period than the first record",
                where=str(path),
                value=record.sample_period_s,
                allowed=f"{watcher.period_s:g} s",
            )
        else:
            watcher.begin_record()
        for start in range(0, record.n_samples, _N_CHUNK):
            part = slice(start, start + _N_CHUNK)
            watcher.take(record.steps_s[part], record.voltage_v[part], moved_um[part])
            tell(is_last=False)
        tell(is_last=True)
    assert watcher is not None
    if not changes:
        learnt = watcher.state is WatchState.WATCHING
        print("no change noticed" if learnt else "too little motion to learn what is normal: nothing was watched")
    say(f"{watcher.time_s:.0f} s watched, {len(changes)} changes noticed")
    if json_file is not None:
        summary = {"watched_s": watcher.time_s, "state": watcher.state.value, "changes": changes}
        write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n", json_file)

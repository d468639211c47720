"""Identify many actuators: one record, one model file, any executor, resumable, failures told and passed over."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fomrc_core.storage import read_recording, write_model
from fomrc_core.storage.record_work import RecordWork, WorkProgress, records_in, work_on

__all__ = ["MODEL_SUFFIX", "RESULT_SUFFIX", "FleetOptions", "FleetRecord", "identify_fleet", "records_in"]

RESULT_SUFFIX = ".fit.json"
MODEL_SUFFIX = ".model.yaml"


@dataclass(frozen=True)
class FleetOptions:
    """How each record is read and fitted.

    Attributes:
        n_elements: number of elements that saturate, or "auto".
        method: "convex" or "paper".
        columns: column of each quantity in a file without header, as (name, number); None for the header's names.
        rate_hz: sample rate of files without time [Hz].
    """

    n_elements: int | str = 10
    method: str = "convex"
    columns: tuple[tuple[str, int | None], ...] | None = None
    rate_hz: float | None = None


@dataclass(frozen=True)
class FleetRecord:
    """What became of one record.

    Attributes:
        name: name of the record's file, without its folder.
        is_done: whether a model was identified.
        is_kept: whether the result is that of an earlier run.
        reason: why the fit ended, or why there is none.
        nrmse_percent: error of the fit [%]; NaN where there is none.
        creep_order: creep order found [1]; NaN where there is none.
    """

    name: str
    is_done: bool
    is_kept: bool
    reason: str
    nrmse_percent: float = math.nan
    creep_order: float = math.nan

    def __str__(self) -> str:
        if not self.is_done:
            return f"{self.name} failed: {self.reason}"
        kept = " (kept)" if self.is_kept else ""
        return f"{self.name}: creep order {self.creep_order:.5g}, NRMSE {self.nrmse_percent:.4g} %{kept}"


def identify_fleet(
    recordings: Sequence[Path],
    output: Path,
    *,
    options: FleetOptions | None = None,
    executor: Executor | None = None,
    n_workers: int | None = None,
    progress: WorkProgress | None = None,
) -> tuple[FleetRecord, ...]:
    """Identify one model for each recording and return what became of each, in the order given.

    Writes NAME.model.yaml and NAME.fit.json per record into ``output``; a failed record has the second alone, with
    the reason, and is tried again by the next run. A record whose result is there, from the same file and options,
    is kept.

    Args:
        recordings: files or rosbag2 folders, each with a name of its own.
        output: folder of the results, made where it is missing.
        options: how each record is read and fitted.
        executor: runs the records; by default one process per processor. It is not shut down.
        n_workers: number of processes of the default executor.
        progress: called with the share done and the record that is done, and every few seconds with what is at work.

    Raises:
        ParameterError: two recordings of one name, or a number of workers below 1.
    """
    work = RecordWork(_identify_record, RESULT_SUFFIX, (MODEL_SUFFIX,), options or FleetOptions())
    outcomes = work_on(recordings, output, work, executor=executor, n_workers=n_workers, progress=progress)
    return tuple(
        FleetRecord(
            outcome.name,
            outcome.is_done,
            outcome.is_kept,
            outcome.reason,
            float(outcome.content.get("nrmse_percent", math.nan)),
            float(outcome.content.get("creep_order", math.nan)),
        )
        for outcome in outcomes
    )


def _identify_record(path: Path, folder: Path, options: FleetOptions) -> Mapping[str, Any]:
    """Identify one record and write its model; the work of one worker."""
    from fomrc_core.identification.convex import identify

    columns = dict(options.columns) if options.columns else None
    record = read_recording(path, columns=columns, rate_hz=options.rate_hz)
    fit = identify(record, n_elements=options.n_elements, method=options.method)
    write_model(fit.model, folder / f"{path.name}{MODEL_SUFFIX}")
    return {
        "reason": f"{fit.outcome.value}: {fit.reason}",
        "nrmse_percent": fit.nrmse_percent,
        "rms_um": fit.rms_um,
        "noise_um": fit.noise_um,
        "creep_order": fit.model.creep_order,
    }

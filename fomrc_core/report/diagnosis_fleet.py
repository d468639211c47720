"""Diagnose many actuators: one report each, one row each in a table, and which of them share a cause."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.diagnosis.judgement import Status
from fomrc_core.model.causes import cause_classes
from fomrc_core.report.diagnosis_files import write_report
from fomrc_core.report.provenance import Provenance
from fomrc_core.storage import make_directory, read_recording, write_text
from fomrc_core.storage.record_work import RecordWork, WorkProgress, work_on

RESULT_SUFFIX = ".diagnosis.json"
REPORT_SUFFIX = ".diagnosis"  # a folder
TABLE_NAME = "fleet.csv"
_HEAD = (
    *("recording", "status", "causes", "main_parameters", "ambiguous_with"),
    *("nrmse_percent_before", "nrmse_percent_after", "next"),
)


@dataclass(frozen=True)
class DiagnosisFleetOptions:
    """How each record is read.

    Attributes:
        columns: column of each quantity in a file without header, as (name, number); None for the header's names.
        rate_hz: sample rate of files without time [Hz].
    """

    columns: tuple[tuple[str, int | None], ...] | None = None
    rate_hz: float | None = None


@dataclass(frozen=True)
class DiagnosedRecord:
    """What became of one record.

    Attributes:
        name: name of the record's file, without its folder.
        is_done: whether it was diagnosed.
        is_kept: whether the result is that of an earlier run.
        reason: what the diagnosis came to, or why there is none.
        causes: main parameter of each cause found, in order of acceptance; NaN where it has no single value.
        nrmse_percent_before: held-out error of hysteresis and creep alone [%]; NaN where there is none.
        nrmse_percent_after: held-out error with what was found [%].
        next_experiment: what to measure next.
        ambiguous_with: causes the last one found cannot be told from.
    """

    name: str
    is_done: bool
    is_kept: bool
    reason: str
    causes: Mapping[str, float] = field(default_factory=dict)
    nrmse_percent_before: float = math.nan
    nrmse_percent_after: float = math.nan
    next_experiment: str = ""
    ambiguous_with: tuple[str, ...] = ()

    def __str__(self) -> str:
        if not self.is_done:
            return f"{self.name} failed: {self.reason}"
        found = ", ".join(f"{cause}{_sizes(np.array([value]))}" for cause, value in self.causes.items()) or "no cause"
        errors = f"{self.nrmse_percent_before:.4g} % -> {self.nrmse_percent_after:.4g} %"
        tied = f", cannot be told from {', '.join(self.ambiguous_with)}" if self.ambiguous_with else ""
        return f"{self.name}: {self.reason}: {found}{tied}, {errors}{' (kept)' if self.is_kept else ''}"


@dataclass(frozen=True)
class FleetDiagnosis:
    """What a fleet's diagnoses say together.

    Attributes:
        records: what became of each, in the order given.
    """

    records: tuple[DiagnosedRecord, ...]

    @property
    def shared_by(self) -> dict[str, tuple[DiagnosedRecord, ...]]:
        """Records by cause, the most common cause first."""
        causes: dict[str, list[DiagnosedRecord]] = {}
        for record in self.records:
            for cause in record.causes:
                causes.setdefault(cause, []).append(record)
        ordered = sorted(causes.items(), key=lambda item: (-len(item[1]), item[0]))
        return {cause: tuple(records) for cause, records in ordered}

    def __str__(self) -> str:
        """Return which records have the same cause, which one is alone with its own, and which have none."""
        lines = []
        done = [record for record in self.records if record.is_done]
        for cause, records in self.shared_by.items():
            values = np.array([record.causes[cause] for record in records])
            perhaps = [record.name for record in done if cause in record.ambiguous_with and record not in records]
            also = f", perhaps {', '.join(perhaps)}" if perhaps else ""
            names = ", ".join(record.name for record in records)
            who = f"{len(records)} of {len(done)}: {names}" if len(records) > 1 or perhaps else f"{names} alone"
            lines.append(f"{cause}{_sizes(values)}: {who}{also}")
        clean = [record.name for record in done if not record.causes and record.reason == Status.NOTHING_FOUND.value]
        open_ones = [record.name for record in done if not record.causes and record.name not in clean]
        if clean:
            lines.append(f"nothing found: {', '.join(clean)}")
        if open_ones:
            lines.append(f"not explained: {', '.join(open_ones)}")
        lines += [str(record) for record in self.records if not record.is_done]
        return "\n".join(lines)


def _sizes(values: Array) -> str:
    """Return the smallest and largest value of a main parameter in brackets; nothing where one has no single value."""
    if np.any(np.isnan(values)):
        return ""
    low, high = f"{values.min():.4g}", f"{values.max():.4g}"
    return f" ({low})" if low == high else f" ({low} to {high})"


def diagnose_fleet(
    recordings: Sequence[Path],
    output: Path,
    *,
    options: DiagnosisFleetOptions | None = None,
    executor: Executor | None = None,
    n_workers: int | None = None,
    progress: WorkProgress | None = None,
) -> FleetDiagnosis:
    """Diagnose each recording by itself and return what the diagnoses say together.

    Writes the files of ``fomrc diagnose`` into NAME.diagnosis/ and a result NAME.diagnosis.json per record, and
    fleet.csv with a row for each. What is done, from the same file and options, is kept; a failed record is told,
    passed over and tried again by the next run.

    Args:
        recordings: files or rosbag2 folders, each with a name of its own.
        output: folder of the results, made where it is missing.
        options: how each record is read.
        executor: runs the records; by default one process per processor. It is not shut down.
        n_workers: number of processes of the default executor.
        progress: called with the share done and the record that is done, and every few seconds with what is at work.

    Raises:
        ParameterError: two recordings of one name, or a number of workers below 1.
    """
    work = RecordWork(_diagnose_record, RESULT_SUFFIX, (), options or DiagnosisFleetOptions())
    outcomes = work_on(recordings, output, work, executor=executor, n_workers=n_workers, progress=progress)
    records = []
    for outcome in outcomes:
        content = outcome.content
        causes = {cause: math.nan if v is None else float(v) for cause, v in content.get("causes", {}).items()}
        before, after = (float(content.get(f"nrmse_percent_{when}", math.nan)) for when in ("before", "after"))
        told = str(content.get("next_experiment", ""))
        what = (outcome.name, outcome.is_done, outcome.is_kept, outcome.reason)
        tied = tuple(str(cause) for cause in content.get("ambiguous_with", ()))
        records.append(DiagnosedRecord(*what, causes, before, after, told, tied))
    found = FleetDiagnosis(tuple(records))
    write_text(_table(found), Path(output) / TABLE_NAME)
    return found


def _diagnose_record(path: Path, folder: Path, options: DiagnosisFleetOptions) -> Mapping[str, Any]:
    """Diagnose one record and write its report; the work of one worker."""
    columns = dict(options.columns) if options.columns else None
    found = diagnose(read_recording(path, columns=columns, rate_hz=options.rate_hz))
    origin = Provenance.of((), [("recording", path)])
    write_report(found, make_directory(folder / f"{path.name}{REPORT_SUFFIX}"), origin)
    causes: dict[str, float | None] = {}
    for finding in found.findings:
        main = finding.parameters.get(cause_classes()[finding.cause].main_parameter)
        causes[finding.cause] = main if isinstance(main, float) else None
    return {
        "reason": found.status.value,
        "causes": causes,
        "ambiguous_with": list(found.ambiguous_with),
        "nrmse_percent_before": found.baseline_test_percent,
        "nrmse_percent_after": found.final_test_percent,
        "next_experiment": found.next_experiment,
    }


def _table(found: FleetDiagnosis) -> str:
    rows = [",".join(_HEAD)]
    for record in found.records:
        errors = [f"{value:.6g}" for value in (record.nrmse_percent_before, record.nrmse_percent_after)]
        main = " ".join(f"{value:.6g}" for value in record.causes.values())
        status = record.reason if record.is_done else f"failed: {record.reason}"
        tied = " ".join(record.ambiguous_with)
        cells = (record.name, status, " ".join(record.causes), main, tied, *errors, record.next_experiment)
        rows.append(",".join(_cell(cell) for cell in cells))
    return "\n".join(rows) + "\n"


def _cell(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if any(letter in text for letter in ',"\n') else text

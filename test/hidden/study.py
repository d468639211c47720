"""The full study: every bar of the hidden-effect tests, measured.

Resumable: a case that has its file is not run again.

    python test/hidden/study.py [--part null ...] [--seeds N] [--jobs 2] [--output study_output]
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NoReturn

# One thread per process, before anything numerical is loaded: the processes are the parallelism.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"
_ROOT = Path(__file__).resolve().parents[2]
if __package__ in (None, ""):
    # Run as a file, its own folder leads the path and the standard library's `test` hides this one.
    sys.path[0] = str(_ROOT)

from rich.console import Console  # noqa: E402
from rich.progress import (  # noqa: E402
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from test.hidden import (  # noqa: E402
    study_cases,
    study_measured,
    study_report,
    study_scores,
    study_second,
    study_second_report,
    study_settle,
    study_table3,
    study_third,
    study_third_report,
    study_timing,
)

PARTS = (*study_cases.PARTS, "settle", "measured", "table3", "timing", "second", "third")
Job = tuple[Callable[[Any, str], str], Any]


def _jobs(part: str, n_seeds: int | None, seeds: str) -> list[Job]:
    if part == "second":
        plans = [study_second.plan(group, seeds, n_seeds) for group in study_second.GROUPS]
        return [(study_second.run, s) for plan in plans for s in plan]
    if part == "third":
        plans_third = [study_third.plan(group, seeds, n_seeds) for group in study_third.GROUPS]
        return [(study_third.run, s) for plan in plans_third for s in plan]
    if part == "settle":
        return [(study_settle.run, s) for s in study_settle.plan()]
    if part == "measured":
        return [(study_measured.run, study_measured.Measured())]
    if part == "timing":
        return [(study_timing.run, t) for t in study_timing.plan()]
    return [(study_cases.run, s) for s in study_cases.plan(part, n_seeds)]


def _is_kept(path: Path, source: str | None) -> bool:
    """Return whether a case need not run again: it did not break off, and is of this state of the source."""
    outcome = json.loads(path.read_text(encoding="utf-8"))
    return outcome["status"] != "error" and source in (None, outcome["source"])


def _run(jobs: list[Job], folder: Path, n_processes: int, console: Console, label: str) -> None:
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
    )
    with bar, ProcessPoolExecutor(n_processes, mp_context=get_context("spawn")) as pool:
        task = bar.add_task(label, total=len(jobs))
        pending = [pool.submit(function, spec, str(folder)) for function, spec in jobs]
        try:
            for done in as_completed(pending):
                key = done.result()
                bar.advance(task)
                bar.console.print(f"[dim]{key}[/dim]")
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


class _Parser(argparse.ArgumentParser):
    """Tells a bad argument in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"study: {message}\n")


def main(arguments: list[str] | None = None) -> int:
    """Run what was asked for and write the page of what is known so far."""
    parser = _Parser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", nargs="+", choices=[*PARTS, "all"], default=["all"])
    parser.add_argument("--seeds", type=int, help="seeds per cause (pairs: number of pairs) instead of the full number")
    parser.add_argument(
        "--development", action="store_true", help="second, third: seeds for development, not those that are reported"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes (default: all cores)")
    parser.add_argument("--output", type=Path, default=_ROOT / "study_output", help="folder of the cases' files")
    parser.add_argument("--docs", type=Path, help="folder of the page (default: docs/ for a full run, else the output)")
    parser.add_argument(
        "--outdated", action="store_true", help="run again what was made by another state of the source"
    )
    parser.add_argument("--report-only", action="store_true", help="run nothing, write the page")
    options = parser.parse_args(arguments)
    if options.seeds is not None and options.seeds < 1:
        parser.error("--seeds: at least 1")
    console = Console()
    seeds = "development" if options.development else "reporting"
    parts = list(PARTS) if "all" in options.part else options.part
    is_full = "all" in options.part and options.seeds is None
    folder = options.output / "cases"
    folder.mkdir(parents=True, exist_ok=True)
    docs = options.docs or (_ROOT / "docs" if is_full else options.output)
    if "measured" in parts and not (study_measured.data_folder() / "pea_1hz").is_dir():
        console.print(f"measured: no {study_measured.data_folder() / 'pea_1hz'}; name it with FOMRC_DATA. Left out.")
        parts.remove("measured")
    if not options.report_only:
        source = study_cases.source_digest()
        known = {p.stem for p in folder.glob("*.json") if _is_kept(p, source if options.outdated else None)}
        for part in parts:
            if part == "table3":
                continue
            jobs = [(function, spec) for function, spec in _jobs(part, options.seeds, seeds) if spec.key not in known]
            if jobs:
                _run(jobs, folder, 1 if part == "timing" else options.jobs, console, part)
    if "table3" in parts:
        docs.mkdir(parents=True, exist_ok=True)
        (docs / "table3_lag.md").write_text(study_table3.study(), encoding="utf-8")
    outcomes = study_scores.load(folder)
    second = [o for o in outcomes if o["spec"]["part"].startswith("second_")]
    third = [o for o in outcomes if o["spec"]["part"].startswith("third_")]
    if first := [o for o in outcomes if not o["spec"]["part"].startswith(("second_", "third_"))]:
        console.print(f"written: {study_report.write(first, docs)}")
    if second:
        console.print(f"written: {study_second_report.write_second(second, seeds, docs)}")
    if third:
        console.print(f"written: {study_third_report.write_third(third, seeds, docs)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Identify many actuators: one record, one model file, any executor, resumable, failures told and passed over.

Each record's result is a file of its own, written at once when it is done: after a kill only what was not yet done
is done. The work of one record is a plain function of file names, so that any ``concurrent.futures.Executor``
carries it to threads, processes or, by Dask's ``Client.get_executor()``, to other machines that see the same files.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from fomrc_core.errors import FomrcError, ParameterError
from fomrc_core.storage import make_directory, read_recording, write_model, write_text

RESULT_SUFFIX = ".fit.json"
MODEL_SUFFIX = ".model.yaml"
_RECORD_SUFFIXES = (".csv", ".csv.gz", ".txt", ".dat")

_BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

FleetProgress = Callable[[float, str], None]


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


def records_in(folder: Path) -> list[Path]:
    """Return the recordings in a folder, by name: files that may hold one, and rosbag2 folders.

    Raises:
        ParameterError: no such folder, or nothing in it.
    """
    if not folder.is_dir():
        raise ParameterError("no such folder", where=str(folder), allowed="a folder of recordings")
    found = [
        path
        for path in sorted(folder.iterdir())
        if path.name.lower().endswith(_RECORD_SUFFIXES) or (path / "metadata.yaml").is_file()
    ]
    if not found:
        raise ParameterError(
            "no recording found", where=str(folder), allowed=f"files {', '.join(_RECORD_SUFFIXES)}, or rosbag2 folders"
        )
    return found


def identify_fleet(
    recordings: Sequence[Path],
    output: Path,
    *,
    options: FleetOptions | None = None,
    executor: Executor | None = None,
    n_workers: int | None = None,
    progress: FleetProgress | None = None,
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
        progress: called with the share done and the record that is done.

    Raises:
        ParameterError: two recordings of one name, or a number of workers below 1.
    """
    options = options or FleetOptions()
    paths = [Path(path).absolute() for path in recordings]
    names = [path.name for path in paths]
    for name in names:
        if names.count(name) > 1:
            raise ParameterError("two recordings of one name", where="recordings", value=name, allowed="each name once")
    if n_workers is not None and n_workers < 1:
        raise ParameterError("number of workers out of range", where="n_workers", value=n_workers, allowed="1 or more")
    output = make_directory(Path(output).absolute())
    tell = progress or (lambda _share, _text: None)
    results: dict[str, FleetRecord] = {}
    waiting = []
    for path in paths:
        kept = _kept_result(path, output, options)
        if kept is None:
            waiting.append(path)
        else:
            results[path.name] = kept
    tell(len(results) / max(len(paths), 1), f"{len(results)} of {len(paths)} already done")
    if waiting:
        with _executor(executor, n_workers) as pool:
            for record in _finished(pool, waiting, output, options):
                results[record.name] = record
                mark = "done" if record.is_done else "FAILED"
                tell(len(results) / len(paths), f"{record.name}: {mark}: {record.reason}")
    return tuple(results[name] for name in names)


def _finished(pool: Executor, waiting: list[Path], output: Path, options: FleetOptions) -> Iterator[FleetRecord]:
    futures: dict[Future[FleetRecord], Path] = {
        pool.submit(identify_record, str(path), str(output), options): path for path in waiting
    }
    for future in as_completed(futures):
        try:
            yield future.result()
        except BrokenProcessPool:
            raise FomrcError("a worker process died; run again to go on where it stopped") from None
        except Exception as error:
            path = futures[future]
            yield _failed(path, output, options, f"{type(error).__name__}: {error}")


@contextmanager
def _executor(given: Executor | None, n_workers: int | None) -> Iterator[Executor]:
    if given is not None:
        yield given
        return
    # Workers as many as processors: threads of the linear algebra on top of them only wait for each other. What
    # the user has set stays.
    before = {name: os.environ.get(name) for name in _BLAS_THREADS}
    os.environ.update({name: "1" for name, value in before.items() if value is None})
    try:
        # Spawned: a fork would copy the threads' locks of whatever runs beside it.
        with ProcessPoolExecutor(n_workers, mp_context=get_context("spawn")) as pool:
            yield pool
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)


def identify_record(recording: str, output: str, options: FleetOptions) -> FleetRecord:
    """Identify one record and write its files; the work of one worker. Never raises for a bad record."""
    from fomrc_core.identification.convex import identify

    path, folder = Path(recording), Path(output)
    try:
        record = read_recording(
            path, columns=dict(options.columns) if options.columns else None, rate_hz=options.rate_hz
        )
        fit = identify(record, n_elements=options.n_elements, method=options.method)
    except FomrcError as error:
        return _failed(path, folder, options, str(error))
    write_model(fit.model, folder / f"{path.name}{MODEL_SUFFIX}")
    _write_result(
        path,
        folder,
        options,
        {
            "is_done": True,
            "reason": f"{fit.outcome.value}: {fit.reason}",
            "nrmse_percent": fit.nrmse_percent,
            "rms_um": fit.rms_um,
            "noise_um": fit.noise_um,
            "creep_order": fit.model.creep_order,
        },
    )
    return FleetRecord(
        path.name, True, False, f"{fit.outcome.value}: {fit.reason}", fit.nrmse_percent, fit.model.creep_order
    )


def _failed(path: Path, folder: Path, options: FleetOptions, reason: str) -> FleetRecord:
    _write_result(path, folder, options, {"is_done": False, "reason": reason})
    return FleetRecord(path.name, False, False, reason)


def _write_result(path: Path, folder: Path, options: FleetOptions, content: dict[str, Any]) -> None:
    content = {"recording": path.name, "fingerprint": _fingerprint(path, options), **content}
    write_text(json.dumps(content, indent=2) + "\n", folder / f"{path.name}{RESULT_SUFFIX}")


def _kept_result(path: Path, folder: Path, options: FleetOptions) -> FleetRecord | None:
    if not (folder / f"{path.name}{MODEL_SUFFIX}").is_file():
        return None
    try:
        content = json.loads((folder / f"{path.name}{RESULT_SUFFIX}").read_text())
        if content["is_done"] is not True or content["fingerprint"] != _fingerprint(path, options):
            return None
        return FleetRecord(
            path.name,
            True,
            True,
            str(content["reason"]),
            float(content["nrmse_percent"]),
            float(content["creep_order"]),
        )
    except (OSError, ValueError, KeyError, TypeError):
        return None  # cut short or not ours: done again


def _fingerprint(path: Path, options: FleetOptions) -> str:
    # Size and time of change stand for the content: hashing a day's recordings would take longer than a fit.
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    stamps = [(p.name, p.stat().st_size, p.stat().st_mtime_ns) for p in files if p.exists()]
    return hashlib.sha256(repr((stamps, options)).encode()).hexdigest()[:16]

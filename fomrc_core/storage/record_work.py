"""The same work on many recordings: any executor, resumable, failures told and passed over.

Each record's result is a JSON file of its own, written at once when it is done: after a kill only what was not yet
done is done. The work is a plain function of file names, so that any ``concurrent.futures.Executor`` carries it to
threads, processes or, by Dask's ``Client.get_executor()``, to other machines that see the same files.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import threading
import time
from collections.abc import Callable, Collection, Generator, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from fomrc_core.errors import FomrcError, ParameterError
from fomrc_core.storage.atomic import make_directory, write_text
from fomrc_core.storage.tables import number_or_none
from fomrc_core.storage.work_account import WorkAccount, at_work

_RECORD_SUFFIXES = (".csv", ".csv.gz", ".txt", ".dat")
_NOTES_SUFFIXES = (".txt", ".dat")
_N_LINES_LOOKED_AT, _N_ROWS_MIN, _LONGEST_LINE = 100, 5, 4096
_WATCH_S = 0.5  # a worker outlives its parent by no more
_LOOK_S = 1.0  # how often what the workers do is looked at
_TELL_S = 3.0  # how often it is told where no recording is done
_BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

WorkProgress = Callable[[float, str], None]


@dataclass(frozen=True)
class RecordWork:
    """What is done with each recording.

    Attributes:
        function: called with a recording's path, the output folder and the options; writes what it has to and returns
            the result as plain numbers and strings, among them "reason". Raises FomrcError where a record fails. A
            function of a module, so that other processes find it.
        suffix: of the result file, behind the recording's name.
        kept_with: suffixes of what else must be there for a result to be kept.
        options: for the function; results of other options are not kept.
    """

    function: Callable[[Path, Path, Any], Mapping[str, Any]]
    suffix: str
    kept_with: tuple[str, ...]
    options: Any


@dataclass(frozen=True)
class RecordOutcome:
    """What became of one recording.

    Attributes:
        name: name of the recording's file, without its folder.
        is_done: whether there is a result.
        is_kept: whether it is that of an earlier run.
        reason: why the work ended, or why there is no result.
        content: the result; empty where there is none.
    """

    name: str
    is_done: bool
    is_kept: bool
    reason: str
    content: Mapping[str, Any] = field(default_factory=dict)


def records_in(folder: Path) -> list[Path]:
    """Return the recordings in a folder, by name: files that may hold one, and rosbag2 folders.

    Raises:
        ParameterError: no such folder, or nothing in it.
    """
    if not folder.is_dir():
        raise ParameterError("no such folder", where=str(folder), allowed="a folder of recordings")
    found = [path for path in sorted(folder.iterdir()) if _may_be_recording(path) or (path / "metadata.yaml").is_file()]
    if not found:
        raise ParameterError(
            "no recording found", where=str(folder), allowed=f"files {', '.join(_RECORD_SUFFIXES)}, or rosbag2 folders"
        )
    return found


def _may_be_recording(path: Path) -> bool:
    name = path.name.lower()
    if not name.endswith(_RECORD_SUFFIXES):
        return False
    # notes lie beside recordings, and are no recording that failed
    return not name.endswith(_NOTES_SUFFIXES) or _has_numbers(path)


def _has_numbers(path: Path) -> bool:
    """Return whether a text begins with some rows of two and more numbers, a head of words before them or not."""
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            lines = [file.readline(_LONGEST_LINE) for _ in range(_N_LINES_LOOKED_AT)]
    except OSError:
        return True  # whoever reads it says what is wrong
    rows = [re.split(r"[;\s]+|,\s*", line.strip()) for line in lines]
    n_numbers = sum(len(row) > 1 and all(number_or_none(cell) is not None for cell in row if cell) for row in rows)
    return n_numbers >= _N_ROWS_MIN


_ENTRIES: Any = None  # of the account kept with the parent: in a worker


def _begin_worker(parent: int, entries: Any) -> None:
    global _ENTRIES
    _ENTRIES = entries
    _end_with(parent)


def _work_on_one_told(number: int, recording: str, output: str, work: RecordWork) -> RecordOutcome:
    """Do the work on one recording in a process of its own, that tells its parent what it does."""
    with at_work(_ENTRIES, number):
        return work_on_one(recording, output, work)


def _end_with(parent: int) -> None:
    """End this worker once its parent is gone: killed, it cannot ask anybody to end."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCH_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def work_on(
    recordings: Sequence[Path],
    output: Path,
    work: RecordWork,
    *,
    executor: Executor | None = None,
    n_workers: int | None = None,
    progress: WorkProgress | None = None,
) -> tuple[RecordOutcome, ...]:
    """Do the work on each recording and return what became of each, in the order given.

    A failed record leaves a result file with the reason, and is tried again by the next run. A record whose result is
    there, from the same file and options, is kept.

    Args:
        recordings: files or rosbag2 folders, each with a name of its own.
        output: folder of the results, made where it is missing.
        work: what is done.
        executor: runs the records; by default one process per processor. It is not shut down.
        n_workers: number of processes of the default executor.
        progress: called with the share done and the record that is done, and every few seconds with what is at work.

    Raises:
        ParameterError: two recordings of one name, or a number of workers below 1.
    """
    paths = [Path(path).absolute() for path in recordings]
    names = [path.name for path in paths]
    for name in names:
        if names.count(name) > 1:
            raise ParameterError("two recordings of one name", where="recordings", value=name, allowed="each name once")
    if n_workers is not None and n_workers < 1:
        raise ParameterError("number of workers out of range", where="n_workers", value=n_workers, allowed="1 or more")
    output = make_directory(Path(output).absolute())
    tell = progress or (lambda _share, _text: None)
    results: dict[str, RecordOutcome] = {}
    waiting = []
    for path in paths:
        kept = _kept_result(path, output, work)
        if kept is None:
            waiting.append(path)
        else:
            results[path.name] = kept
    tell(len(results) / max(len(paths), 1), f"{len(results)} of {len(paths)} already done")
    if waiting:
        outcomes = _outcomes(
            waiting,
            output,
            work,
            executor=executor,
            n_workers=n_workers,
            tell=lambda text: tell(len(results) / len(paths), text),
        )
        with closing(outcomes):  # interrupted, workers end now, not when the generator is collected
            for outcome in outcomes:
                results[outcome.name] = outcome
                mark = "done" if outcome.is_done else "FAILED"
                tell(len(results) / len(paths), f"{outcome.name}: {mark}: {outcome.reason}")
    return tuple(results[name] for name in names)


def _outcomes(
    waiting: Sequence[Path],
    output: Path,
    work: RecordWork,
    *,
    executor: Executor | None,
    n_workers: int | None,
    tell: Callable[[str], None],
) -> Generator[RecordOutcome]:
    """Yield what becomes of each recording as soon as it is done, and tell what is at work meanwhile."""

    def failed(future: Future[RecordOutcome], error: Exception) -> RecordOutcome:
        return _failed(futures[future], output, work, f"{type(error).__name__}: {error}")

    if executor is not None:
        futures = {executor.submit(work_on_one, str(path), str(output), work): path for path in waiting}
        yield from _finished(
            futures, failed, tell, lambda n_left, still_s: f"{n_left} with the executor, none done for {still_s:.0f} s"
        )
        return
    account = WorkAccount([path.name for path in waiting])
    with _processes(n_workers, account) as pool:
        futures = {
            pool.submit(_work_on_one_told, number, str(path), str(output), work): path
            for number, path in enumerate(waiting)
        }
        yield from _finished(futures, failed, tell, lambda _n_left, _still_s: account.told())


def _finished(
    futures: Collection[Future[RecordOutcome]],
    failed: Callable[[Future[RecordOutcome], Exception], RecordOutcome],
    tell: Callable[[str], None],
    told: Callable[[int, float], str],
) -> Iterator[RecordOutcome]:
    left, done_s = set(futures), time.monotonic()
    told_s = done_s
    while left:
        done, left = wait(left, _LOOK_S, FIRST_COMPLETED)
        for future in done:
            try:
                yield future.result()
            except BrokenProcessPool:
                raise FomrcError("a worker process died; run again to go on where it stopped") from None
            except Exception as error:
                yield failed(future, error)
        now_s = time.monotonic()
        if done:
            told_s = done_s = now_s
        elif now_s - told_s >= _TELL_S:
            tell(told(len(left), now_s - done_s))
            told_s = now_s


@contextmanager
def _processes(n_workers: int | None, account: WorkAccount) -> Iterator[Executor]:
    # Workers as many as processors: threads of the linear algebra on top of them only wait for each other. What
    # the user has set stays.
    before = {name: os.environ.get(name) for name in _BLAS_THREADS}
    os.environ.update({name: "1" for name, value in before.items() if value is None})
    try:
        # Spawned: a fork would copy the threads' locks of whatever runs beside it.
        context = get_context("spawn")
        with ProcessPoolExecutor(n_workers, context, _begin_worker, (os.getpid(), account.entries)) as pool:
            yield pool
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)


def work_on_one(recording: str, output: str, work: RecordWork) -> RecordOutcome:
    """Do the work on one recording and write its result; what a worker runs. Never raises for a bad record."""
    path, folder = Path(recording), Path(output)
    try:
        content = dict(work.function(path, folder, work.options))
    except FomrcError as error:
        return _failed(path, folder, work, str(error))
    _write_result(path, folder, work, {"is_done": True, **content})
    return RecordOutcome(path.name, True, False, str(content["reason"]), content)


def _failed(path: Path, folder: Path, work: RecordWork, reason: str) -> RecordOutcome:
    _write_result(path, folder, work, {"is_done": False, "reason": reason})
    return RecordOutcome(path.name, False, False, reason)


def _write_result(path: Path, folder: Path, work: RecordWork, content: dict[str, Any]) -> None:
    content = {"recording": path.name, "fingerprint": _fingerprint(path, work.options), **content}
    write_text(json.dumps(content, indent=2) + "\n", folder / f"{path.name}{work.suffix}")


def _kept_result(path: Path, folder: Path, work: RecordWork) -> RecordOutcome | None:
    if not all((folder / f"{path.name}{suffix}").is_file() for suffix in work.kept_with):
        return None
    try:
        content = json.loads((folder / f"{path.name}{work.suffix}").read_text())
        if content["is_done"] is not True or content["fingerprint"] != _fingerprint(path, work.options):
            return None
        return RecordOutcome(path.name, True, True, str(content["reason"]), content)
    except (OSError, ValueError, KeyError, TypeError):
        return None  # cut short or not ours: done again


def _fingerprint(path: Path, options: Any) -> str:
    # Size and time of change stand for the content: hashing a day's recordings would take longer than a fit.
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    stamps = [(p.name, p.stat().st_size, p.stat().st_mtime_ns) for p in files if p.exists()]
    return hashlib.sha256(repr((stamps, options)).encode()).hexdigest()[:16]

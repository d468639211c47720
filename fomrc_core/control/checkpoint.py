"""The compensator's memory on disk: a snapshot at a bounded rate, and a journal of the ticks since.

The snapshot is written to a new file and renamed, by a thread, so that the loop waits for no disk and no
reader ever finds half of one. The journal is appended to at every tick without waiting for the disk either:
killing the process loses nothing, only a power cut may lose what the system had not yet written.
"""

from __future__ import annotations

import contextlib
import errno
import json
import math
import os
import queue
import re
import struct
import threading
import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fomrc_core.control.actuator_memory import ActuatorMemory, aging_steps, carried, carries_exactly
from fomrc_core.control.loop_account import Move
from fomrc_core.control.turning_points import TurningPoints
from fomrc_core.errors import FomrcError, StorageError
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.state import ModelState
from fomrc_core.storage.atomic import write_bytes

FORMAT = "fomrc compensator checkpoint 1"
LARGEST_CHECKPOINT_BYTES = 4_000_000
# Eight digits of the checksum, then JSON that begins with the format.
_HEADER = re.compile(rb'[0-9a-f]{8}\n\{"format": "fomrc compensator checkpoint ')
_HEADER_BYTES = 64
# Wall time [s], step [s], desired [um], second axis or NaN, voltage [V]; where the step is zero, what a sensor
# has added from then on [um] in place of the desired.
_RECORD = struct.Struct("<ddddd")
_CHECK = struct.Struct("<I")
_RECORD_BYTES = _RECORD.size + _CHECK.size
_LARGEST_JOURNAL_BYTES = 200_000_000


@dataclass(frozen=True)
class Resumed:
    """What a checkpoint gave back.

    Attributes:
        memory: the memory, aged by the time the compensator was down.
        voltage_v: last voltage published [V].
        target_um: last displacement followed [um].
        down_time_s: time between the last tick and now [s].
        is_exact: whether the model is the one the memory was kept for, or differs in a way that carries over.
        correction_um: what a sensor had added to where the stage was to go [um].
    """

    memory: ActuatorMemory
    voltage_v: float
    target_um: float
    down_time_s: float
    is_exact: bool
    correction_um: float = 0.0


class CheckpointWriter:
    """Keep a memory on disk while the loop runs.

    Args:
        path: the snapshot file; journals lie beside it.
        period_s: time between snapshots [s].

    Raises:
        StorageError: the folder cannot be written to, or the file is there and no checkpoint.
    """

    def __init__(self, path: Path, period_s: float) -> None:
        self._path, self._period_s = path, period_s
        self._sequence = max([_journal_number(journal) for journal in _journals(path)], default=0)
        self._written = self._broken = self._sequence
        self._journal, self._journal_bytes = -1, 0
        self._next_snapshot_s = 0.0
        self.failure = ""
        self.n_snapshots = 0
        if path.exists() and not is_checkpoint(path):
            raise StorageError("is no checkpoint, and is not written over", where=str(path))
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            # What a killed writer had begun and not renamed.
            for entry in path.parent.iterdir():
                if entry.name.startswith(f".{path.name}.") and entry.name.endswith(".tmp"):
                    entry.unlink(missing_ok=True)
        except OSError as error:
            raise StorageError(f"cannot be written: {error.strerror}", where=str(path.parent)) from None
        self._correction_um = 0.0  # as noted last
        self._queue: queue.Queue[tuple[int, dict[str, Any]] | None] = queue.Queue(maxsize=2)
        self._thread = threading.Thread(target=self._write_snapshots, name="checkpoint", daemon=True)
        self._thread.start()

    def note(
        self,
        compensator: Compensator,
        memory: ActuatorMemory,
        moves: Sequence[Move],
        desired_um: float,
        voltage_v: float,
        *,
        correction_um: float = 0.0,
        is_discontinuous: bool = False,
    ) -> None:
        # Many arguments: what a tick leaves, noted once a tick, without an object made for it.
        """Note a tick; takes microseconds.

        Args:
            compensator: the compensator.
            memory: its memory after the tick.
            moves: by what the tick has moved the memory, in order.
            desired_um: displacement the memory stands at [um].
            voltage_v: voltage published [V].
            correction_um: what a sensor has added to where the stage is to go [um].
            is_discontinuous: whether the memory changed otherwise than by the moves.
        """
        now = time.time()
        for move in moves:
            if self._journal >= 0:
                self._append(_RECORD.pack(now, *move))
        if correction_um != self._correction_um and self._journal >= 0:
            self._correction_um = correction_um
            self._append(_RECORD.pack(now, 0.0, correction_um, math.nan, voltage_v))
        is_due = now >= self._next_snapshot_s or now < self._next_snapshot_s - self._period_s
        if is_discontinuous or (is_due and not self._queue.full()):
            self._next_snapshot_s = now + self._period_s
            self._begin_journal()
            content = _snapshot(compensator, memory, voltage_v, desired_um, now)
            content |= {"sequence": self._sequence, "journal_bytes": self._journal_bytes}
            content |= {"correction_um": correction_um}
            self._correction_um = correction_um
            self._queue.put((self._sequence, content))
        if is_discontinuous:
            # The journal does not tell of it, so it must be on disk before the next tick; rare enough.
            self._queue.join()

    def close(self) -> None:
        """Write what is due and end the thread."""
        self._queue.put(None)
        self._thread.join(timeout=5.0)
        if self._journal >= 0:
            os.close(self._journal)
            self._journal = -1

    def _append(self, record: bytes) -> None:
        record += _CHECK.pack(zlib.crc32(record))
        try:
            n_written = os.write(self._journal, record)
            if n_written < len(record):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            self._journal_bytes += n_written
        except OSError as error:
            self._fail(error)
            # A tick is missing from here on: what has been written says so, and takes no more room for it.
            with contextlib.suppress(OSError):
                os.ftruncate(self._journal, self._journal_bytes)
                os.pwrite(self._journal, bytes(_RECORD_BYTES), max(self._journal_bytes - _RECORD_BYTES, 0))
            os.close(self._journal)
            self._journal, self._broken = -1, self._sequence

    def _begin_journal(self) -> None:
        if self._journal >= 0 and self._sequence != self._written:
            return  # the last snapshot is not on disk: its journal goes on, and a full disk gets no more files
        if self._journal >= 0:
            os.close(self._journal)
        self._sequence, self._journal_bytes = max(self._written, self._broken) + 1, 0
        try:
            self._journal = os.open(
                _journal_path(self._path, self._sequence), os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600
            )
        except OSError as error:
            self._journal = -1
            self._fail(error)

    def _write_snapshots(self) -> None:
        while (item := self._queue.get()) is not None:
            sequence, content = item
            try:
                write_bytes(_sealed(content), self._path)
                self.n_snapshots += 1
                self._written = sequence
                self.failure = ""
                for journal in _journals(self._path):
                    if _journal_number(journal) < sequence:
                        journal.unlink(missing_ok=True)
            except (OSError, StorageError) as error:
                self._fail(error)
            finally:
                self._queue.task_done()

    def _fail(self, error: Exception) -> None:
        self.failure = f"checkpoint cannot be written: {error}"


def read_checkpoint(path: Path, compensator: Compensator, period_s: float) -> Resumed | None:
    """Return the memory a checkpoint holds, aged to now; None where there is no checkpoint.

    Args:
        path: the snapshot file.
        compensator: the one to go on with; another model than the checkpoint's takes over what carries.
        period_s: the loop's period [s].

    Raises:
        StorageError: a checkpoint that is damaged or from the future, with the reason.
    """
    if not path.exists():
        return None
    content = _unsealed(path)
    where = str(path)
    try:
        old = Compensator(PiezoModel.from_mapping(content["model"], where="checkpoint.model"))
        memory = ActuatorMemory(
            ModelState.from_mapping(content["state"], "checkpoint.state"),
            TurningPoints(content["turning_points"]),
        )
        voltage_v, desired_um = float(content["voltage_v"]), float(content["desired_um"])
        wall_s, sequence = float(content["wall_time_s"]), int(content["sequence"])
        n_bytes_before = int(content.get("journal_bytes", 0))
        correction_um = float(content.get("correction_um", 0.0))
    except (KeyError, TypeError, ValueError, FomrcError) as error:
        raise StorageError(f"checkpoint does not hold a memory: {error}", where=where) from None
    expected = old.initial_state()
    if memory.state.packed.shape != expected.packed.shape:
        raise StorageError("checkpoint's state does not fit its model", where=where)
    for journal in sorted(_journals(path), key=_journal_number):
        if _journal_number(journal) >= sequence:
            n_before = n_bytes_before // _RECORD_BYTES if _journal_number(journal) == sequence else 0
            for wall_s, step_s, noted_um, cross, voltage_v in _records(journal)[n_before:]:  # noqa: B007
                if step_s == 0.0:
                    correction_um = noted_um
                    continue
                desired_um = noted_um
                memory.advance(old, desired_um, step_s, cross)
    down_time_s = time.time() - wall_s
    if down_time_s < -1.0:
        raise StorageError("checkpoint is from the future: was the clock set?", where=where, value=wall_s)
    is_same = old.model.to_mapping() == compensator.model.to_mapping()
    is_exact = is_same or carries_exactly(old, compensator)
    resumed = memory if is_same else carried(old, compensator, memory)
    for step_s in aging_steps(max(down_time_s, 0.0), period_s):
        resumed.advance(compensator, desired_um, step_s)
    return Resumed(resumed, voltage_v, desired_um, down_time_s, is_exact, correction_um)


def is_checkpoint(path: Path) -> bool:
    """Tell whether a file carries the header of a checkpoint, damaged behind it or not."""
    try:
        with path.open("rb") as file:
            return _HEADER.match(file.read(_HEADER_BYTES)) is not None
    except OSError:
        return False


def discard_checkpoint(path: Path) -> Path:
    """Move a checkpoint aside, its journals with it; return where it went.

    Raises:
        StorageError: it is no checkpoint, so that it is left as it is.
    """
    if not is_checkpoint(path):
        raise StorageError(
            "is no checkpoint, and is left as it is", where=str(path), allowed="a new file, or a checkpoint"
        )
    aside = path.with_name(path.name + ".damaged")
    with contextlib.suppress(OSError):
        os.replace(path, aside)
    for journal in _journals(path):
        journal.unlink(missing_ok=True)
    return aside


def _snapshot(
    compensator: Compensator,
    memory: ActuatorMemory,
    voltage_v: float,
    desired_um: float,
    wall_time_s: float,
) -> dict[str, Any]:
    # Copied here, by the loop; turned into text by the writer's thread.
    return {
        "format": FORMAT,
        "wall_time_s": wall_time_s,
        "voltage_v": voltage_v,
        "desired_um": desired_um,
        "model": compensator.model,
        "state": memory.state.copy(),
        "turning_points": memory.turning_points.to_list(),
    }


def _sealed(content: dict[str, Any]) -> bytes:
    plain = content | {"model": content["model"].to_mapping(), "state": content["state"].to_mapping()}
    body = json.dumps(plain, allow_nan=False).encode()
    return f"{zlib.crc32(body):08x}\n".encode() + body


def _unsealed(path: Path) -> dict[str, Any]:
    where = str(path)
    try:
        if path.stat().st_size > LARGEST_CHECKPOINT_BYTES:
            raise StorageError(
                "checkpoint too large",
                where=where,
                value=path.stat().st_size,
                allowed=f"{LARGEST_CHECKPOINT_BYTES} bytes or fewer",
            )
        seal, _, body = path.read_bytes().partition(b"\n")
    except OSError as error:
        raise StorageError(f"checkpoint cannot be read: {error.strerror}", where=where) from None
    if seal != f"{zlib.crc32(body):08x}".encode():
        raise StorageError("checkpoint is damaged: its checksum does not fit", where=where)
    try:
        content = json.loads(body)
    except (ValueError, RecursionError):
        raise StorageError("checkpoint is damaged: not JSON", where=where) from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise StorageError("checkpoint has another format", where=where, allowed=FORMAT)
    return content


def _records(journal: Path) -> list[tuple[float, float, float, float, float]]:
    where = str(journal)
    try:
        if journal.stat().st_size > _LARGEST_JOURNAL_BYTES:
            raise StorageError("journal too large", where=where, value=journal.stat().st_size)
        content = journal.read_bytes()
    except OSError as error:
        raise StorageError(f"journal cannot be read: {error.strerror}", where=where) from None
    records = []
    # A record cut short at the end is a write that was interrupted; damage before the end is damage.
    for at in range(0, len(content) - _RECORD_BYTES + 1, _RECORD_BYTES):
        record = content[at : at + _RECORD.size]
        (check,) = _CHECK.unpack(content[at + _RECORD.size : at + _RECORD_BYTES])
        values = _RECORD.unpack(record)
        if check != zlib.crc32(record) or not (np.all(np.isfinite((*values[:3], values[4]))) and values[1] >= 0.0):
            raise StorageError("journal is damaged", where=where, value=f"record {at // _RECORD_BYTES}")
        records.append(values)
    return records


def _journal_path(path: Path, sequence: int) -> Path:
    return path.with_name(f"{path.name}.journal.{sequence}")


def _journals(path: Path) -> list[Path]:
    # Compared by name: a pattern would take brackets in it for a choice of letters.
    start = f"{path.name}.journal."
    try:
        return [entry for entry in path.parent.iterdir() if entry.name.startswith(start) and entry.suffix[1:].isdigit()]
    except OSError:
        return []


def _journal_number(journal: Path) -> int:
    return int(journal.suffix[1:])

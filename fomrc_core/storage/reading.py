"""Reading as a user asks for it: units told, rows mended, and each change said."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.errors import StorageError
from fomrc_core.records.quality import examine
from fomrc_core.records.recording import Recording
from fomrc_core.storage.atomic import read_table_text
from fomrc_core.storage.bags import is_bag
from fomrc_core.storage.foreign import Understood, is_binary_table, read_binary_table, read_text_table, understand
from fomrc_core.storage.recordings import read_recording, recording_of

_N_BYTES_MAX = 2**31


@dataclass(frozen=True)
class ReadingOptions:
    """How a file is read and what is mended of it.

    Attributes:
        columns: column of each quantity from 0, None where there is none; by header where not given.
        rate_hz: sample rate of a file without time [Hz].
        topics: topic of each quantity of a rosbag2 folder.
        units: unit and factor by quantity, where the file does not tell.
        drop_nan: leave rows out that hold no number.
        sort: sort rows by time, and keep the first of those of one time.
        despike: replace spikes and dropouts by straight lines.
        resample_hz: interpolate to this even rate [Hz].
    """

    columns: dict[str, int | None] | None = None
    rate_hz: float | None = None
    topics: dict[str, str] | None = None
    units: dict[str, tuple[str, float]] | None = None
    drop_nan: bool = False
    sort: bool = False
    despike: bool = False
    resample_hz: float | None = None


@dataclass(frozen=True, eq=False)
class ReadRecord:
    """A recording, how its file was understood, and what was changed of it."""

    recording: Recording
    description: str
    changes: tuple[str, ...]


def read_as(path: str | os.PathLike[str], options: ReadingOptions) -> ReadRecord:
    """Return the recording in a file, read and mended as asked.

    Raises:
        StorageError: whatever is wrong with the file, in one line.
        RecordingError: a record that is not a usable recording.
    """
    changes: list[str] = []
    description = ""
    if options.drop_nan or options.sort:
        understood = understood_file(path, options)
        description = understood.description
        recording = recording_of(Understood(_mended(understood.fields, options, changes), ""), Path(path).name)
    else:
        recording = read_recording(
            path, columns=options.columns, rate_hz=options.rate_hz, topics=options.topics, units=options.units
        )
    if options.despike and recording.displacement_um is not None:
        examined = examine(recording)
        if examined.quality.n_masked:
            filled = examined.recording.displacement_um
            recording = replace(recording, displacement_um=filled)
            changes.append(f"despiked: {examined.quality.n_masked} readings replaced by straight lines")
    if options.resample_hz is not None:
        recording = _resampled(recording, options.resample_hz)
        changes.append(f"resampled: {recording.n_samples} rows at {options.resample_hz:g} Hz")
    return ReadRecord(recording, description, tuple(changes))


def understood_file(path: str | os.PathLike[str], options: ReadingOptions) -> Understood:
    """Return what a file of any program holds, cells without a number as nan.

    Raises:
        StorageError: a rosbag2 folder, or a file that is not understood.
    """
    if is_bag(path):
        raise StorageError("a rosbag2 needs no such help", where=os.fspath(path), allowed="a file of columns")
    if is_binary_table(Path(path)):
        table = read_binary_table(Path(path))
    else:
        table = read_text_table(read_table_text(path, n_bytes_max=_N_BYTES_MAX), os.fspath(path))
    return understand(table, options.columns, options.rate_hz, options.units)


def _mended(fields: dict[str, Array], options: ReadingOptions, changes: list[str]) -> dict[str, Array]:
    n = fields["time_s"].size
    if options.drop_nan:
        finite = np.all([np.isfinite(values) for values in fields.values()], axis=0)
        fields = {name: values[finite] for name, values in fields.items()}
        changes.append(f"dropped: {int(n - np.count_nonzero(finite))} of {n} rows that hold no number")
    if options.sort:
        time_s = fields["time_s"]
        order = np.argsort(time_s, kind="stable")
        n_back = int(np.count_nonzero(np.diff(time_s) < 0.0))
        first = np.concatenate(([True], np.diff(time_s[order]) > 0.0))
        fields = {name: values[order][first] for name, values in fields.items()}
        changes.append(f"sorted: {n_back} steps back in time, {int(np.count_nonzero(~first))} rows of a time left out")
    return fields


def _resampled(recording: Recording, rate_hz: float) -> Recording:
    if not (np.isfinite(rate_hz) and rate_hz > 0.0) or recording.duration_s * rate_hz > 1e8:
        raise StorageError("rate out of range", where="--resample", value=rate_hz, allowed="above 0, 1e8 rows at most")
    n = int(np.floor(recording.duration_s * rate_hz)) + 1
    time_s = recording.time_s[0] + np.arange(n) / rate_hz
    names = ("voltage_v", "displacement_um", "desired_um", "temperature_c", "cross_voltage_v", "cross_displacement_um")
    held = {name: getattr(recording, name) for name in names}
    moved = {name: np.interp(time_s, recording.time_s, v) for name, v in held.items() if v is not None}
    return replace(recording, time_s=time_s, **moved)

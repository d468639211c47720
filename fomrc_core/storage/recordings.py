"""Recordings and targets as text: CSV with a header, or plain columns."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.pulse import beat
from fomrc_core.errors import InputError, StorageError
from fomrc_core.records.recording import Recording
from fomrc_core.storage.atomic import read_table_text, text_blocks, write_text
from fomrc_core.storage.bags import is_bag, read_bag
from fomrc_core.storage.foreign import Understood, is_binary_table, read_binary_table, read_text_table, understand
from fomrc_core.storage.tables import TextTable, number_or_none

_N_BYTES_MAX = 2**31
_LONG_BYTES, _BLOCK_CHARACTERS = 2**24, 2**24  # of text: lines take several times as much memory as their numbers
_N_COUNTED = 50_000  # rows, of those written
_OTHER_UNIT = "column has another unit, or none"
_TOLD_WELL = ("no column time_s", "no header line")
_TELLING = ("the file does not say the unit", "two columns are", "no column is time", "row has another number of cells")

# What a column is called in a header (first) and what else it may be called there.
_HEADER_NAMES: dict[str, tuple[str, ...]] = {
    "time_s": (),
    "voltage_v": (),
    "displacement_um": (),
    "desired_um": (),
    "temperature_c": (),
    "cross_voltage_v": ("second_voltage_v", "other_voltage_v", "voltage2_v", "voltage_2_v"),
    "cross_displacement_um": (
        "second_displacement_um",
        "other_displacement_um",
        "displacement2_um",
        "displacement_2_um",
    ),
}
_FIELD_OF_HEADER = {alias: field for field, others in _HEADER_NAMES.items() for alias in (field, *others)}
# 'time' for time_s and so on: what --columns calls them.
_FIELD_OF_QUANTITY = {field.rpartition("_")[0]: field for field in _HEADER_NAMES}


def read_recording(
    path: str | os.PathLike[str],
    *,
    columns: Mapping[str, int | None] | None = None,
    rate_hz: float | None = None,
    topics: Mapping[str, str] | None = None,
    units: dict[str, tuple[str, float]] | None = None,
) -> Recording:
    """Read a recording from a CSV file with a header, a plain column file, a rosbag2 folder or a foreign table.

    Args:
        path: the file or folder; text may be packed with gzip.
        columns: for files without header: column numbers from 0 by quantity, e.g.
            ``{"time": None, "voltage": 0, "displacement": 4}``; further quantities are desired, temperature,
            cross_voltage, cross_displacement.
        rate_hz: sample rate [Hz] where the file has no time.
        topics: for rosbag2 folders: topic by quantity, where the names in the bag do not tell.
        units: unit and factor by quantity where the file does not tell, see ``foreign.told_units``.

    Raises:
        StorageError: whatever is wrong with the file, in one line.
        RecordingError: a record that is not a usable recording.
    """
    if is_bag(path):
        if columns is not None or rate_hz is not None:
            raise StorageError("a rosbag2 has no columns or rate", where=os.fspath(path), allowed="topics")
        return read_bag(path, topics=topics)
    if topics is not None:
        raise StorageError("topics are for rosbag2 folders", where=os.fspath(path), allowed="columns, rate")
    name = Path(path).name
    told = None if columns is None else dict(columns)
    if is_binary_table(Path(path)):
        return recording_of(understand(read_binary_table(Path(path)), told, rate_hz, units), name)
    long = None if units is not None else _long_fields(path, columns, rate_hz)
    if long is not None:
        return Recording(**long, name=name)
    text = read_table_text(path, n_bytes_max=_N_BYTES_MAX)
    if units is not None and columns is None:  # what the user says counts, whatever a header says
        return recording_of(understand(read_text_table(text, os.fspath(path)), None, rate_hz, units), name)
    try:
        return Recording(**_own_fields(text, os.fspath(path), columns, rate_hz), name=name)
    except StorageError as error:
        return recording_of(_foreign(text, os.fspath(path), told, rate_hz, units, error), name)


def recording_of(understood: Understood, name: str) -> Recording:
    """Return what was understood as a recording.

    Raises:
        StorageError: rows that hold no number.
        RecordingError: a time that does not increase.
    """
    for field, values in understood.fields.items():
        without = np.flatnonzero(~np.isfinite(values))
        if without.size:
            raise StorageError(
                f"{without.size} of {values.size} rows hold no number in {field}, first row {without[0] + 1}",
                where=name,
                allowed="numbers; --drop-nan leaves such rows out" if without.size < values.size else "numbers",
            )
    fields: dict[str, Any] = dict(understood.fields)
    return Recording(**fields, name=name)


def _own_fields(
    text: str, where: str, columns: Mapping[str, int | None] | None, rate_hz: float | None
) -> dict[str, Any]:
    table = TextTable.of_text(text, where)
    header = table.cells(0) if columns is None else None
    if columns is None:
        table, found = _columns_of_header(table)
    else:
        table, found = _columns_as_told(table, columns)
    _demand(found, ("voltage_v",), table.where, header)
    return {**_fields(table, found, rate_hz, header)}


def _long_fields(
    path: str | os.PathLike[str], columns: Mapping[str, int | None] | None, rate_hz: float | None
) -> dict[str, Any] | None:
    """Return what a long file of our own form holds, read block by block; None for any other, or a faulty one.

    Whatever is wrong is left to the reading of the whole, which finds the line.
    """
    where = os.fspath(path)
    try:
        if not os.path.isfile(where) or os.path.getsize(where) < _LONG_BYTES:
            return None
        found: dict[str, int] = {}
        parts: list[NDArray[np.float64]] = []
        for block in text_blocks(path, _BLOCK_CHARACTERS):
            table = TextTable.of_text(block, where)
            if not found:
                table, found = _columns_of_header(table) if columns is None else _columns_as_told(table, columns)
                _demand(found, ("voltage_v",), where, None)
                if ("time_s" in found) == (rate_hz is not None):
                    return None
            parts.append(table.numbers(list(found.values()), list(found)))
            beat("rows", parts[-1].shape[1])
    except (InputError, OSError, ValueError, EOFError):
        return None
    fields = {name: np.concatenate([part[k] for part in parts]) for k, name in enumerate(found)}
    if rate_hz is not None:
        fields["time_s"] = np.arange(fields["voltage_v"].size) / rate_hz
    if np.any(np.diff(fields["time_s"]) <= 0.0):
        return None
    for values in fields.values():
        values.flags.writeable = False  # nobody else holds it: a recording takes it as it is
    return fields


def _foreign(
    text: str,
    where: str,
    columns: dict[str, int | None] | None,
    rate_hz: float | None,
    units: dict[str, tuple[str, float]] | None,
    error: StorageError,
) -> Understood:
    """Return what a file of another program holds; raise the error of the own format where it is no such file."""
    # Many arguments: the options of reading, and what the strict reader said.
    lines = [line for line in text.split("\n") if line.strip() and not line.lstrip().startswith(("#", "%"))]
    is_own = bool(lines) and {"time_s", "voltage_v"} <= {
        cell.strip().strip('"').strip().lower() for cell in re.split(r"[,;\t ]+", lines[0])
    }
    is_own = is_own and not error.what.startswith(_OTHER_UNIT)
    has_decimal_commas = len(lines) > 1 and "," in lines[1] and "," not in lines[0]
    if (is_own and not has_decimal_commas) or (columns is not None and not has_decimal_commas and units is None):
        raise error
    try:
        return understand(read_text_table(text, where), columns, rate_hz, units)
    except StorageError as other:
        # what it lacks is told by who understood more of it
        is_telling = other.what.startswith(_TELLING) and not error.what.startswith(_TOLD_WELL)
        raise other if is_telling else error from None


def read_target(path: str | os.PathLike[str]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Read times [s] and desired displacements [um] from a CSV file with columns time_s and desired_um.

    Raises:
        StorageError: whatever is wrong with the file, in one line.
    """
    table = TextTable.of_text(read_table_text(path, n_bytes_max=_N_BYTES_MAX), os.fspath(path))
    header = table.cells(0)
    table, found = _columns_of_header(table)
    _demand(found, ("time_s", "desired_um"), table.where, header)
    values = _fields(table, {name: found[name] for name in ("time_s", "desired_um")}, None, header)
    if values["time_s"].size < 2:
        raise StorageError("too few rows", where=table.where, value=1, allowed="2 or more")
    return values["time_s"], values["desired_um"]


def write_recording(recording: Recording, path: str | os.PathLike[str]) -> None:
    """Write a recording as CSV that reads back bit for bit; gzip where the name ends in ``.gz``.

    Raises:
        StorageError: the file cannot be written.
    """
    held = {name: getattr(recording, name) for name in _HEADER_NAMES}
    write_columns({name: values for name, values in held.items() if values is not None}, path)


def write_columns(columns: Mapping[str, NDArray[np.float64]], path: str | os.PathLike[str]) -> None:
    """Write named columns of equal length as CSV, each number with as many digits as it takes to keep it.

    Args:
        columns: values by header name, each of shape (n_rows,).
        path: file to write; gzip where its name ends in ``.gz``.

    Raises:
        StorageError: the file cannot be written.
    """
    cells = [map(repr, np.asarray(values, dtype=np.float64).tolist()) for values in columns.values()]
    rows = _counted(map(",".join, zip(*cells, strict=True)))
    write_text("\n".join([",".join(columns), *rows, ""]), path)


def _counted(rows: Iterable[str]) -> Iterator[str]:
    for number, row in enumerate(rows, start=1):
        if number % _N_COUNTED == 0:
            beat("rows", _N_COUNTED)
        yield row


def _columns_of_header(table: TextTable) -> tuple[TextTable, dict[str, int]]:
    header = table.cells(0)
    if all(number_or_none(cell) is not None for cell in header):
        raise StorageError(
            "no header line naming the columns",
            where=f"{table.where}, line {table.line_numbers[0]}",
            value=table.lines[0].strip(),
            allowed="time_s,voltage_v,displacement_um,... or --columns to say which is which",
        )
    found: dict[str, int] = {}
    for column, cell in enumerate(header):
        field = _FIELD_OF_HEADER.get(cell.lower())
        if field in found:
            raise StorageError(f"two columns are {field}", where=table.where, value=",".join(header))
        if field is not None:
            found[field] = column
    _refuse_other_units(header, found, table.where)
    # Told here because a row count of cells is compared with the first row of numbers, not with the header.
    if len(table.lines) > 1 and len(table.cells(1)) != len(header):
        raise StorageError(
            "row has another number of cells than the header",
            where=f"{table.where}, line {table.line_numbers[1]}",
            value=len(table.cells(1)),
            allowed=f"{len(header)} cells",
        )
    return table.without_first(), found


def _refuse_other_units(header: Sequence[str], found: Mapping[str, int], where: str) -> None:
    # A column displacement_nm would pass unseen, and the record for one without displacement.
    for cell in header:
        quantity, _, unit = cell.lower().rpartition("_")
        field = _FIELD_OF_QUANTITY.get(quantity or unit)
        if field is not None and field not in found:
            raise StorageError(_OTHER_UNIT, where=where, value=cell, allowed=field)


def _columns_as_told(table: TextTable, columns: Mapping[str, int | None]) -> tuple[TextTable, dict[str, int]]:
    # One line of names above the numbers does no harm.
    if not any(number_or_none(cell) is not None for cell in table.cells(0)):
        table = table.without_first()
    n_columns = len(table.cells(0)) if table.lines else 0
    found: dict[str, int] = {}
    for quantity, column in columns.items():
        field = _FIELD_OF_QUANTITY.get(quantity, quantity)
        if field not in _HEADER_NAMES:
            allowed = ", ".join(_FIELD_OF_QUANTITY)
            raise StorageError("unknown quantity in columns", where=table.where, value=quantity, allowed=allowed)
        if column is None:
            continue
        if isinstance(column, bool) or not isinstance(column, int) or not 0 <= column < n_columns:
            allowed = f"0..{n_columns - 1}"
            raise StorageError(f"no such column for {quantity}", where=table.where, value=column, allowed=allowed)
        found[field] = column
    return table, found


def _demand(found: Mapping[str, int], needed: Sequence[str], where: str, header: Sequence[str] | None) -> None:
    for name in needed:
        if name not in found:
            if header is not None:
                raise StorageError(f"no column {name}", where=where, value=",".join(header), allowed=", ".join(needed))
            what = f"columns does not say which is the {name.rpartition('_')[0]}"
            raise StorageError(what, where=where, value=sorted(found) or None, allowed=", ".join(needed))


def _fields(
    table: TextTable, found: Mapping[str, int], rate_hz: float | None, header: Sequence[str] | None
) -> dict[str, NDArray[np.float64]]:
    if rate_hz is not None and not (np.isfinite(rate_hz) and rate_hz > 0.0):
        raise StorageError("rate must be positive", where=table.where, value=rate_hz, allowed="above 0 Hz")
    if "time_s" in found and rate_hz is not None:
        raise StorageError(
            "rate given though the file has time_s",
            where=table.where,
            value=rate_hz,
            allowed="a rate, or a time column, not both",
        )
    if "time_s" not in found and rate_hz is None:
        raise StorageError(
            "no column time_s and no rate",
            where=table.where,
            value=",".join(header) if header is not None else sorted(found) or None,
            allowed="a time column, or a rate in Hz (--rate)",
        )
    names = list(found)
    fields = dict(zip(names, table.numbers([found[name] for name in names], names), strict=True))
    if rate_hz is not None:
        fields["time_s"] = np.arange(len(table.lines)) / rate_hz
    steps_s = np.diff(fields["time_s"])
    if np.any(steps_s <= 0.0):
        row = int(np.argmax(steps_s <= 0.0)) + 1
        raise StorageError(
            "time does not increase",
            where=f"{table.where}, line {table.line_numbers[row]}, column time_s",
            value=float(fields["time_s"][row]),
            allowed=f"more than {float(fields['time_s'][row - 1])!r}",
        )
    return fields

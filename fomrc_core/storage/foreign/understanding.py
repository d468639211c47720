"""A file of another program as time, voltage and displacement, and how it was understood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.errors import StorageError
from fomrc_core.storage.foreign.headers import REQUIRED, meanings_of
from fomrc_core.storage.foreign.raw_columns import RawColumns


@dataclass(frozen=True, eq=False)
class Understood:
    """What a file holds.

    Attributes:
        fields: values by name in a ``Recording``, shape (n_rows,) each; nan where a cell held no number.
        description: how it was understood, in a line.
    """

    fields: dict[str, Array]
    description: str


def understand(
    table: RawColumns,
    columns: dict[str, int | None] | None = None,
    rate_hz: float | None = None,
    units: dict[str, tuple[str, float]] | None = None,
) -> Understood:
    """Return the fields of a recording.

    Args:
        table: columns with their headers.
        columns: column of each quantity from 0, where the user says so.
        rate_hz: sample rate [Hz] where the file has no time.
        units: unit and factor of each quantity, where the user says so.

    Raises:
        StorageError: no voltage, no time and no rate, both of them, or a unit that is not told.
    """
    meanings = meanings_of(table, columns, units or {})
    found = {meaning.quantity for meaning in meanings.values()}
    for quantity in REQUIRED:
        if quantity not in found and not (quantity == "time" and rate_hz is not None):
            raise StorageError(
                f"no column is {quantity}",
                where=table.where,
                value=table.header,
                allowed="--columns time=...,voltage=...,displacement=... (numbers from 0, with --units)"
                + (", or --rate" if quantity == "time" else ""),
            )
    if "time" in found and rate_hz is not None:
        raise StorageError("rate given though the file has time", where=table.where, value=rate_hz)
    fields = {meaning.field: meaning.factor * table.values[k] for k, meaning in meanings.items()}
    if rate_hz is not None:
        fields["time_s"] = np.arange(table.values.shape[1]) / rate_hz
    told = ", ".join(f"{m.header or k!r} is {m.quantity} in {m.unit}" for k, m in meanings.items())
    return Understood(fields, f"{table.how}; {told}")

"""Columns of numbers with the words above them, before it is known what they are."""

from __future__ import annotations

from dataclasses import dataclass

from fomrc_core.compute.arrays import Array


@dataclass(frozen=True, eq=False)
class RawColumns:
    """A table as a file holds it.

    Attributes:
        where: the file, for messages.
        names: header of each column, empty where it has none.
        units: unit of each column where the file says it apart from the name, else empty.
        values: numbers of each, shape (n_columns, n_rows); nan where a cell holds none.
        how: how the table was found, in words.
    """

    where: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    how: str

    @property
    def header(self) -> str:
        """The header in one line, for messages."""
        return ", ".join(
            f"{name or k}{f' [{unit}]' if unit else ''}"
            for k, (name, unit) in enumerate(zip(self.names, self.units, strict=True))
        )

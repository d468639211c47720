"""Columns of numbers in text: parsed fast, and the faulty line looked for only once parsing has failed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import StorageError

_COMMENT_MARKS = ("#", "%")


@dataclass(frozen=True)
class TextTable:
    """Lines of a text file that hold cells, without blank and comment lines.

    Args:
        where: the file, for messages.
        lines: the lines that hold cells.
        line_numbers: number of each in the file, from 1.
        separator: what stands between cells; None for any white space.
    """

    where: str
    lines: tuple[str, ...]
    line_numbers: tuple[int, ...]
    separator: str | None

    @classmethod
    def of_text(cls, text: str, where: str) -> TextTable:
        """Find the lines with cells and what separates their cells.

        Raises:
            StorageError: nothing in the file.
        """
        # Not str.splitlines: it also splits at form feeds and other marks that end no row of a table.
        lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
        numbered = [
            (number, line)
            for number, line in enumerate(lines, start=1)
            if line.strip() and not line.lstrip().startswith(_COMMENT_MARKS)
        ]
        if not numbered:
            raise StorageError("empty file", where=where, allowed="a header line and rows of numbers")
        first = numbered[0][1]
        # A tab is white space like any other: columns lined up with several of them are read as well.
        separator = next((mark for mark in (",", ";") if mark in first), None)
        return cls(where, tuple(line for _, line in numbered), tuple(n for n, _ in numbered), separator)

    def cells(self, row: int) -> list[str]:
        """Return the cells of a line, without quotes and surrounding space."""
        return [cell.strip().strip('"').strip() for cell in self.lines[row].split(self.separator)]

    def without_first(self) -> TextTable:
        """Return the table without its first line."""
        return TextTable(self.where, self.lines[1:], self.line_numbers[1:], self.separator)

    def numbers(self, columns: Sequence[int], names: Sequence[str]) -> NDArray[np.float64]:
        """Parse some columns to numbers, all finite.

        Args:
            columns: which columns, from 0.
            names: what to call each in messages.

        Returns:
            shape (n_columns, n_rows).

        Raises:
            StorageError: no rows, rows of unequal length, cells that are no finite number; with the line.
        """
        if not self.lines:
            raise StorageError("no rows below the header", where=self.where, allowed="2 or more rows")
        self._refuse_ragged_rows()
        try:
            values: NDArray[np.float64] = np.loadtxt(
                self.lines, delimiter=self.separator, usecols=columns, ndmin=2, comments=None, quotechar='"'
            ).T
        except ValueError:
            raise self._first_fault(columns, names) from None
        if not np.all(np.isfinite(values)):
            raise self._first_fault(columns, names)
        return values

    def _refuse_ragged_rows(self) -> None:
        if self.separator is None:
            widths = [len(line.split()) for line in self.lines]
        else:
            widths = [line.count(self.separator) + 1 for line in self.lines]
        if min(widths) != max(widths):
            row = next(k for k, width in enumerate(widths) if width != widths[0])
            raise StorageError(
                "row has another number of cells than the first row",
                where=f"{self.where}, line {self.line_numbers[row]}",
                value=widths[row],
                allowed=f"{widths[0]} cells",
            )

    def _first_fault(self, columns: Sequence[int], names: Sequence[str]) -> StorageError:
        for row in range(len(self.lines)):
            cells = self.cells(row)
            for column, name in zip(columns, names, strict=True):
                value = number_or_none(cells[column])
                if value is None or not math.isfinite(value):
                    return StorageError(
                        "not a number" if value is None else "not finite",
                        where=f"{self.where}, line {self.line_numbers[row]}, column {name}",
                        value=cells[column],
                        allowed="finite numbers such as -1.5 or 2e-3",
                    )
        return StorageError("cannot be read as numbers", where=self.where, allowed="plain decimal numbers")


def number_or_none(cell: str) -> float | None:
    """Return the number a cell holds, None where it holds none."""
    try:
        # Python reads 1_000 as a number; no other program writing tables means that.
        return None if "_" in cell else float(cell)
    except ValueError:
        return None

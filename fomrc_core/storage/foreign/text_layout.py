"""Where the numbers are in a text file: after which preamble, between which separators, with which decimal mark."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.pulse import beat
from fomrc_core.errors import StorageError
from fomrc_core.storage.foreign.headers import quantities_of
from fomrc_core.storage.foreign.raw_columns import RawColumns
from fomrc_core.storage.tables import number_or_none

# Separator and decimal mark, the less ambiguous first: 1,5 between semicolons is a number, between commas two.
_FORMS = ((";", ","), (";", "."), ("\t", ","), ("\t", "."), (",", "."), (None, "."), (None, ","))
_N_LOOKED_AT = 400
_N_ROWS_MIN = 2
_N_COUNTED = 50_000  # rows told at a time
_MISSING = ("", "nan", "na", "n/a", "null", "none", "-", "inf", "-inf", "+inf", "#n/a", "--")
_EMPTY = ("", "comment", "comments", "remark", "notes")
_COMMENT_MARKS = ("#", "%")
_NAMES = {";": "semicolons", "\t": "tabs", ",": "commas", None: "white space"}


@dataclass(frozen=True)
class _Layout:
    separator: str | None
    decimal: str
    first: int
    n_columns: int
    n_rows: int


def read_text_table(text: str, where: str) -> RawColumns:
    """Return the table of a text file.

    Raises:
        StorageError: no rows of numbers, or rows of unequal length among them.
    """
    lines = text.replace("\r\n", "\n").replace("\r", "\n").lstrip("\ufeff").split("\n")
    layouts = [found for form in _FORMS if (found := _layout(lines, *form)) is not None]
    if not layouts:
        shown = next((line for line in lines if line.strip()), "")
        raise StorageError(
            "no table of numbers", where=where, value=shown[:60], allowed="rows of two or more numbers below a header"
        )
    best = max(layouts, key=lambda found: (found.n_rows, found.n_columns))
    names, units = _header(lines, best)
    values = _values(lines, best, where)
    mark = ", decimal commas" if best.decimal == "," else ""
    preamble = f"{best.first} lines above" if best.first > 1 else "a header" if best.first else "no header"
    return RawColumns(where, names, units, values, f"text, {_NAMES[best.separator]}{mark}, {preamble}")


def _cells(line: str, separator: str | None) -> list[str]:
    return [cell.strip().strip('"').strip("'").strip() for cell in line.split(separator)]


def _number(cell: str, decimal: str) -> float | None:
    if decimal == ",":
        if "." in cell:
            return None
        cell = cell.replace(",", ".")
    return number_or_none(cell)


def _layout(lines: list[str], separator: str | None, decimal: str) -> _Layout | None:
    """Return where rows of numbers begin in this form; None where there are none."""
    best: _Layout | None = None
    start, width, rows = 0, 0, 0
    for at, line in enumerate(lines[:_N_LOOKED_AT]):
        if not line.strip():
            continue
        cells = _cells(line, separator)
        n_numbers = sum(_number(cell, decimal) is not None for cell in cells)
        n_words = sum(_number(cell, decimal) is None and cell.lower() not in _MISSING for cell in cells)
        is_row = n_numbers >= 2 and n_words <= len(cells) - 2
        if not is_row:
            rows = 0
            continue
        if rows == 0 or len(cells) != width:
            start, width, rows = at, len(cells), 0
        rows += 1
        if rows >= _N_ROWS_MIN and (best is None or rows > best.n_rows):
            best = _Layout(separator, decimal, start, width, rows)
    return best


def _header(lines: list[str], layout: _Layout) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return names and units from the lines above the numbers, empty where there are none."""
    nothing = ("",) * layout.n_columns
    above = []
    for line in reversed(lines[: layout.first]):
        marked = line.lstrip().lstrip("#%").strip()
        if not marked:
            continue
        cells = _cells(marked, layout.separator)
        # many programs end each row of numbers with a separator, but not the header
        cells += [""] * (len(cells) == layout.n_columns - 1)
        # and some name a last column of comments, which has none
        cells = (
            cells[: layout.n_columns] if len(cells) == layout.n_columns + 1 and cells[-1].lower() in _EMPTY else cells
        )
        if len(cells) != layout.n_columns:
            break
        above.append(tuple(cells))
        if len(above) == 2:
            break
    if not above:
        return nothing, nothing
    last = above[0]
    is_units = all(cell == "" or quantities_of(cell.strip("()[]")) for cell in last) and any(last)
    if is_units and len(above) == 2 and not any(number_or_none(cell) is not None for cell in above[1]):
        return above[1], tuple(cell.strip("()[]") for cell in last)
    return last, nothing


def _values(lines: list[str], layout: _Layout, where: str) -> Array:
    rows = []
    for number, line in enumerate(lines[layout.first :], start=layout.first + 1):
        if not line.strip() or line.lstrip().startswith(_COMMENT_MARKS):
            continue
        cells = _cells(line, layout.separator)
        if len(cells) != layout.n_columns:
            raise StorageError(
                "row has another number of cells than the first row",
                where=f"{where}, line {number}",
                value=len(cells),
                allowed=f"{layout.n_columns} cells",
            )
        rows.append([_value(cell, layout.decimal) for cell in cells])
        if len(rows) % _N_COUNTED == 0:
            beat("rows", _N_COUNTED)
    return np.ascontiguousarray(np.array(rows, dtype=np.float64).T)


def _value(cell: str, decimal: str) -> float:
    found = _number(cell, decimal)
    return float("nan") if found is None or found in (float("inf"), float("-inf")) else found

"""Numbers and tables as C writes them: every one reads back as the very number it was."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fomrc_core.export.options import Precision

_WIDTH = 112


def c_number(value: float, precision: Precision) -> str:
    """Return a finite number as a C constant; an infinite one as the largest finite number."""
    if precision is Precision.FLOAT:
        largest = float(np.finfo(np.float32).max)
        return f"{_decimal(str(np.float32(min(max(value, -largest), largest))))}f"
    largest = float(np.finfo(np.float64).max)
    return _decimal(repr(min(max(float(value), -largest), largest)))


def rounded_to(value: float, precision: Precision) -> float:
    """Return what is left of a number in this precision."""
    return float(np.float32(value)) if precision is Precision.FLOAT else float(value)


def _decimal(text: str) -> str:
    if "." in text or "e" in text:
        return text
    return text + ".0"


def c_list(values: Sequence[float], precision: Precision) -> str:
    """Return numbers in braces, on as many lines as they need."""
    if not all(math.isfinite(value) or math.isinf(value) for value in values):
        raise ValueError("a table of an export holds what is not a number")
    lines, line = [], ""
    for value in values:
        number = c_number(value, precision)
        if line and len(line) + len(number) + 2 > _WIDTH:
            lines.append(line + ",")
            line = number
        else:
            line = f"{line}, {number}" if line else number
    lines.append(line)
    if len(lines) == 1:
        return "{" + lines[0] + "}"
    return "{\n" + "\n".join(f"    {text}" for text in lines) + "\n}"


def c_table(type_name: str, name: str, size: str, values: Sequence[float], precision: Precision) -> str:
    """Return the definition of a constant table."""
    return f"static const {type_name} {name}[{size}] = {c_list(values, precision)};"

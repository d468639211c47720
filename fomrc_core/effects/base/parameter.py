"""One parameter of a cause: its name, unit and bounds, and how a fit moves it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fomrc_core.errors import ParameterError


@dataclass(frozen=True)
class Parameter:
    """One parameter of a cause.

    Attributes:
        name: field name, carrying its unit.
        unit: unit as text.
        lower: smallest value allowed.
        upper: largest value allowed.
        is_log: whether a fit moves its logarithm (positive scales).
        is_list: whether it is a list of values, each within the bounds.
        description: what it is.
        difference: share of the value by which a fit moves it to see what it does; 0 for the usual one.
    """

    name: str
    unit: str
    lower: float
    upper: float
    is_log: bool = False
    is_list: bool = False
    description: str = ""
    difference: float = 0.0

    def checked(self, value: Any, cause: str) -> float | tuple[float, ...]:
        """Return a value as a float, or as a tuple of them for a list; ParameterError names what is wrong.

        Args:
            value: what was given.
            cause: name of the cause, for the message.
        """
        where = f"{cause}.{self.name}"
        if not self.is_list:
            return self._checked_number(value, where)
        if not isinstance(value, (list, tuple, np.ndarray)):
            raise ParameterError("not a list", where=where, value=value, allowed="a list of numbers")
        is_of_floats = isinstance(value, tuple) and set(map(type, value)) == {float}
        # a fit sets lists anew at every step: those that are right are known at once
        if is_of_floats and all(map(math.isfinite, value)) and self.lower <= min(value) and max(value) <= self.upper:
            return tuple(value)
        return tuple(self._checked_number(entry, where) for entry in value)

    def _checked_number(self, value: Any, where: str) -> float:
        allowed = f"{self.lower:g} to {self.upper:g} {self.unit}"
        if isinstance(value, (bool, str)) or not isinstance(value, (int, float, np.floating, np.integer)):
            raise ParameterError("not a number", where=where, value=value, allowed=allowed)
        if not (math.isfinite(value) and self.lower <= value <= self.upper):
            raise ParameterError("out of range", where=where, value=float(value), allowed=allowed)
        return float(value)

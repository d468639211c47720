"""Arguments checked where they come in: one line names the argument, its value and what is allowed."""

from __future__ import annotations

import math

from fomrc_core.errors import ParameterError


def positive(
    name: str,
    value: float,
    unit: str,
    *,
    at_least: float = 0.0,
    below: float = math.inf,
    at_most: float = math.inf,
) -> float:
    """Return a finite number above zero that lies within the limits given.

    Args:
        name: argument, for the message.
        value: what was given.
        unit: its unit, for the message.
        at_least: smallest value allowed, where above zero.
        below: value must be smaller than this.
        at_most: value must not be larger than this.

    Raises:
        ParameterError: it is not.
    """
    number = _number(name, value, unit)
    if not (0.0 < number < below and at_least <= number <= at_most):
        low = f"{at_least:g} or more" if at_least > 0.0 else "above 0"
        high = f", below {below:g}" if below < math.inf else f", at most {at_most:g}" if at_most < math.inf else ""
        raise ParameterError("out of range", where=name, value=value, allowed=f"{low}{high} {unit}".strip())
    return number


def not_negative(name: str, value: float, unit: str) -> float:
    """Return a finite number of zero or more; raises ParameterError where it is not."""
    number = _number(name, value, unit)
    if number < 0.0:
        raise ParameterError("out of range", where=name, value=value, allowed=f"0 or more {unit}".strip())
    return number


def count(name: str, value: int) -> int:
    """Return a whole number of one or more; raises ParameterError where it is not."""
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise ParameterError("is no count", where=name, value=value, allowed="whole numbers from 1")
    return value


def _number(name: str, value: float, unit: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if isinstance(value, bool) or not math.isfinite(number):
        raise ParameterError("is no finite number", where=name, value=value, allowed=f"numbers {unit}".strip())
    return number

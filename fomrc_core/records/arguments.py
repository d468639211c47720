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


def whole(name: str, value: int, *, at_least: int = 1, at_most: int | None = None) -> int:
    """Return a whole number within the limits given; raises ParameterError where it is not."""
    is_whole = isinstance(value, int) and not isinstance(value, bool)
    if not is_whole or value < at_least or (at_most is not None and value > at_most):
        high = "on" if at_most is None else f"to {at_most}"
        raise ParameterError(
            "is not a whole number in the range",
            where=name,
            value=value,
            allowed=f"whole, from {at_least} {high}",
        )
    return value


def _number(name: str, value: float, unit: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if isinstance(value, bool) or not math.isfinite(number):
        raise ParameterError("is not a finite number", where=name, value=value, allowed=f"numbers {unit}".strip())
    return number

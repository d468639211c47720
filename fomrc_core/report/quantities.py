"""Numbers with units as people write them: 20 µs, 41.24 ± 0.12 Hz, 2.3·10⁻⁵ 1/V²."""

from __future__ import annotations

import math
import re
import sys

_PREFIXES: dict[str, tuple[tuple[float, str], ...]] = {
    "s": ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")),
    "um": ((1e3, "mm"), (1.0, "µm"), (1e-3, "nm"), (1e-6, "pm")),
    "V": ((1e3, "kV"), (1.0, "V"), (1e-3, "mV"), (1e-6, "µV")),
    "Hz": ((1e6, "MHz"), (1e3, "kHz"), (1.0, "Hz"), (1e-3, "mHz")),
    "rad": ((math.pi / 180.0, "°"),),
}
_LEAST = 0.5  # 0.5 µm reads better than 500 nm, 0.4 µm does not
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_N_DECIMALS_MAX = 5
_N_WHOLE = 3  # digits before the point
_UNDETERMINED = "undetermined"


def quantity(value: float, unit: str, error: float | None = None, n_digits: int = 4) -> str:
    """Return a value with its unit and, where it is known, its standard error, to the digits the error leaves.

    An error larger than the value leaves nothing of it: it is called undetermined, with both beside.

    Args:
        value: in the unit of the files.
        unit: that unit as the files write it: ``um``, ``V/s``, ``1`` for none.
        error: standard error in the same unit; None, 0 or not finite where there is none.
        n_digits: digits of a value without error.
    """
    factor, name = _readable(max(abs(value), error or 0.0) if _has_error(error) else abs(value), unit)
    shown = value / factor
    if not _has_error(error) or error is None:
        return _with_unit(number(shown, n_digits), name)
    text = _with_unit(_value_and_error(shown, error / factor), name)
    return f"{_UNDETERMINED} ({text})" if error > abs(value) else text


def number(value: float, n_digits: int = 4) -> str:
    """Return a number in short, powers of ten raised where there are any."""
    if not math.isfinite(value):
        return "none"
    text = f"{value:.{n_digits}g}"
    if "e" not in text:
        return text.replace("-", "−")
    mantissa, power = text.split("e")
    return f"{mantissa.replace('-', '−')}·10{str(int(power)).translate(_RAISED)}"


def unit_name(unit: str) -> str:
    """Return a unit as people write it; nothing for a plain number."""
    if unit == "1":
        return ""
    text = re.sub(r"\bum\b", "µm", unit).replace("degC", "°C")
    return re.sub(r"\^(-?\d+)", lambda match: match[1].translate(_RAISED), text)


def length(value_um: float) -> str:
    """Return a length to three digits; ``none`` where it is no number."""
    return quantity(value_um, "um", n_digits=3) if math.isfinite(value_um) else "none"


def _has_error(error: float | None) -> bool:
    return error is not None and math.isfinite(error) and error > 0.0


def _readable(size: float, unit: str) -> tuple[float, str]:
    """Return what to divide by and the name of the unit in which a size reads well."""
    prefixes = _PREFIXES.get(unit)
    if prefixes is None:
        return 1.0, unit_name(unit)
    if size == 0.0:
        return next(((f, n) for f, n in prefixes if f == 1.0), prefixes[0])
    enough = (entry for entry in prefixes if size >= (entry[0] if entry[0] > 1.0 else _LEAST * entry[0]))
    return next(enough, prefixes[-1])


def _value_and_error(value: float, error: float) -> str:
    if _n_decimals(error) <= _N_DECIMALS_MAX:
        return _in_decimals(value, error)
    power = math.floor(math.log10(max(abs(value), error)))
    if 0 <= power < _N_WHOLE:  # a value of a few digits known very well reads better as it is
        power = 0
    # no float tells more digits than these
    scaled = _in_decimals(value / 10.0**power, max(error / 10.0**power, sys.float_info.epsilon))
    return scaled if power == 0 else f"({scaled})·10{str(power).translate(_RAISED)}"


def _n_decimals(error: float) -> int:
    return max(0, 1 - math.floor(math.log10(error)))


def _in_decimals(value: float, error: float) -> str:
    n_decimals = _n_decimals(error)
    return f"{value:.{n_decimals}f} ± {error:.{n_decimals}f}".replace("-", "−")


def _with_unit(text: str, name: str) -> str:
    if not name:
        return text
    return f"{text}{name}" if name == "°" else f"{text} {name}"

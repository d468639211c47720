"""What a column is and in which unit, by its header: ``Time (ms)``, ``V_out [mV]``, ``pos/nm``, ``displacement_um``."""

from __future__ import annotations

import re
from dataclasses import dataclass

from fomrc_core.errors import ParameterError, StorageError
from fomrc_core.storage.foreign.raw_columns import RawColumns
from fomrc_core.storage.told_columns import named_once

# Factor of each unit to that of the package: s, V, um, degC.
_TIME = {"s": 1.0, "sec": 1.0, "secs": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6}
_TIME |= {"usec": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "millisecond": 1e-3, "milliseconds": 1e-3}
_VOLTAGE = {"v": 1.0, "volt": 1.0, "volts": 1.0, "mv": 1e-3, "kv": 1e3, "uv": 1e-6}
_LENGTH = {"um": 1.0, "micron": 1.0, "microns": 1.0, "micrometer": 1.0, "nm": 1e-3, "mm": 1e3, "m": 1e6, "pm": 1e-6}
_LENGTH |= {"meter": 1e6, "metre": 1e6, "nanometer": 1e-3, "millimeter": 1e3, "micrometre": 1.0, "nanometre": 1e-3}
_TEMPERATURE = {"c": 1.0, "degc": 1.0, "°c": 1.0, "celsius": 1.0}
_UNITS = {"time": _TIME, "voltage": _VOLTAGE, "displacement": _LENGTH, "desired": _LENGTH, "temperature": _TEMPERATURE}
_FIELDS = {
    "time": "time_s",
    "voltage": "voltage_v",
    "displacement": "displacement_um",
    "desired": "desired_um",
    "temperature": "temperature_c",
}
_WORDS = {
    "time": {"time", "t", "zeit", "timestamp", "elapsed", "temps", "tempo", "x-axis", "second", "seconds", "times"},
    "desired": {"desired", "target", "reference", "setpoint", "ref", "soll"},
    "temperature": {"temperature", "temp", "temperatur"},
    "voltage": {"voltage", "v", "u", "volt", "volts", "drive", "vout", "vin", "command", "cmd", "spannung", "tension"},
    "displacement": {
        *("displacement", "position", "pos", "disp", "x", "d", "z", "weg", "auslenkung", "stroke", "sensor", "laser"),
        *("extension", "elongation", "deplacement", "interferometer", "y"),
    },
}
_BRACKETED = re.compile(r"^(.*?)\s*[\[(]\s*([^\])]*)\s*[\])]\s*$")
_DIVIDED = re.compile(r"^(.*?)\s*(?:/|,|\bin\b)\s*([^/,]+)$")
_FACTOR = re.compile(r"^\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*\*?\s*(\S*)\s*$")
_OTHER_AXIS = ("cross_", "second_", "other_")
_LABVIEW_TIME = "x_value"
REQUIRED = ("time", "voltage")


@dataclass(frozen=True)
class Meaning:
    """What one column is.

    Attributes:
        quantity: "time", "voltage", "displacement", "desired" or "temperature".
        unit: as the file or the user says it.
        factor: to s, V, um or degC.
        header: of the column.
    """

    quantity: str
    unit: str
    factor: float
    header: str

    @property
    def field(self) -> str:
        """Name of the quantity in a ``Recording``."""
        return _FIELDS[self.quantity]


def told_units(text: str, where: str = "--units") -> dict[str, tuple[str, float]]:
    """Return unit and factor by quantity from e.g. ``time=ms,voltage=15V,displacement=nm``.

    A number before the unit is what one of the column's counts is: an amplifier's monitor, a sensor's volt.

    Raises:
        ParameterError: an unknown quantity or unit.
    """
    found: dict[str, tuple[str, float]] = {}
    for quantity, unit in named_once(text, where).items():
        if quantity not in _UNITS:
            raise ParameterError("unknown quantity", where=where, value=quantity, allowed=", ".join(_UNITS))
        number = _FACTOR.match(unit)
        count, name = (float(number[1]), number[2]) if number else (1.0, unit)
        factor = _factor(quantity, name)
        if factor is None or count == 0.0:
            allowed = ", ".join(_UNITS[quantity])
            raise ParameterError(f"unknown unit of {quantity}", where=where, value=unit, allowed=allowed)
        found[quantity] = (unit, count * factor)
    return found


def meanings_of(
    table: RawColumns, columns: dict[str, int | None] | None, units: dict[str, tuple[str, float]]
) -> dict[int, Meaning]:
    """Return what each column is that is anything.

    Args:
        table: columns with their headers.
        columns: column of each quantity, where the user says so.
        units: unit of each quantity, where the user says so.

    Raises:
        StorageError: two columns for one quantity, or a unit that is not told.
    """
    found: dict[int, Meaning] = {}
    unknown: list[str] = []
    for k, (name, apart) in enumerate(zip(table.names, table.units, strict=True)):
        quantity, unit = _told(name, apart)
        if columns is not None:
            quantity = next((q for q, column in columns.items() if column == k), None)
        if quantity is None or (columns is None and quantity in {m.quantity for m in found.values()}):
            if quantity in REQUIRED or quantity == "displacement":
                other = next(m.header for m in found.values() if m.quantity == quantity)
                raise StorageError(
                    f"two columns are {quantity}",
                    where=table.where,
                    value=f"{other!r} and {name!r} of {table.header}",
                    allowed="--columns time=...,voltage=...,displacement=... (numbers from 0)",
                )
            continue
        if quantity in units:
            unit, factor = units[quantity]
        else:
            known = _factor(quantity, unit)
            if known is None:
                unknown.append(quantity)
                continue
            factor = known
        found[k] = Meaning(quantity, unit, factor, name)
    if unknown:
        likely = ",".join(f"{quantity}={_FIELDS[quantity].rpartition('_')[2]}" for quantity in unknown)
        raise StorageError(
            f"the file does not say the unit of {' and '.join(unknown)}",
            where=table.where,
            value=table.header,
            allowed=f"e.g. --units {likely}",
        )
    return found


def _told(header: str, apart: str) -> tuple[str | None, str]:
    """Return the quantity a header tells, None where it tells none, and its unit, empty where it tells none."""
    name, unit = header.strip(), apart.strip()
    if name.lower().startswith(_OTHER_AXIS):
        return None, unit
    if not unit:
        for form in (_BRACKETED, _DIVIDED):
            match = form.match(name)
            if match and quantities_of(match[2]):
                name, unit = match[1], match[2]
                break
        else:
            front, _, last = name.rpartition("_")
            if front and quantities_of(last):
                name, unit = front, last
    if not unit and quantities_of(name):
        unit = name
    if name.lower() == _LABVIEW_TIME:
        return "time", unit
    words = set(re.split(r"[^a-zäöü0-9\-]+", name.lower().replace("_", " ")))
    words |= {re.sub(r"[0-9]+$", "", word) for word in words}
    named = [quantity for quantity, known in _WORDS.items() if words & known]
    possible = quantities_of(unit) if unit else []
    if possible:
        agreeing = [quantity for quantity in named if quantity in possible]
        # a name may mislead (x is time on a screen, voltage in a sum), a unit does not
        return (agreeing[0] if agreeing else possible[0]), unit
    return (named[0] if named else None), unit


def quantities_of(unit: str) -> list[str]:
    """Return the quantities a unit may belong to, the likelier first."""
    found = [quantity for quantity in ("time", "voltage", "displacement", "temperature") if _factor(quantity, unit)]
    return [*found, "desired"] if "displacement" in found else found


def _factor(quantity: str, unit: str) -> float | None:
    plain = unit.strip().lower().replace("µ", "u").replace("μ", "u").replace("Âµ", "u")
    # capitals tell M from m: a megavolt is no unit of these
    return None if unit.strip().startswith("M") else _UNITS[quantity].get(plain)

"""What an effect is for a controller: its step, sample by sample, in a form that other languages can be made of."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class FieldKind(Enum):
    """What a field of an exported state holds."""

    REAL = "real"  # a number of the precision of the export
    CLOCK = "clock"  # double whatever the precision: a clock must not lose small steps
    COUNT = "count"  # a whole number, not negative


@dataclass(frozen=True)
class StateField:
    """One field of an exported state.

    Attributes:
        name: what it is called.
        initial: value of the relaxed state, one number for each entry.
        kind: what it holds.
        is_array: whether it is an array, of as many entries as ``initial``; else one number.
        comment: what it is, with its unit.
    """

    name: str
    initial: tuple[float, ...] = (0.0,)
    kind: FieldKind = FieldKind.REAL
    is_array: bool = False
    comment: str = ""

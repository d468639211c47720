"""What the compensation loop tells of itself: what it does, by what its memory moved, what it counted."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple


class Activity(Enum):
    """What the loop is doing."""

    WAITING = "waiting for a target"
    TRACKING = "tracking"
    HOLDING = "holding a stale target"
    RAMPING = "ramping to the safe voltage"
    ROUTINE = "driving a routine"
    BORROWED = "driven by a borrower of the voltage"


class Move(NamedTuple):
    """One step of the memory: how long [s], where to [um], second axis, and the voltage it ends with [V]."""

    step_s: float
    desired_um: float
    cross: float
    voltage_v: float


@dataclass
class LoopCounts:
    """What happened in the loop, counted since it began."""

    n_clamped: int = 0
    n_slewed: int = 0
    n_swaps: int = 0
    n_stale: int = 0
    n_without_voltage: int = 0

"""What an effect is for a controller: its step, sample by sample, in a form that other languages can be made of.

The functions of a step form are Python of a small kind, which an export copies into a Python file and translates into
C (export/translation.py): assignments, ``if``, ``for ... in range(...)`` with ``break``, ``return``; numbers,
comparisons, ``and``, ``or``, ``not``; ``min`` and ``max`` of two, ``abs``, ``round``, ``len``, ``int`` of what is not
negative; ``math.sin``, ``math.cos``, ``math.nan``, ``math.exp`` of what is not positive, ``math.log1p`` of what is not
negative; functions named as ``helpers``. Parameters are any of these:

    s          fields of the state, by attribute; changed in place
    k          coefficients of the step, by attribute; ``prepare`` fills them
    c          constants, by attribute
    value      drive [V] or displacement [um], whichever the stage carries
    step_s     length of the step, or of the part of it [s]
    drive_v    at the mechanical stage, the drive as the elements see it [V]
    covariate  the signal the effect reads beside its input
    is_known   whether there is one

``prepare`` may call ``math.expm1`` and ``math.sqrt`` as well: it runs once for each length of step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, TypeAlias

Fields: TypeAlias = Any
"""State, coefficients or constants of a step form: an object with an attribute for each."""

Number: TypeAlias = Any
"""What a step function returns: a number, made of fields that have no type."""

StepFunction: TypeAlias = Callable[..., Any]


class FieldKind(Enum):
    """What a field of an exported state holds; the steps of effects compute in double precision throughout."""

    REAL = "real"  # a number of the precision of the export
    WIDE = "wide"  # double whatever the precision: clocks, and what gains less than its last digit in a step
    COUNT = "count"  # a whole number, 0 to 2^32 - 1


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


@dataclass(frozen=True)
class StepForm:
    """The step of an effect.

    Attributes:
        constants: what does not change, by name: numbers, or tables of numbers that are not empty.
        state: what it remembers between two steps.
        coefficients: names of what a length of step makes of the constants; a pair of name and size for a table.
        prepare: fills them: ``prepare(k, c, step_s)``.
        forward: returns the output for an input; at the hysteresis stage what is added to the elements' sum, for the
            warped drive. Not a number where there is none: then the chain ends there, and so does the answer.
        inverse: returns the input for an output, where the effect is inverted by itself.
        beside: at the hysteresis stage, returns what ``forward`` would, and changes nothing.
        warp: at the hysteresis stage, returns the drive as the elements see it.
        unwarp: returns the drive ``warp`` turns into this one; not a number where there is none.
        widening: at the hysteresis stage, returns by which factor the elements' thresholds are wider.
        helpers: functions that the others call, their parameters annotated as ``float`` or ``int``.
        jumps: names of those above (``forward``, ``inverse``) whose answer jumps where what they are given changes ever
            so little: what comes before them is then computed in double whatever the precision of an export, or they
            would jump a sample earlier or later.
    """

    constants: tuple[tuple[str, float | tuple[float, ...]], ...] = ()
    state: tuple[StateField, ...] = ()
    coefficients: tuple[str | tuple[str, int], ...] = ()
    prepare: StepFunction | None = None
    forward: StepFunction | None = None
    inverse: StepFunction | None = None
    beside: StepFunction | None = None
    warp: StepFunction | None = None
    unwarp: StepFunction | None = None
    widening: StepFunction | None = None
    helpers: tuple[StepFunction, ...] = ()
    jumps: tuple[str, ...] = ()

    @property
    def coefficient_sizes(self) -> dict[str, int]:
        """Size of each coefficient by its name, 0 for a number."""
        return dict((own, 0) if isinstance(own, str) else own for own in self.coefficients)


CLOCK_FIELDS = (
    StateField("elapsed", kind=FieldKind.WIDE, comment="time since the first sample [s]"),
    StateField("started", kind=FieldKind.COUNT, comment="whether there has been one"),
)


def delay_line(n_samples: int) -> tuple[StateField, ...]:
    """Return the state of an effect that reads so many of its newest samples."""
    nothing = (0.0,) * n_samples
    return (
        StateField("elapsed", kind=FieldKind.WIDE, comment="time [s]"),
        StateField("newest", kind=FieldKind.COUNT, comment="where the newest sample stands"),
        StateField("stored", kind=FieldKind.COUNT, comment="how many there are"),
        StateField("behind", kind=FieldKind.COUNT, comment="how many are younger than what is read"),
        StateField("times", nothing, FieldKind.WIDE, is_array=True, comment="of the samples [s]"),
        StateField("values", nothing, is_array=True, comment="of the samples [um]"),
    )


def clock_after(elapsed: float, started: int, step_s: float) -> float:
    """Return the time since the first sample [s]; it stops after thirty years."""
    if started == 0 or elapsed > 1e9:
        return elapsed
    return elapsed + step_s


def lag_ramp(ratio: float) -> float:
    """Return the share of the present input in the output of a first-order lag.

    The step is ``ratio`` time constants long, the input linear over it. The output of the step before has the share
    1 + expm1(-ratio), the input before what is left.
    """
    if ratio < 1e-3:
        return ratio * (0.5 - ratio * (1.0 / 6.0 - ratio * (1.0 / 24.0 - ratio / 120.0)))
    return 1.0 + math.expm1(-ratio) / ratio


def ramp_in_step(ratio: float) -> float:
    """Return the same as ``lag_ramp``, for a ratio that each step makes anew, without the mathematical library."""
    if ratio > 0.25:
        return 1.0 - (1.0 - math.exp(-ratio)) / ratio
    # the series of the other branch, whose closed form cancels for a small ratio
    total = 0.0
    term = 1.0
    for n in range(11):
        term = term * -ratio / (n + 2.0)
        total = total - term
    return total

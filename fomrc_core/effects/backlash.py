"""Between actuator and stage there is play."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.step_form import FieldKind, Fields, Number, StateField, StepForm

# Of the gap: a smaller move is what rounding makes of rest, on which no jump across the gap must hang.
_NOTHING = 1e-10


@compiled
def _run_play(state: Array, half_gap: float, values: Array, out: Array) -> None:
    position = state[0]
    for k in range(values.size):
        position = min(max(position, values[k] - half_gap), values[k] + half_gap)
        out[k] = position
    state[0] = position


@compiled
def _undo_play(state: Array, half_gap: float, values: Array, out: Array) -> None:
    # state: (position, side of the gap it is pushed from)
    position, side = state[0], state[1]
    for k in range(values.size):
        if abs(values[k] - position) > 2.0 * _NOTHING * half_gap:
            side = 1.0 if values[k] > position else -1.0
            position = values[k]
        out[k] = values[k] + side * half_gap
    state[0], state[1] = position, side


@compiled
def _pass_changes(half_gap: float, values: Array, changes: Array, out: Array) -> None:
    position = 0.0
    for k in range(values.size):
        low, high = values[k] - half_gap, values[k] + half_gap
        is_pushed = position < low or position > high or half_gap == 0.0
        position = min(max(position, low), high)
        for j in range(changes.shape[1]):
            if is_pushed:
                out[k, j] = changes[k, j]
            else:
                out[k, j] = out[k - 1, j] if k > 0 else 0.0


def _wait(s: Fields, c: Fields, value: float) -> Number:
    s.position = min(max(s.position, value - c.half_gap), value + c.half_gap)
    return s.position


def _cross(s: Fields, c: Fields, value: float) -> Number:
    if abs(value - s.position) > c.nothing_um:
        s.is_risen = 1 if value > s.position else 0
        s.has_moved = 1
        s.position = value
    if s.has_moved == 0:
        return value
    return value + (c.half_gap if s.is_risen == 1 else -c.half_gap)


@dataclass(frozen=True)
class Backlash(Effect):
    """A play of the displacement: the stage moves once the actuator has crossed the gap.

    It cannot be told from plays of the ceramic but by creep, which within the gap no longer shows.
    """

    name: ClassVar[str] = "backlash"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 14.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("gap_um", "um", 0.0, 1e6, description="width of the gap: what is lost at each turn"),
    )
    main_parameter: ClassVar[str] = "gap_um"
    meaning: ClassVar[str] = "A thread, a hinge or a lever has play: after each turn the stage waits."
    signature: ClassVar[str] = (
        "after each turn the displacement rests for a while, creep and all; but for that it cannot be told from plays "
        "of the ceramic itself, which a model has anyway"
    )
    experiment: ClassVar[str] = (
        "go back by less than the gap and hold: behind a gap nothing creeps; or load the stage with a weight, which "
        "keeps a gap shut and leaves the ceramic's plays"
    )
    inverse_note: ClassVar[str] = "inverted: the displacement jumps across the gap at each turn"
    can_invert: ClassVar[bool] = True
    slope_depends_on_input: ClassVar[bool] = True

    gap_um: float

    def initial_state(self) -> Array:
        """Return (position [um], side of the gap it is pushed from), in the middle of the gap."""
        return np.zeros(2)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement behind the gap [um], shape (n_samples,)."""
        out = np.empty(values.size)
        _run_play(state, 0.5 * self.gap_um, values, out)
        return out

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement before the gap [um]."""
        out = np.empty(values.size)
        _undo_play(state, 0.5 * self.gap_um, values, out)
        return out

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes while the stage is pushed, and the last of them while it waits."""
        if values is None:
            return changes
        passed = np.empty_like(changes)
        _pass_changes(0.5 * self.gap_um, values, changes, passed)
        return passed

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=(("half_gap", 0.5 * self.gap_um), ("nothing_um", _NOTHING * self.gap_um)),
            state=(
                StateField("position", comment="[um]"),
                StateField("is_risen", kind=FieldKind.COUNT, comment="whether it last rose, for the inverse"),
                StateField("has_moved", kind=FieldKind.COUNT, comment="whether it ever moved, for the inverse"),
            ),
            forward=_wait,
            inverse=_cross,
            jumps=("inverse",),
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[Backlash]:
        """Return gaps of some thousandths to some hundredths of the stroke."""
        return cls.proposed({"gap_um": share * evidence.stroke_um} for share in (0.003, 0.01, 0.03, 0.08))

"""Beyond one displacement the stage touches something, which clings to it on the way back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.step_form import FieldKind, Fields, Number, StateField, StepForm

_N_PLACES = 13  # across the stroke, so close that the jump of a trial falls near that of a contact
_FAR = 0.2  # of the adhesion
_USUAL_CLING = 0.025  # of the contact's displacement, where it does not cling
_CLINGS = (0.0, 0.02, 0.05)  # of the stroke


@compiled
def _run_contact(state: Array, contact: float, adhesion: float, share: float, values: Array, out: Array) -> None:
    # state: whether the stage touches. Made at the contact, broken the adhesion's way below it.
    touches = state[0]
    for k in range(values.size):
        if values[k] >= contact:
            touches = 1.0
        elif values[k] < contact - adhesion:
            touches = 0.0
        out[k] = values[k] - share * (values[k] - contact) if touches != 0.0 else values[k]
    state[0] = touches


def _touch(s: Fields, c: Fields, value: float) -> Number:
    if value >= c.contact_um:
        s.touches = 1
    elif value < c.contact_um - c.adhesion_um:
        s.touches = 0
    if s.touches == 0:
        return value
    return value - c.stiffness_share * (value - c.contact_um)


@dataclass(frozen=True)
class IntermittentContact(Effect):
    """A spring the stage runs into at one displacement and is let go by a little below it, with a jump."""

    name: ClassVar[str] = "intermittent_contact"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 16.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        # where it lets go the response jumps: only a difference that moves the jump over some samples has a direction
        Parameter("contact_um", "um", -1e6, 1e6, description="displacement at which contact is made", difference=_FAR),
        Parameter("stiffness_share", "1", 0.0, 0.999, description="share of further motion the contact takes away"),
        Parameter("adhesion_um", "um", 0.0, 1e6, description="how far below it contact is broken", difference=_FAR),
    )
    main_parameter: ClassVar[str] = "contact_um"
    linear_parameters: ClassVar[tuple[str, ...]] = ("stiffness_share",)
    meaning: ClassVar[str] = "A stop, a cable or a sample touches the stage for a part of its stroke."
    signature: ClassVar[str] = "residual bends at one displacement and, where it clings, jumps a little below it"
    experiment: ClassVar[str] = (
        "a slow triangle over the whole stroke, then with the other part moved away: a contact moves with it, a lost "
        "preload does not"
    )
    inverse_note: ClassVar[str] = "not inverted: while it clings, two displacements look the same"
    slope_depends_on_input: ClassVar[bool] = True

    contact_um: float
    stiffness_share: float
    adhesion_um: float = 0.0

    def initial_state(self) -> Array:
        """Return (whether the stage touches), not yet."""
        return np.zeros(1)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement of the stage [um], shape (n_samples,)."""
        out = np.empty(values.size)
        _run_contact(state, self.contact_um, self.adhesion_um, self.stiffness_share, values, out)
        return out

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes, less the contact's share while the stage touches."""
        if values is None:
            return changes
        touching = np.empty(values.size)
        _run_contact(self.initial_state(), 0.0, self.adhesion_um, 1.0, values - self.contact_um, touching)
        slope = 1.0 - self.stiffness_share * (touching == 0.0)
        return np.asarray(changes * slope[:, None])

    def free_names(self) -> tuple[str, ...]:
        """Return what a fit moves; adhesion that is not there stays so."""
        return ("contact_um", "stiffness_share", *(("adhesion_um",) if self.adhesion_um > 0.0 else ()))

    def scale_of(self, name: str, value: float) -> float:
        """Return the adhesion as the unit of either displacement."""
        if name == "stiffness_share":
            return super().scale_of(name, value)
        return self.adhesion_um or _USUAL_CLING * abs(self.contact_um) or super().scale_of(name, value)

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return the share of the motion data would just have shown at this contact."""
        return {"stiffness_share": min(self.stiffness_share * factor, 1.0)}

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=(
                ("contact_um", self.contact_um),
                ("adhesion_um", self.adhesion_um),
                ("stiffness_share", self.stiffness_share),
            ),
            state=(StateField("touches", kind=FieldKind.COUNT, comment="whether the stage touches"),),
            forward=_touch,
            jumps=("forward",) if self.adhesion_um > 0.0 else (),
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[IntermittentContact]:
        """Return weak contacts across the stroke, clinging and not."""
        low = min(float(np.min(record.predicted_um)) for record in evidence.records)
        stroke_um = evidence.stroke_um
        return cls.proposed(
            {"contact_um": low + share * stroke_um, "stiffness_share": 0.01, "adhesion_um": cling * stroke_um}
            for share in np.linspace(0.08, 0.92, _N_PLACES)
            for cling in _CLINGS
        )

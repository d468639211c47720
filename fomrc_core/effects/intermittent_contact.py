"""A contact that is made and broken: of the stage with something in its way, or of the lead that carries its charge."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.contact_times import open_times
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.kernels import elapsed_times
from fomrc_core.effects.base.open_behind import open_times_behind
from fomrc_core.effects.base.step_form import (
    CLOCK_FIELDS,
    FieldKind,
    Fields,
    Number,
    StateField,
    StepForm,
    clock_after,
)
from fomrc_core.errors import ParameterError

_N_PLACES = 13  # across the stroke, so close that the jump of a trial falls near that of a contact
_FAR = 0.2  # of the adhesion
_USUAL_CLING = 0.025  # of the contact's displacement, where it does not cling
_CLINGS = (0.0, 0.02, 0.05)  # of the stroke
_LONGEST_S = 1e9
_BACK = 0.4  # of what was missed while a lead was open: so near the residual is again to where it was
_FOLLOWS = 0.8  # share of the residual's power while a lead is open that follows the drive it does not see


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


@compiled
def _run_openings(state: Array, opens_s: Array, closes_s: Array, values: Array, time_s: Array, out: Array) -> None:
    # state: time and value of the sample before, the value that stays, the opening to come, whether it is open.
    for k in range(values.size):
        at = int(state[3])
        while at < opens_s.size and time_s[k] >= closes_s[at]:
            at += 1
            state[4] = 0.0
        if at < opens_s.size and time_s[k] >= opens_s[at] and state[4] == 0.0:
            # where it stood when the lead opened, between the samples
            step = time_s[k] - state[0]
            share = min(max((opens_s[at] - state[0]) / step, 0.0), 1.0) if step > 0.0 else 1.0
            state[2] = state[1] + share * (values[k] - state[1])
            state[4] = 1.0
        state[0], state[1], state[3] = time_s[k], values[k], float(at)
        out[k] = state[2] if state[4] != 0.0 else values[k]


def _touch(s: Fields, c: Fields, value: float) -> Number:
    if value >= c.contact_um:
        s.touches = 1
    elif value < c.contact_um - c.adhesion_um:
        s.touches = 0
    if s.touches == 0:
        return value
    return value - c.stiffness_share * (value - c.contact_um)


def _stay(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    # The loop of _run_openings, once.
    s.elapsed = clock_after(s.elapsed, s.started, step_s)
    since = step_s
    if s.started == 0:
        since = 0.0
    s.started = 1
    out = value
    for j in range(len(c.opens_s)):
        if s.elapsed >= c.opens_s[j] and s.elapsed < c.closes_s[j]:
            if s.is_open != j + 1:
                share = 1.0
                if since > 0.0:
                    share = min(max((c.opens_s[j] - s.elapsed + since) / since, 0.0), 1.0)
                s.stays = s.before + share * (value - s.before)
                s.is_open = j + 1
            out = s.stays
    s.before = value
    return out


@dataclass(frozen=True)
class IntermittentContact(Effect):
    """A contact that is made and broken.

    Either the stage runs into a spring at one displacement and is let go by a little below it, with a jump. Or the lead
    opens from time to time: the charge stays on the ceramic and the stage where it is, until the lead closes and it
    jumps to where it should have been; that acts on the drive, and the times are those of one record.
    """

    name: ClassVar[str] = "intermittent_contact"
    stage: ClassVar[Stage] = Stage.SENSED
    order: ClassVar[float] = 4.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        # where it lets go the response jumps: only a difference that moves the jump over some samples has a direction
        Parameter("contact_um", "um", -1e6, 1e6, description="displacement at which contact is made", difference=_FAR),
        Parameter("stiffness_share", "1", 0.0, 0.999, description="share of further motion the contact takes away"),
        Parameter("adhesion_um", "um", 0.0, 1e6, description="how far below it contact is broken", difference=_FAR),
        Parameter("opens_s", "s", 0.0, _LONGEST_S, is_list=True, description="when the lead opens, from the start"),
        Parameter("closes_s", "s", 0.0, _LONGEST_S, is_list=True, description="when it closes again"),
    )
    main_parameter: ClassVar[str] = "contact_um"
    generalizes: ClassVar[str] = "lost_preload"  # where nothing clings it is a bend at one displacement
    linear_parameters: ClassVar[tuple[str, ...]] = ("stiffness_share",)
    meaning: ClassVar[str] = (
        "A stop, a cable or a sample touches the stage for a part of its stroke, or a loose lead opens now and then."
    )
    signature: ClassVar[str] = (
        "residual bends at one displacement and, where it clings, jumps a little below it; with a lead that opens the "
        "stage stands while the drive moves, and jumps back"
    )
    experiment: ClassVar[str] = (
        "a slow triangle over the whole stroke, then with the other part moved away: a contact moves with it, a lost "
        "preload does not"
    )
    inverse_note: ClassVar[str] = "not inverted: while it clings, two displacements look the same"
    moved_times: ClassVar[tuple[str, ...]] = ("opens_s", "closes_s")
    slope_depends_on_input: ClassVar[bool] = True

    contact_um: float = 0.0
    stiffness_share: float = 0.0
    adhesion_um: float = 0.0
    opens_s: tuple[float, ...] = ()
    closes_s: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        times = [time for pair in zip(self.opens_s, self.closes_s, strict=False) for time in pair]
        if len(self.opens_s) != len(self.closes_s) or any(a > b for a, b in pairwise(times)):
            raise ParameterError(
                "times do not follow one another",
                where=f"{self.name}.closes_s",
                value=(self.opens_s, self.closes_s),
                allowed="as many as in opens_s, each after its own and before the next",
            )
        if self.opens_s and self.stiffness_share != 0.0:
            raise ParameterError(
                "a lead that opens and a stage that touches are two contacts",
                where=f"{self.name}.stiffness_share",
                value=self.stiffness_share,
                allowed="0 where opens_s is given",
            )
        if self.opens_s:
            object.__setattr__(self, "stage", Stage.SAMPLED_DRIVE)

    def initial_state(self) -> Array:
        """Return (whether the stage touches), not yet; of a lead its clock, and what it remembers."""
        return np.zeros(2 + 5 if self.opens_s else 1)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement of the stage [um], of a lead the voltage behind it [V], shape (n_samples,)."""
        out = np.empty(values.size)
        if not self.opens_s:
            _run_contact(state, self.contact_um, self.adhesion_um, self.stiffness_share, values, out)
            return out
        time_s, is_first = np.empty(values.size), state[1] == 0.0
        elapsed_times(state[:2], steps_s, time_s)
        if is_first:
            state[2], state[3] = time_s[0], values[0]
        _run_openings(state[2:], np.array(self.opens_s), np.array(self.closes_s), values, time_s, out)
        return out

    def is_null(self) -> bool:
        """Return whether nothing is touched and no lead opens."""
        return self.stiffness_share == 0.0 and not self.opens_s

    def belongs_to_record(self) -> bool:
        """Return whether this is a lead, which opens when it does."""
        return bool(self.opens_s)

    def special_case(self) -> dict[str, float]:
        """Return the kink of a stage that is let go where it was touched: its own motion is less by what is taken.

        What is touched is what the sensor sees, behind all masses.
        """
        if self.opens_s:
            return {}
        follows = 1.0 - self.stiffness_share
        return {
            "kink_um": follows * self.contact_um,
            "slope_change": self.stiffness_share / follows,
            "behind_masses": 1.0,
        }

    def is_confirmed(self, time_s: Array, voltage_v: Array, residual_um: Array) -> bool:
        """Return whether in most of what is left at its openings the stage misses the drive, and has it back at once.

        By power and not by number: where another cause is found since, what it did is left no more at its places.

        Args:
            time_s: time since the first sample [s], shape (n_samples,).
            voltage_v: drive [V], shape (n_samples,).
            residual_um: measured minus the model without this cause [um], shape (n_samples,).
        """
        if not self.opens_s:
            return True
        confirmed_um2 = left_um2 = 0.0
        for open_s, close_s in zip(self.opens_s, self.closes_s, strict=True):
            inside = np.flatnonzero((time_s >= open_s) & (time_s < close_s))
            missed_um = residual_um[inside] - residual_um[max(inside[0] - 1, 0)] if inside.size else np.zeros(0)
            left_um2 += float(missed_um @ missed_um)
            if _is_missed(voltage_v, residual_um, inside):
                confirmed_um2 += float(missed_um @ missed_um)
        return 2.0 * confirmed_um2 > left_um2

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes, less the contact's share while the stage touches."""
        if values is None or self.opens_s:
            return changes
        touching = np.empty(values.size)
        _run_contact(self.initial_state(), 0.0, self.adhesion_um, 1.0, values - self.contact_um, touching)
        slope = 1.0 - self.stiffness_share * (touching == 0.0)
        return np.asarray(changes * slope[:, None])

    def free_names(self) -> tuple[str, ...]:
        """Return what a fit moves; adhesion that is not there stays so, and so do the times of a lead."""
        if self.opens_s:
            return ()
        return ("contact_um", "stiffness_share", *(("adhesion_um",) if self.adhesion_um > 0.0 else ()))

    def scale_of(self, name: str, value: float) -> float:
        """Return the adhesion as the unit of either displacement."""
        if name == "stiffness_share":
            return super().scale_of(name, value)
        return self.adhesion_um or _USUAL_CLING * abs(self.contact_um) or super().scale_of(name, value)

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return the share of the motion data would just have shown at this contact; a lead has no such size."""
        if self.opens_s:
            return {}
        return {"stiffness_share": min(self.stiffness_share * factor, 1.0)}

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        if not self.opens_s:
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
        return StepForm(
            constants=(("opens_s", self.opens_s), ("closes_s", self.closes_s)),
            state=(
                *CLOCK_FIELDS,
                StateField("before", comment="voltage of the step before [V]"),
                StateField("stays", comment="voltage that stays while the lead is open [V]"),
                StateField("is_open", kind=FieldKind.COUNT, comment="the opening it is in or was in, from 1"),
            ),
            forward=_stay,
            helpers=(clock_after,),
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[IntermittentContact]:
        """Return weak contacts across the stroke, clinging and not, and the openings of a lead in each record."""
        low = min(float(np.min(record.predicted_um)) for record in evidence.records)
        stroke_um = evidence.stroke_um
        trials: list[dict[str, object]] = [
            {"contact_um": low + share * stroke_um, "stiffness_share": 0.01, "adhesion_um": cling * stroke_um}
            for share in np.linspace(0.08, 0.92, _N_PLACES)
            for cling in _CLINGS
        ]
        for record in evidence.records:
            found = [open_times(record, evidence.noise_um)]
            if record.step_response is not None:
                found.append(open_times_behind(record, evidence.noise_um, record.step_response()))
            trials += [{"opens_s": opens_s, "closes_s": closes_s} for opens_s, closes_s in found if opens_s]
        return cls.proposed(trials)


def _is_missed(voltage_v: Array, residual_um: Array, inside: NDArray[np.int64]) -> bool:
    """Return whether the residual misses the drive in these samples of an open lead, and is back at once after them."""
    if inside.size < 2 or inside[0] == 0 or inside[-1] + 1 >= residual_um.size:
        return False
    before_um = residual_um[inside[0] - 1]
    # behind a lag it comes back within some samples
    after_um = residual_um[inside[-1] + 1 : inside[-1] + 2 + inside.size]
    missed_um = residual_um[inside] - before_um
    unseen_v = voltage_v[inside] - voltage_v[inside[0] - 1]
    power = float(missed_um @ missed_um) * float(unseen_v @ unseen_v)
    along = float(missed_um @ unseen_v)
    follows = power > 0.0 and abs(along) * abs(along) > _FOLLOWS * power
    return follows and float(np.min(np.abs(after_um - before_um))) < _BACK * float(np.max(np.abs(missed_um)))

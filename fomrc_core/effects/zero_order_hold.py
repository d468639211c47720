"""The drive stands still between the samples."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fomrc_core.compute.arrays import ComplexArray
from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.course import Course
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence, RecordEvidence
from fomrc_core.effects.base.step_form import FieldKind, Fields, Number, StateField, StepForm

_FEW_SAMPLES = 20  # held longer, each level is seen in the displacement itself: one trial does
_MOST_SAMPLES = 200  # a command of some hertz beside a sensor of a kilohertz
_N_TRIALS = 2  # of few samples, which are all much like a delay
_N_PARTS_OF_LEVELS = 2  # before the jump and after it
_N_PARTS_JUMPING = 16  # a jump over a part: of what a hold does to a lag of two samples it misses a twentieth
_LONGEST_UNDONE = 1.5  # samples, where a hold is one to which the clocks of command and converter do not quite agree


@compiled
def _run_hold(state: Array, hold_s: float, values: Array, steps_s: Array, out: Array) -> None:
    # state: (value held, time since it was taken, whether one was). Samples are few to a hold and not quite even: the
    # sample nearest to when the hold is over ends it.
    for k in range(values.size):
        state[1] += steps_s[k]
        if state[2] == 0.0 or state[1] >= hold_s - 0.5 * steps_s[k]:
            state[0], state[1], state[2] = values[k], 0.0, 1.0
        out[k] = state[0]


def _hold(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    s.since = s.since + step_s
    if s.has_taken == 0 or s.since >= c.hold_s - 0.5 * step_s:
        s.held = value
        s.since = 0.0
        s.has_taken = 1
    return s.held


@dataclass(frozen=True)
class ZeroOrderHold(Effect):
    """The command is taken at a sample and held for a time, where the model would go straight to the next sample.

    The displacement is read as by a converter that integrates over the sample, half of it before the jump from one hold
    to the next and half after, so that the hold costs half of its time: with small steps on a chain without dynamics
    nothing tells it from a delay.

    A converter that takes each sample as it comes keeps it until the next, however far apart the samples of a record
    are (``per_sample``); one with a clock of its own keeps it for a time.
    """

    name: ClassVar[str] = "zero_order_hold"
    stage: ClassVar[Stage] = Stage.SAMPLED_DRIVE
    order: ClassVar[float] = 20.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("hold_s", "s", 0.0, 1e5, description="how long a value is held, a number of samples"),
        Parameter("per_sample", "1", 0.0, 1.0, description="1: each sample of a record until its next; 0: that time"),
    )
    main_parameter: ClassVar[str] = "hold_s"
    held_parameters: ClassVar[tuple[str, ...]] = ("hold_s", "per_sample")
    meaning: ClassVar[str] = "The converter keeps its voltage until the next sample, on average half a sample too long."
    signature: ClassVar[str] = "residual follows the rate of the displacement like that of half a hold's delay"
    experiment: ClassVar[str] = (
        "sample the displacement some times faster than the drive is updated: a hold shows as stairs, a delay does not"
    )
    inverse_note: ClassVar[str] = "no inverse: between two updates nothing can be done; update faster"
    needs_substeps: ClassVar[bool] = True

    hold_s: float
    per_sample: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "per_sample", float(round(self.per_sample)))

    @property
    def holds(self) -> bool:
        """Whether the drive stands still between samples."""
        return self.hold_s > 0.0

    def initial_state(self) -> Array:
        """Return (value held [V], time since it was taken [s], whether one was)."""
        return np.zeros(3)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the drive [V] that is held from each sample on, shape (n_samples,)."""
        if not self.holds or self.per_sample:
            return values
        out = np.empty(values.size)
        _run_hold(state, self.hold_s, values, steps_s, out)
        return out

    def response(self, frequency_hz: Array) -> ComplexArray:
        """Return sinc(f T) exp(-i pi f T) [1] at frequencies [Hz], of a hold as long as the samples are apart."""
        along = frequency_hz * self.hold_s
        return np.asarray(np.sinc(along) * np.exp(-1j * np.pi * along))

    def undo_known(self, wanted: Array, course: Course) -> Array | None:
        """Return the samples [V] whose holds give what is wanted; None for holds of several samples.

        Those turn a course into another at other frequencies, which no filter undoes.
        """
        if self.hold_s > _LONGEST_UNDONE * course.step_s:
            return None
        return super().undo_known(wanted, course)

    def sampled_every(self, step_s: float) -> ZeroOrderHold:
        """Return the hold of samples this far apart [s]."""
        return replace(self, hold_s=step_s) if self.holds and self.per_sample else self

    def least_parts(self, effects: tuple[Effect, ...]) -> int:
        """Return two parts, for plays see either level and not their mean, and more where jumps are seen behind it."""
        sees_jumps = any(effect.needs_substeps and effect.name != self.name for effect in effects)
        if not self.holds:
            return 1
        return _N_PARTS_JUMPING if sees_jumps else _N_PARTS_OF_LEVELS

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return nothing: a hold is a number of samples, of which none is smaller than one."""
        return {}

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        if not self.holds or self.per_sample:
            return StepForm()
        return StepForm(
            constants=(("hold_s", self.hold_s),),
            state=(
                StateField("held", comment="[V]"),
                StateField("since", kind=FieldKind.WIDE, comment="time since it was taken [s]"),
                StateField("has_taken", kind=FieldKind.COUNT, comment="whether there is one"),
            ),
            forward=_hold,
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[ZeroOrderHold]:
        """Return the numbers of samples whose holds make a drive most like the residual.

        A hold of one sample is one of each sample: that a clock of its own runs at the rate of the record would be
        chance, and records of other rates would show it.
        """
        gains = {n: sum(_likeness(r, n) for r in evidence.records) for n in range(1, _MOST_SAMPLES + 1)}
        ordered = sorted(gains, key=lambda n: -gains[n])
        likeliest = [n for n in ordered if n <= _FEW_SAMPLES][:_N_TRIALS] + [n for n in ordered if n > _FEW_SAMPLES][:1]
        # one sample is what converters hold; beside a delay that has taken its time no residual is like it
        likeliest += [1] if 1 not in likeliest else []
        return cls.proposed({"hold_s": n * evidence.sample_period_s, "per_sample": float(n == 1)} for n in likeliest)


def _likeness(record: RecordEvidence, n_samples: int) -> float:
    """Return what of the residual is like the change of the drive by holds of this many samples [um^2]."""
    drive = record.voltage_v
    held = drive[(np.arange(drive.size) // n_samples) * n_samples]
    before = np.concatenate((held[:1], held[:-1]))
    change = 0.5 * (held + before) - drive
    change = change - np.mean(change)
    power = float(np.dot(change, change))
    return float(np.dot(change, record.residual_um)) ** 2 / power if power > 0.0 else 0.0

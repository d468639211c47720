"""The inverse of a whole target: resonances, delays and amplifiers undone together with hysteresis and creep.

Where a target is known as a whole, what an effect needs of the future is there. Effects are undone one by one
(``Effect.undo_known``), hysteresis and creep between them as section 4.3 does. What the chain then gives is simulated,
between the samples as well, and what it lacks is added to what is wanted, again and again:

    w <- w + B (x - F(G(w))),        F the model, G the inverse one by one, B the band in which samples hold a course

F(G(w)) = w but for the straight lines of the voltage between samples and for the bends of hysteresis within a step, so
this contracts by the share these have in the band: errors fall a hundredfold in two rounds at ten samples a period.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fomrc_core.compute.arrays import Array, ComplexArray
from fomrc_core.effects import Effect, Stage
from fomrc_core.effects.base.course import FLAT, Course
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.hysteresis_bends import N_PARTS, WIDE_FLAT, WIDE_GONE
from fomrc_core.model.known_rounds import KnownRounds, RepeatedCourse
from fomrc_core.model.known_target import KnownTarget
from fomrc_core.model.near_sample_rate import is_struck_within_samples, ringing_notes
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.waveform import Waveform

_ASKED_AT_ONCE = 0.01  # of the range
# The voltage begins where the target does, so that what it lacks in the first moments cannot be had: no round asks for
# it. So many samples, the shortest swing in the band a few times over, and as long as the stage answers late.
_N_FIRST = 60
_LEAST_LINE = 0.4  # of a course is left in a straight line from sample to sample at half the sample rate: sinc^2


@dataclass(frozen=True, eq=False)
class DynamicInverse:
    """Feedforward for a target that is known as a whole; the live ``Compensator`` knows no future.

    Args:
        model: the actuator; it is taken as relaxed at first, whatever its ``start``.
    """

    model: PiezoModel

    def __str__(self) -> str:
        return f"inverse, with all that is to come, of a {self.model}"

    @property
    def is_needed(self) -> bool:
        """Whether something in the model answers late or rings, so that an inverse gains by what is to come."""
        at_rest = np.zeros(1)
        return any(effect.response(at_rest) is not None for effect in self.model.effects if not effect.is_null())

    def run(self, target: KnownTarget) -> Waveform:
        """Return the voltage that makes the actuator follow a target, and what the model then does.

        Args:
            target: even samples; where it is periodic, one period of an endless scan.
        """
        wanted = target.desired_um
        model = self.model.sampled_every(target.step_s)
        chain = _KnownChain.of(model, Course(wanted.size, target.step_s, target.is_periodic))
        voltage_v, reached_um, errors_um = chain.converged(wanted)
        left = tuple((c.name, c.inverse_note) for c in model.causes if c not in chain.effects)
        return Waveform(
            target=target,
            voltage_v=voltage_v,
            reached_um=reached_um,
            n_first=0 if target.is_periodic else chain.n_first,
            errors_um=errors_um,
            slow_v=chain.slow(wanted),
            not_inverted=left,
            notes=(*chain.ringing_notes(), *chain.start_notes(wanted)),
        )


@dataclass(frozen=True, eq=False)
class _KnownChain:
    """The model with what is undone of it, over the samples of one target."""

    effects: tuple[Effect, ...]
    forward: PiezoModel
    core: Compensator
    course: Course  # of the target
    simulated: RepeatedCourse
    is_struck: bool  # whether what hysteresis bends within samples sets the stage ringing

    @classmethod
    def of(cls, model: PiezoModel, course: Course) -> _KnownChain:
        blank = np.zeros(course.n_samples)
        undone = tuple(
            effect
            for effect in model.effects
            if (effect.stage is Stage.HYSTERESIS and effect.can_invert) or effect.undo_known(blank, course) is not None
        )
        beside = tuple(e for e in undone if e.stage is Stage.HYSTERESIS and e.can_invert)
        core = Compensator(replace(model, effects=beside, start=None))
        is_struck = is_struck_within_samples(undone, course.step_s)
        if is_struck:
            course = replace(course, flat=WIDE_FLAT, gone=WIDE_GONE)
        forward = replace(model, effects=undone, start=None)
        return cls(undone, forward, core, course, RepeatedCourse(course), is_struck)

    @property
    def n_late(self) -> int:
        """Number of samples by which the stage answers late to slow motion."""
        late_s = 0.0
        slow_hz = FLAT / self.course.step_s * 1e-3  # where a linear effect is but late
        for effect in self.effects:
            gain = effect.response(np.array([slow_hz]))
            if gain is not None:
                late_s += float(-np.angle(gain[0]) / (2.0 * np.pi * slow_hz))
        return int(np.ceil(max(late_s, 0.0) / self.course.step_s))

    @property
    def n_first(self) -> int:
        """Number of samples at the start in which the target cannot be reached."""
        return min(_N_FIRST + self.n_late, self.course.n_samples - 1)

    def converged(self, desired_um: Array) -> tuple[Array, Array, Array]:
        """Return voltage, displacement and the error of each round [um rms], (n_rounds,); the best round's."""
        rounds = KnownRounds(
            lambda wanted: self.guess(wanted[:, 0])[:, None],
            lambda voltage: self._simulated(voltage[:, 0])[:, None],
            lambda values: self.course.in_band(values[:, 0])[:, None],
            0 if self.course.is_periodic else self.n_first,
        )
        voltage_v, reached_um, errors_um = rounds.converged(desired_um[:, None])
        return voltage_v[:, 0], reached_um[:, 0], errors_um[:, 0]

    def guess(self, wanted: Array) -> Array:
        """Return the voltage by undoing one effect after the other, shape (n_samples,)."""
        values, fine = self.simulated.repeated(wanted), self.simulated
        if self.is_struck:
            values = self.simulated.whole.in_parts(values, N_PARTS)
            fine = RepeatedCourse(self.course.refined(N_PARTS))
        for effect in self._of(Stage.SENSED, Stage.MECHANICAL):
            values = _undone(effect, values, fine.whole)
        values = fine.closed(self.core.run(fine.steps_s, values))
        for effect in self._of(Stage.DRIVE):
            values = _undone(effect, values, fine.whole)
        if self.is_struck:
            values = self._of_parts(values, fine.whole)
        for effect in self._of(Stage.SAMPLED_DRIVE):
            values = _undone(effect, values, self.simulated.whole)
        return self.simulated.last(values)

    def _of(self, *stages: Stage) -> list[Effect]:
        """Return the effects of some stages, the last first."""
        return [effect for effect in reversed(self.effects) if effect.stage in stages]

    def _of_parts(self, values: Array, fine: Course) -> Array:
        """Return the samples of which a converter makes what is wanted in parts of them, as far as samples reach."""
        step_s, is_held = self.course.step_s, any(effect.holds for effect in self.effects)

        def lacking(frequency_hz: Array) -> ComplexArray:
            line = np.ones(1) if is_held else np.maximum(np.sinc(frequency_hz * step_s) ** 2, _LEAST_LINE)
            return np.asarray(1.0 / line, dtype=np.complex128)

        return np.ascontiguousarray(fine.filtered(fine.in_band(values), lacking)[::N_PARTS])

    def slow(self, wanted: Array) -> Array:
        """Return the voltage were the target followed infinitely slowly [V], shape (n_samples,): lag and ring left."""
        return self.simulated.last(self.core.run(self.simulated.steps_s, self.simulated.repeated(wanted)))

    def ringing_notes(self) -> list[str]:
        """Return a line for each effect that rings near the sample rate."""
        return ringing_notes(self.effects, self.course.step_s, "--rate")

    def start_notes(self, desired_um: Array) -> list[str]:
        """Return a line where a target asks for something before the stage can answer."""
        moved_um = float(np.ptp(desired_um[: self.n_late + 2]))
        begins_um = float(desired_um[0])
        if self.course.is_periodic or max(abs(begins_um), moved_um) <= _ASKED_AT_ONCE * float(np.ptp(desired_um)):
            return []
        return [
            f"the target begins {begins_um:.4g} um from the relaxed stage and moves {moved_um:.4g} um in the first "
            f"{1e3 * (self.n_late + 1) * self.course.step_s:.3g} ms, too soon to be followed: begin with a rest at 0 um"
        ]

    def _simulated(self, voltage_v: Array) -> Array:
        steps_s, voltages_v = self.simulated.steps_s, self.simulated.repeated(voltage_v)
        return self.simulated.last(self.forward.simulate(steps_s, voltages_v))


def _undone(effect: Effect, values: Array, course: Course) -> Array:
    found = effect.undo_known(values, course)
    return values if found is None else found

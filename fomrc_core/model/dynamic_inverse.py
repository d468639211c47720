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

from fomrc_core.compute.arrays import Array
from fomrc_core.effects import Effect, Stage
from fomrc_core.effects.base.course import FLAT, Course
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.known_target import KnownTarget
from fomrc_core.model.near_sample_rate import ringing_notes
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.waveform import Waveform

_MOST_ROUNDS = 20
_NO_BETTER = 0.95  # of the error of the round before: what is left is what the band does not hold
_ASKED_AT_ONCE = 0.01  # of the range
_ENOUGH = 1e-7  # of the range, a tenth of a nanometre in a millimetre
# The voltage begins where the target does, so that what it lacks in the first moments cannot be had: no round asks for
# it. So many samples, the shortest swing in the band a few times over, and as long as the stage answers late.
_N_FIRST = 60
# Creep goes on with the logarithm of time. The period halfway between the second and the hundredth (sqrt(2 * 100)) is
# the one whose level is least off in both.
N_PERIODS = 14


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
        chain = _KnownChain.of(self.model, Course(wanted.size, target.step_s, target.is_periodic))
        voltage_v, reached_um, errors_um = chain.converged(wanted)
        left = tuple((c.name, c.inverse_note) for c in self.model.causes if c not in chain.effects)
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
    repeated: Course  # of what is simulated: the target, or some of its periods

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
        repeated = course.tiled(N_PERIODS) if course.is_periodic else course
        return cls(undone, replace(model, effects=undone, start=None), core, course, repeated)

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
        weights = np.ones(desired_um.size)
        first = 0 if self.course.is_periodic else self.n_first
        if first:
            weights[:first] = 0.5 - 0.5 * np.cos(np.pi * np.arange(first) / first)
        wanted = desired_um
        enough_um = _ENOUGH * float(np.ptp(desired_um))
        errors_um: list[float] = []
        best = wanted, wanted
        for _ in range(_MOST_ROUNDS):
            voltage_v = self.guess(wanted)
            reached_um = self._last_period(self.forward.simulate(self.repeated.steps_s, self._repeat(voltage_v)))
            lacking = weights * (desired_um - reached_um)
            error_um = float(np.sqrt(np.mean(lacking[first:] ** 2)))
            least_um = min(errors_um, default=np.inf)
            errors_um.append(error_um)
            if error_um < least_um:
                best = voltage_v, reached_um
            if error_um > _NO_BETTER * least_um or error_um <= enough_um:
                break
            wanted = wanted + self.course.in_band(lacking)
        return *best, np.array(errors_um)

    def guess(self, wanted: Array) -> Array:
        """Return the voltage by undoing one effect after the other, shape (n_samples,)."""
        values = self._repeat(wanted)
        behind = [e for e in reversed(self.effects) if e.stage in (Stage.MECHANICAL, Stage.SENSED)]
        before = [e for e in reversed(self.effects) if e.stage in (Stage.DRIVE, Stage.SAMPLED_DRIVE)]
        for effect in behind:
            values = self._undone(effect, values)
        values = self.core.run(self.repeated.steps_s, values)
        if self.course.is_periodic:
            values = self._repeat(_closed(self._last_period(values), values))
        for effect in before:
            values = self._undone(effect, values)
        return self._last_period(values)

    def slow(self, wanted: Array) -> Array:
        """Return the voltage were the target followed infinitely slowly [V], shape (n_samples,): lag and ring left."""
        return self._last_period(self.core.run(self.repeated.steps_s, self._repeat(wanted)))

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

    def _undone(self, effect: Effect, values: Array) -> Array:
        found = effect.undo_known(values, self.repeated)
        return values if found is None else found

    def _repeat(self, values: Array) -> Array:
        return np.tile(values, N_PERIODS) if self.course.is_periodic else values

    def _last_period(self, values: Array) -> Array:
        return values[-self.course.n_samples :] if self.course.is_periodic else values


def _closed(last: Array, all_periods: Array) -> Array:
    """Return a period whose end meets its start: creep carries each a little further than the one before."""
    n_samples = last.size
    drift_v = float(all_periods[-1] - all_periods[-1 - n_samples])
    along = (np.arange(n_samples) + 1.0) / n_samples - 0.5
    return np.asarray(last - drift_v * along)

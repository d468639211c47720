"""The inverse of targets of several axes that are known as a whole: modes, delay and coupling undone together.

    own = B G^-1 x   (frequency by frequency, with what is to come),   voltages = axis inverses of own

G is what the outputs do for a um of each input's own model, as it is stepped; B the band in which undoing it takes no
more than ``LARGEST_GAIN`` of the drive of slow motion. Zeros of G outside of the unit circle, by which an inverse
without a future would grow for ever, are undone by what is to come. Hysteresis and creep of each input are inverted
exactly. The rounds of known_rounds.py then add what the whole model lacks, joints, relay and level law with it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fomrc_core.compute.arrays import Array, ComplexArray
from fomrc_core.effects.base.course import FLAT, GONE, Course, low_pass
from fomrc_core.errors import ParameterError
from fomrc_core.model.axes.axes_model import AxesModel
from fomrc_core.model.axes.compensator import AxesCompensator
from fomrc_core.model.axes.response import axes_response
from fomrc_core.model.known_rounds import KnownRounds, RepeatedCourse
from fomrc_core.model.known_target import KnownTarget
from fomrc_core.model.preview_filter import LARGEST_GAIN
from fomrc_core.model.waveform import Waveform

_N_FREQUENCIES = 4096
# Samples at the start in which a target cannot be reached, beside those of the delay: the voltage begins where the
# target does. The shortest swing in the band a few times over.
_N_FIRST = 60
# Of the power of the inverse's answer to one sample: what may lie further away than a course goes on beyond its ends.
_MOST_BEYOND = 1e-4
_LEFT = 1e-3  # of the range: what the target has beyond the band, and is worth a line


@dataclass(frozen=True, eq=False)
class AxesDynamicInverse:
    """Feedforward of several axes for targets that are known as a whole.

    Args:
        model: with as many outputs as inputs; it is taken as relaxed at first.

    Raises:
        ParameterError: outputs and inputs differ in number, or cannot be told from one another at rest.
    """

    model: AxesModel

    def __post_init__(self) -> None:
        AxesCompensator(self.model)  # refuses what has no inverse

    @property
    def is_needed(self) -> bool:
        """Whether something answers late or rings, so that an inverse gains by what is to come."""
        return self.model.modes is not None or self.model.delay_s > 0.0

    def run(self, targets: tuple[KnownTarget, ...]) -> tuple[Waveform, ...]:
        """Return the voltage of each input, with the target and the motion of the output of the same number.

        Args:
            targets: one of each output, of the same times.

        Raises:
            ParameterError: another number of targets, or an inverse that needs more of the future than there is.
        """
        if len(targets) != self.model.n_outputs:
            raise ParameterError(
                "number of targets does not fit", where="targets", value=len(targets), allowed=str(self.model.n_outputs)
            )
        first = targets[0]
        desired_um = np.stack([target.desired_um for target in targets], axis=1)
        course = Course(len(desired_um), first.step_s, first.is_periodic)
        chain = _KnownAxes.of(self.model, course, desired_um)
        chain.check()
        n_first = 0 if course.is_periodic else min(_N_FIRST + chain.n_late, course.n_samples - 1)
        rounds = KnownRounds(chain.guess, chain.forward, chain.in_band, n_first)
        voltage_v, reached_um, errors_um = rounds.converged(desired_um)
        slow_v, left, found = chain.slow(desired_um), AxesCompensator(self.model).not_inverted, []
        for k, target in enumerate(targets):
            of_axis = (errors_um[:, k], slow_v[:, k], left[k], chain.notes(desired_um[:, k]))
            found.append(Waveform(target, voltage_v[:, k], reached_um[:, k], n_first, *of_axis))
        return tuple(found)


@dataclass(frozen=True, eq=False)
class _KnownAxes:
    """A model of several axes over the samples of its targets."""

    model: AxesModel
    core: AxesCompensator
    simulated: RepeatedCourse
    level_v: float | None

    @classmethod
    def of(cls, model: AxesModel, course: Course, desired_um: Array) -> _KnownAxes:
        """Return it with what is undone of it alone, at the level of the drive that slow motion takes."""
        inverted = tuple(
            replace(axis, effects=tuple(effect for effect in axis.effects if effect.can_invert), start=None)
            for axis in model.axes
        )
        undone = replace(model, axes=inverted)
        slow = cls(undone, AxesCompensator(undone), RepeatedCourse(course), None)
        if model.level is None:
            return slow
        level_v = max(float(np.sqrt(np.mean(slow.slow(desired_um) ** 2))), np.finfo(np.float64).tiny)
        return cls(undone, AxesCompensator(undone, level_v), RepeatedCourse(course), level_v)

    @property
    def course(self) -> Course:
        """Of the targets."""
        return self.simulated.course

    @property
    def n_late(self) -> int:
        """Samples by which all motion is late."""
        return int(np.ceil(self.model.delay_s / self.course.step_s)) + 1

    @cached_property
    def flat_hz(self) -> float:
        """Up to here everything is undone [Hz]: what samples hold, or what takes no more than ``LARGEST_GAIN``."""
        top_hz = FLAT / self.course.step_s
        frequency_hz = np.linspace(0.0, top_hz, _N_FREQUENCIES)
        drives = self._inverse(frequency_hz) @ self._response(np.zeros(1))
        too_much = np.linalg.norm(drives, ord=2, axis=(1, 2)) > LARGEST_GAIN
        return float(frequency_hz[max(int(np.argmax(too_much)) - 1, 0)]) if np.any(too_much) else top_hz

    def guess(self, wanted_um: Array) -> Array:
        """Return the voltages by undoing one part after the other, (n_samples, n_axes)."""
        own_um = self.simulated.whole.filtered_together(self.simulated.repeated(wanted_um), self._undoing)
        return self._voltages(own_um)

    def slow(self, wanted_um: Array) -> Array:
        """Return the voltages were the targets followed infinitely slowly [V], (n_samples, n_axes)."""
        return self._voltages(self.core.decoupled_um(self.simulated.repeated(wanted_um)))

    def forward(self, voltage_v: Array) -> Array:
        """Return what the stage does, (n_samples, n_axes) [um]."""
        steps_s = self.simulated.steps_s
        return self.simulated.last(self.model.simulate(steps_s, self.simulated.repeated(voltage_v)))

    def in_band(self, values: Array) -> Array:
        """Return values less what is beyond the band."""
        whole = np.eye(values.shape[1], dtype=np.complex128)
        return self.course.filtered_together(values, lambda hz: self._band(hz)[:, None, None] * whole)

    def notes(self, desired_um: Array) -> tuple[str, ...]:
        """Return a line where a target has more than the band holds."""
        range_um = float(np.ptp(desired_um))
        over_um = desired_um - self.course.filtered(desired_um, lambda hz: self._band(hz).astype(np.complex128))
        most_um = float(np.max(np.abs(over_um)))
        if most_um <= _LEFT * range_um:
            return ()
        return (
            f"the target has {most_um:.3g} um above {self.flat_hz:.4g} Hz, where modes are not undone: that would take "
            f"more than {LARGEST_GAIN:g} times the voltage of slow motion",
        )

    def check(self) -> None:
        """Raise ParameterError where no motion is undone, or it takes more of what is to come than a course has."""
        least_hz = 1.0 / (self.course.n_samples * self.course.step_s)
        if self.flat_hz < least_hz:
            raise ParameterError(
                "the modes of no motion can be undone",
                where="model.axes",
                value=f"up to {self.flat_hz:.3g} Hz",
                allowed=f"{least_hz:.3g} Hz, the slowest in the target",
            )
        n_beyond = self.course.n_beyond
        n_grid = 16 * n_beyond
        gains = self._undoing(np.asarray(np.fft.rfftfreq(n_grid, self.course.step_s), dtype=np.float64))
        power = np.sum(np.fft.irfft(gains, n_grid, axis=0) ** 2, axis=(1, 2))
        beyond = float(np.sum(power[n_beyond : n_grid - n_beyond]) / np.sum(power))
        if beyond > _MOST_BEYOND and not self.course.is_periodic:
            raise ParameterError(
                "the inverse of the modes reaches further than the target",
                where="model.axes",
                value=f"{100.0 * beyond:.2g} % of it beyond {n_beyond * self.course.step_s:.3g} s",
                allowed=f"{100.0 * _MOST_BEYOND:g} %: a longer target, or a model whose zeros are better damped",
            )

    def _voltages(self, own_um: Array) -> Array:
        steps_s = self.simulated.steps_s
        return self.simulated.last(self.simulated.closed(self.core.own_voltages(steps_s, own_um)))

    def _response(self, frequency_hz: Array) -> ComplexArray:
        return axes_response(self.model, frequency_hz, self.course.step_s, self.level_v)

    def _inverse(self, frequency_hz: Array) -> ComplexArray:
        left, size, right = np.linalg.svd(self._response(frequency_hz))
        size = np.maximum(size, np.finfo(np.float64).eps * size[:, :1])
        inverse = np.swapaxes(right.conj(), 1, 2) @ (np.swapaxes(left.conj(), 1, 2) / size[:, :, None])
        return np.asarray(inverse)

    def _band(self, frequency_hz: Array) -> Array:
        return low_pass(frequency_hz, self.flat_hz, GONE / FLAT * self.flat_hz)

    def _undoing(self, frequency_hz: Array) -> ComplexArray:
        band = self._band(frequency_hz)
        found = np.zeros((band.size, self.model.n_inputs, self.model.n_outputs), np.complex128)
        held = band > 0.0
        found[held] = band[held, None, None] * self._inverse(frequency_hz[held])
        return found

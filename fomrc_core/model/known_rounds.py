"""The rounds by which the voltage of a whole target is found: a guess, what the model makes of it, what that lacks.

w <- w + B (x - F(G(w))),        F the model, G the inverse one by one, B the band in which samples hold a course
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.effects.base.course import Course

_MOST_ROUNDS = 20
_NO_BETTER = 0.95  # of the error of the round before: what is left is what the band does not hold
_ENOUGH = 1e-7  # of the range, a tenth of a nanometre in a millimetre
# Creep goes on with the logarithm of time. The period halfway between the second and the hundredth (sqrt(2 * 100)) is
# the one whose level is least off in both.
N_PERIODS = 14


@dataclass(frozen=True, eq=False)
class KnownRounds:
    """How the voltage of a whole target is found.

    Attributes:
        guess: voltage [V] of what is wanted [um], both of shape (n_samples, n_axes).
        forward: displacement [um] of a voltage [V], of the same shapes.
        in_band: values less what is beyond the band, the same.
        n_first: samples at the start in which the target cannot be reached, 0 where it is periodic.
    """

    guess: Callable[[Array], Array]
    forward: Callable[[Array], Array]
    in_band: Callable[[Array], Array]
    n_first: int

    def converged(self, desired_um: Array) -> tuple[Array, Array, Array]:
        """Return voltage, displacement and each round's error of each axis [um rms], (n_rounds, n_axes); the best's.

        Args:
            desired_um: shape (n_samples, n_axes).
        """
        weights, first = np.ones((desired_um.shape[0], 1)), self.n_first
        if first:
            weights[:first, 0] = 0.5 - 0.5 * np.cos(np.pi * np.arange(first) / first)
        range_um = np.ptp(desired_um, axis=0)
        unit_um = np.where(range_um > 0.0, range_um, 1.0)
        wanted, best = desired_um, (desired_um, desired_um)
        errors_um: list[Array] = []
        least = np.inf
        for _ in range(_MOST_ROUNDS):
            voltage_v = self.guess(wanted)
            reached_um = self.forward(voltage_v)
            lacking = weights * (desired_um - reached_um)
            errors_um.append(np.sqrt(np.mean(lacking[first:] ** 2, axis=0)))
            error = float(np.sqrt(np.mean((errors_um[-1] / unit_um) ** 2)))
            if error < least:
                best = voltage_v, reached_um
            if error > _NO_BETTER * least or error <= _ENOUGH:
                break
            least = min(error, least)
            wanted = wanted + self.in_band(lacking)
        return *best, np.array(errors_um)


@dataclass(frozen=True)
class RepeatedCourse:
    """A course, and what is simulated of it: itself, or some of its periods.

    Attributes:
        course: the course.
    """

    course: Course

    @property
    def steps_s(self) -> Array:
        """Steps of what is simulated [s]."""
        return self.whole.steps_s

    @property
    def whole(self) -> Course:
        """What is simulated, as a course."""
        return self.course.tiled(N_PERIODS) if self.course.is_periodic else self.course

    def repeated(self, values: Array) -> Array:
        """Return values of the course, (n_samples, ...), for all that is simulated."""
        return np.tile(values, (N_PERIODS, *(1,) * (values.ndim - 1))) if self.course.is_periodic else values

    def last(self, values: Array) -> Array:
        """Return the last period of what was simulated."""
        return values[-self.course.n_samples :] if self.course.is_periodic else values

    def closed(self, values: Array) -> Array:
        """Return values of all that is simulated as repetitions of a last period whose end meets its start.

        Creep carries each period a little further than the one before.
        """
        if not self.course.is_periodic:
            return values
        n_samples = self.course.n_samples
        drift = values[-1] - values[-1 - n_samples]
        along = (np.arange(n_samples) + 1.0) / n_samples - 0.5
        return self.repeated(np.asarray(self.last(values) - np.multiply.outer(along, drift)))

"""The motions of figures 15 and 16, as they are published: one displacement for each tick."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fomrc_core.compute.arrays import Array

RATE_HZ = 500.0
# At the stage's 1.2 um/V the 1 V/s of figure 16.
_TRIANGLE_UM_PER_S = 1.2
# Goal as a share of the amplitude, time to get there [s], rest there [s].
_TRACKING = (
    (0.9, 3.0, 2.0),
    (-0.6, 4.0, 0.0),
    (0.5, 3.0, 2.0),
    (-1.0, 4.0, 1.0),
    (0.2, 3.0, 0.0),
    (-0.4, 2.0, 1.0),
    (0.0, 2.0, 1.0),
)


@dataclass(frozen=True, eq=False)
class Target:
    """A desired motion.

    Attributes:
        name: what to call it.
        desired_um: displacement at each tick of ``RATE_HZ`` [um], shape (n_ticks,).
    """

    name: str
    desired_um: Array

    @property
    def duration_s(self) -> float:
        """How long it takes [s]."""
        return self.desired_um.size / RATE_HZ


def tracking_target(amplitude_um: float) -> Target:
    """Return the motion of figure 15: swings of changing size, and rests in which creep would show."""
    parts, place = [np.zeros(1)], 0.0
    for goal, moving_s, resting_s in _TRACKING:
        n = int(moving_s * RATE_HZ)
        blend = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, n + 1) / n)
        parts += [place + (goal - place) * blend, np.full(int(resting_s * RATE_HZ), goal)]
        place = goal
    return Target("tracking (figure 15)", amplitude_um * np.concatenate(parts))


def triangle_target(amplitude_um: float) -> Target:
    """Return the motion of figure 16: a triangle of decreasing amplitude, 1.2 um/s as at 1 V/s."""
    swings = [sign * share for share in (1.0, 0.8, 0.6, 0.4, 0.2) for sign in (1.0, -1.0)]
    parts = [np.zeros(1)]
    for start, stop in pairwise([0.0, *swings, 0.0]):
        n = int(abs(stop - start) * amplitude_um / _TRIANGLE_UM_PER_S * RATE_HZ)
        parts.append(start + (stop - start) * np.arange(1, n + 1) / n)
    return Target("triangle (figure 16)", amplitude_um * np.concatenate(parts))

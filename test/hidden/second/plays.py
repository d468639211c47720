"""Play operators: the classical stack by its first loading, and one by one where envelopes or rates matter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from test.hidden.second.everett import run_everett
from test.hidden.second.reversals import sweeps_of

Envelope = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class PlayStack:
    """Classical Prandtl-Ishlinskii operator: a slope and plays.

    Args:
        slope_um_per_v: reversible part [um/V].
        thresholds_v: half widths [V], rising, shape (n_plays,).
        weights_um_per_v: their weights [um/V], shape (n_plays,).
    """

    slope_um_per_v: float
    thresholds_v: np.ndarray
    weights_um_per_v: np.ndarray

    def run(self, drive_v: np.ndarray) -> np.ndarray:
        """Return the response [um] to a drive [V] that starts relaxed at 0; shape (n_samples,)."""
        knots = np.concatenate([[0.0], self.thresholds_v])
        slopes = self.slope_um_per_v + np.concatenate([[0.0], np.cumsum(self.weights_um_per_v)])
        loading = np.concatenate([[0.0], np.cumsum(slopes[:-1] * np.diff(knots))])

        def everett(high: np.ndarray, low: np.ndarray) -> np.ndarray:
            # Masing: every branch is the first loading, doubled.
            half = 0.5 * (high - low)
            beyond = np.maximum(half - knots[-1], 0.0)
            return 2.0 * (np.interp(half, knots, loading) + slopes[-1] * beyond)

        return run_everett(everett, drive_v)

    def switching(self, reach_v: float) -> PlayStack:
        """Return the part that creeps the more the wider the play: weights times threshold over reach."""
        return PlayStack(0.0, self.thresholds_v, self.weights_um_per_v * self.thresholds_v / reach_v)


def play_outputs(
    drive_v: np.ndarray, thresholds_v: np.ndarray, rising: Envelope | None = None, falling: Envelope | None = None
) -> np.ndarray:
    """Return the output of each play, shape (n_samples, n_plays), from rest at 0.

    Args:
        drive_v: drive [V], shape (n_samples,).
        thresholds_v: half widths [V], shape (n_plays,).
        rising: increasing envelope by which a play is pushed up; the drive itself where None.
        falling: increasing envelope by which it is pushed down; the drive itself where None.
    """
    up = drive_v if rising is None else rising(drive_v)
    down = drive_v if falling is None else falling(drive_v)
    out = np.zeros((drive_v.size, thresholds_v.size))
    held = np.zeros(thresholds_v.size)
    sweeps = sweeps_of(drive_v)
    for first, last, heading in zip(sweeps.first.tolist(), sweeps.last.tolist(), sweeps.heading.tolist(), strict=True):
        piece = out[first + 1 : last + 1]
        if heading > 0:
            np.subtract(up[first + 1 : last + 1, None], thresholds_v, out=piece)
            np.maximum(piece, held, out=piece)
        else:
            np.add(down[first + 1 : last + 1, None], thresholds_v, out=piece)
            np.minimum(piece, held, out=piece)
        held = piece[-1].copy()
    return out


@dataclass(frozen=True)
class GeneralisedPlays:
    """Plays pushed up along one envelope and down along another (A. Visintin, 1994; M. Al Janaideh, 2011).

    The envelopes are c(u) - w(u) and c(u) + w(u), with the middle c = u (1 + bend_1 u/reach + bend_2 (u/reach)^2) and
    the widening w = |widening| reach ((1 +- u/reach) / 2)^2, which never is negative: plays are wider towards one end.
    Both rise with u for the sizes drawn here.

    Args:
        slope_um_per_v: reversible part [um/V].
        thresholds_v: half widths [V], shape (n_plays,).
        weights_um_per_v: their weights [um/V], shape (n_plays,).
        reach_v: largest voltage of either sign [V].
        bend: (bend_1, bend_2).
        widening: towards the upper end where positive, towards the lower where negative.
    """

    slope_um_per_v: float
    thresholds_v: np.ndarray
    weights_um_per_v: np.ndarray
    reach_v: float
    bend: tuple[float, float]
    widening: float

    def _rising(self, u: np.ndarray) -> np.ndarray:
        return self._middle(u) - self._half_width(u)

    def _falling(self, u: np.ndarray) -> np.ndarray:
        return self._middle(u) + self._half_width(u)

    def _middle(self, u: np.ndarray) -> np.ndarray:
        along = u / self.reach_v
        return u * (1.0 + self.bend[0] * along + self.bend[1] * along**2)

    def _half_width(self, u: np.ndarray) -> np.ndarray:
        along = 0.5 * (1.0 + np.sign(self.widening) * u / self.reach_v)
        return abs(self.widening) * self.reach_v * along**2

    def run(self, drive_v: np.ndarray) -> np.ndarray:
        """Return the response [um] to a drive [V] that starts relaxed at 0; shape (n_samples,)."""
        plays = play_outputs(drive_v, self.thresholds_v, self._rising, self._falling)
        return self.slope_um_per_v * self._middle(drive_v) + plays @ self.weights_um_per_v

    def switching(self, reach_v: float) -> GeneralisedPlays:
        """Return the part that creeps the more the wider the play."""
        weights = self.weights_um_per_v * self.thresholds_v / reach_v
        return replace(self, slope_um_per_v=0.0, weights_um_per_v=weights)


@dataclass(frozen=True)
class RateDependentPlays:
    """Plays whose thresholds widen with the rate of the drive: r (1 + |du/dt| per_v_per_s) (M. Al Janaideh, 2009).

    Args:
        plays: at rest.
        per_v_per_s: widening per rate [s/V].
        step_s: time between the drive's samples [s].
    """

    plays: PlayStack
    per_v_per_s: float
    step_s: float

    def run(self, drive_v: np.ndarray) -> np.ndarray:
        """Return the response [um] to a drive [V] that starts relaxed at 0; shape (n_samples,)."""
        rates = np.abs(np.diff(drive_v, prepend=drive_v[0])) / self.step_s
        widening = 1.0 + self.per_v_per_s * rates
        thresholds_v, weights = self.plays.thresholds_v, self.plays.weights_um_per_v
        out = self.plays.slope_um_per_v * drive_v
        z = np.zeros(thresholds_v.size)
        for k in range(1, drive_v.size):
            r = thresholds_v * widening[k]
            np.minimum(z, drive_v[k] + r, out=z)
            np.maximum(z, drive_v[k] - r, out=z)
            out[k] += weights @ z
        return out

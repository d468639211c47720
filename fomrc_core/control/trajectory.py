"""A motion told beforehand: points in time with position, and velocity and acceleration where they are known.

Between two points the course is linear; cubic where velocities are given, quintic where accelerations are as well, as
ros2_control's joint_trajectory_controller has it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BPoly

from fomrc_core.compute.arrays import Array
from fomrc_core.errors import InputError

MOST_POINTS = 100_000
# A course that begins later than this is on another clock.
_LONGEST_WAIT_S = 3600.0


@dataclass(frozen=True, eq=False)
class TrajectoryPoints:
    """Points of a trajectory, as they were told.

    Args:
        times_s: time of each on the clock of the loop [s], rising, shape (n_points,).
        positions_um: positions [um], shape (n_points,).
        velocities_um_per_s: velocities [um/s], (n_points,); None where they are not told.
        accelerations_um_per_s2: accelerations [um/s^2], (n_points,); None where they are not told.

    Raises:
        InputError: no points or too many, times that do not rise, numbers that are not finite, other lengths.
    """

    times_s: Array
    positions_um: Array
    velocities_um_per_s: Array | None = None
    accelerations_um_per_s2: Array | None = None

    def __post_init__(self) -> None:
        n_points = self.times_s.size
        if not 1 <= n_points <= MOST_POINTS:
            raise InputError("number of points", where="trajectory", value=n_points, allowed=f"1 to {MOST_POINTS}")
        if self.accelerations_um_per_s2 is not None and self.velocities_um_per_s is None:
            raise InputError(
                "accelerations without velocities", where="trajectory", allowed="both, or velocities alone"
            )
        for name, values in self._told():
            if values.size != n_points:
                raise InputError("are not of all points", where=name, value=values.size, allowed=str(n_points))
            if not np.all(np.isfinite(values)):
                k = int(np.argmin(np.isfinite(values)))
                raise InputError(f"of point {k} not finite", where=name, value=float(values[k]), allowed="finite")
        back = np.flatnonzero(np.diff(self.times_s) <= 0.0)
        if back.size:
            k = int(back[0]) + 1
            raise InputError(
                f"point {k} does not come after the one before",
                where="time_from_start",
                value=float(f"{self.times_s[k] - self.times_s[0]:.9g}"),
                allowed=f"more than {self.times_s[k - 1] - self.times_s[0]:.9g} s",
            )

    def _told(self) -> list[tuple[str, Array]]:
        named = [
            ("times", self.times_s),
            ("positions", self.positions_um),
            ("velocities", self.velocities_um_per_s),
            ("accelerations", self.accelerations_um_per_s2),
        ]
        return [(name, values) for name, values in named if values is not None]

    def from_state(self, state: tuple[float, float, float], now_s: float) -> Trajectory:
        """Return the course that leads from where the stage is to be now over all points still to come.

        Args:
            state: position [um], velocity [um/s], acceleration [um/s^2] now.
            now_s: time of the loop's clock [s].

        Raises:
            InputError: all points lie in the past, or the first in another hour.
        """
        if self.times_s[-1] < now_s:
            late_s = float(f"{now_s - self.times_s[-1]:.6g}")
            raise InputError("ends before now", where="trajectory", value=-late_s, allowed="an end of 0 s or later")
        if self.times_s[0] > now_s + _LONGEST_WAIT_S:
            raise InputError(
                "begins too late, is it on another clock?",
                where="trajectory",
                value=float(f"{self.times_s[0] - now_s:.6g}"),
                allowed=f"{_LONGEST_WAIT_S:g} s from now or less",
            )
        ahead = self.times_s > now_s
        rows = [values[ahead] for _, values in self._told()[1:]]
        if not np.any(ahead):
            return Trajectory.at_rest(float(self.positions_um[-1]))
        knots_s = np.concatenate(([now_s], self.times_s[ahead])) - now_s
        values = np.column_stack([np.concatenate(([own], row)) for own, row in zip(state, rows, strict=False)])
        return Trajectory(now_s, BPoly.from_derivatives(knots_s, values.tolist()), float(knots_s[-1]))


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A course over time; at rest before it and behind it.

    Attributes:
        begins_s: time at which it begins [s].
        duration_s: how long it lasts [s].
    """

    begins_s: float
    _course: BPoly
    duration_s: float

    @classmethod
    def at_rest(cls, position_um: float) -> Trajectory:
        """Return the course that has ended at a position [um]."""
        return cls(-np.inf, BPoly([[position_um]], [0.0, 1.0]), 0.0)

    @property
    def end_s(self) -> float:
        """Time at which the last point is reached [s]."""
        return self.begins_s + self.duration_s

    def at(self, times_s: Array) -> Array:
        """Return positions [um] at times [s], shape of the times."""
        return np.asarray(
            self._course(np.clip(np.nan_to_num(times_s - self.begins_s, posinf=0.0), 0.0, self.duration_s))
        )

    def state(self, time_s: float) -> tuple[float, float, float]:
        """Return position [um], velocity [um/s] and acceleration [um/s^2] at a time [s]."""
        if not self.begins_s <= time_s < self.end_s:
            return float(self.at(np.array([time_s]))[0]), 0.0, 0.0
        since_s = time_s - self.begins_s
        return float(self._course(since_s)), float(self._course(since_s, 1)), float(self._course(since_s, 2))

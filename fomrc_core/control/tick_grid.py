"""The loop's time grid: steps of whole periods that keep up with the clock."""

from __future__ import annotations

# More time than this in one step is a clock that was set, not one that ran.
_LONGEST_CATCH_UP_S = 1e7
# Time from grid to clock is the mean of so many ticks: a timer's jitter is gone, a grid that ran ahead is followed.
_REMEMBERS = 64.0


class TickGrid:
    """Turn the times of ticks into steps of whole periods.

    The jitter of a timer, some hundred microseconds, is none of the actuator's and would cost new step
    coefficients every tick; what must be right is the time in the long run. A late tick makes a longer step.

    Args:
        period_s: nominal period [s].
    """

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self._time_s: float | None = None
        self._behind_s = 0.0

    @property
    def time_s(self) -> float:
        """Where on the grid the last tick was [s]; never the same twice."""
        return 0.0 if self._time_s is None else self._time_s

    @property
    def clock_s(self) -> float:
        """What the clock showed at the last tick [s], without the jitter of the ticks."""
        return self.time_s + self._behind_s

    def restart(self) -> None:
        """Forget the last tick; the next one makes one period."""
        self._time_s = None

    def step_s(self, now_s: float) -> float:
        """Return the step that leads to a tick at this time [s], a whole number of periods, 1 or more."""
        if self._time_s is None or not -1.0 < now_s - self._time_s < _LONGEST_CATCH_UP_S:
            self._time_s, self._behind_s = now_s, 0.0
            return self.period_s
        n_periods = max(1, round((now_s - self._time_s) / self.period_s))
        self._time_s += n_periods * self.period_s
        self._behind_s += (now_s - self._time_s - self._behind_s) / _REMEMBERS
        return n_periods * self.period_s

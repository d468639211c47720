"""Which measurements may be believed: of a sensor that answers, moves when the stage does, and does not jump alone."""

from __future__ import annotations

import math
from collections import deque

# So many of its own periods without a measurement: it has been cut.
_STALE_PERIODS = 2.0
# So many equal values while the stage moved by so many times what differs from value to value: it is stuck.
_STUCK_VALUES = 5
_STUCK_MOTION = 5.0
_LEAST_MOTION_UM = 1e-3  # smaller motion than a nanometre tells nothing of a sensor
# A value further from the last than so many mean differences stands apart: of a million of normal noise none does.
_APART = 8.0
# Beside noise, of how far the stage moved meanwhile: what a model may be off that is still worth a correction.
_OF_MOTION = 0.25
# So many that stand apart together are no outliers: something has moved.
_AGREEING = 3
_REMEMBERS = 64.0  # values that the mean difference is of
_LEARNS = 16  # values before anything is called an outlier


class SensorGuard:
    """Judges measurements by what the model expects of them.

    Args:
        period_s: nominal period of the sensor [s], before it is known from the measurements.
    """

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self.problem = "no measurement yet"
        self.n_refused = 0
        self._heard_s = -math.inf
        self._difference_um = 0.0
        self._n_learnt = 0
        self._last_off_um: float | None = None
        self._last_expected_um = 0.0
        self._apart: deque[float] = deque(maxlen=_AGREEING)
        self._value_um = math.nan
        self._n_equal = 0
        self._equal_since_um = 0.0

    def is_stale(self, now_s: float) -> bool:
        """Return whether no measurement that can be believed has come for two periods; ``problem`` says so then."""
        # What stands apart is waited for, whether others agree with it.
        n_periods = _AGREEING + 1.5 if self._apart else _STALE_PERIODS
        if now_s - self._heard_s <= n_periods * self.period_s:
            return False
        if not self.problem:
            self.problem = f"no measurement for {1e3 * (now_s - self._heard_s):.3g} ms"
        return True

    def accepts(self, time_s: float, measured_um: float, expected_um: float) -> bool:
        """Return whether a measurement may be believed; ``problem`` says why not.

        Args:
            time_s: when it was taken [s].
            measured_um: what it says [um].
            expected_um: what the model says, corrections included [um].
        """
        problem = self._judge(measured_um, expected_um)
        if not problem and not time_s > self._heard_s:
            problem = "a measurement came twice, or out of order"
        self.problem = problem
        if problem:
            self.n_refused += 1
            return False
        since_s = time_s - self._heard_s
        if since_s < 10.0 * self.period_s:
            self.period_s += (since_s - self.period_s) / _REMEMBERS
        self._heard_s = time_s
        return True

    def _judge(self, measured_um: float, expected_um: float) -> str:
        if not math.isfinite(measured_um):
            return f"the sensor says {measured_um}"
        if self._is_stuck(measured_um, expected_um):
            return f"the sensor is stuck at {measured_um:.6g} um"
        off_um = measured_um - expected_um
        last_um = self._last_off_um
        if last_um is not None and self._n_learnt >= _LEARNS and self._stands_apart(off_um, last_um, expected_um):
            return f"a measurement of {measured_um:.6g} um is {abs(off_um - last_um):.3g} um from those before"
        if last_um is not None:
            self._n_learnt += 1
            share = 1.0 / min(self._n_learnt, _REMEMBERS)
            # What moved by more than noise does not tell of the noise.
            change_um = abs(off_um - last_um)
            if self._n_learnt <= _LEARNS or change_um <= _APART * self._difference_um:
                self._difference_um += share * (change_um - self._difference_um)
        self._last_off_um, self._last_expected_um = off_um, expected_um
        self._apart.clear()
        return ""

    def _is_stuck(self, measured_um: float, expected_um: float) -> bool:
        if measured_um != self._value_um:
            self._value_um, self._n_equal, self._equal_since_um = measured_um, 1, expected_um
            return False
        self._n_equal += 1
        least_um = max(_STUCK_MOTION * self._difference_um, _LEAST_MOTION_UM)
        return self._n_equal >= _STUCK_VALUES and abs(expected_um - self._equal_since_um) > least_um

    def _stands_apart(self, off_um: float, last_um: float, expected_um: float) -> bool:
        moved_um = abs(expected_um - self._last_expected_um)
        reach_um = max(_APART * self._difference_um, _LEAST_MOTION_UM) + _OF_MOTION * moved_um
        if abs(off_um - last_um) <= reach_um:
            return False
        if self._apart and abs(off_um - self._apart[-1]) > reach_um:
            self._apart.clear()
        self._apart.append(off_um)
        return len(self._apart) < _AGREEING

"""An integral correction beside the feedforward: the model does the work, the sensor what it lacks.

    dc/dt = 2 pi f_b (y_m - y),          y measured, y_m what the model says without the correction c

c is added to where the stage is to go, before hysteresis and creep are undone, so that it means the same everywhere.
y_m is where the stage was driven to, not where it was wanted: voltages that were limited wind nothing up by that, and
c does not grow further into a limit. Without a sensor that can be believed c stays as it is: no jump, neither way.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque

from fomrc_core.control.model_error import ModelError
from fomrc_core.control.sensor_guard import SensorGuard

_N_REFERENCES = 64
_LONGEST_STEP_PERIODS = 3.0  # a measurement stands for no longer than this


class Feedback:
    """Adds what a sensor says is missing.

    Args:
        bandwidth_hz: of the correction [Hz].
        period_s: period of the loop [s].
        correction_um: what was added so far [um].
    """

    def __init__(self, bandwidth_hz: float, period_s: float, correction_um: float = 0.0) -> None:
        self.bandwidth_hz = bandwidth_hz
        self.correction_um = correction_um
        self.guard = SensorGuard(period_s)
        self.error = ModelError()
        self.is_closed = False
        self.n_opened = 0
        self._taken: deque[tuple[float, float]] = deque(maxlen=_N_REFERENCES)
        self._times_s: deque[float] = deque(maxlen=_N_REFERENCES)
        self._references_um: deque[float] = deque(maxlen=_N_REFERENCES)
        self._measured_s = -math.inf
        self.displacement_um = math.nan

    def take(self, time_s: float, measured_um: float) -> None:
        """Take a measurement [um] of this time [s]; NaN where it was none."""
        self._taken.append((time_s, measured_um))

    def note_reference(self, time_s: float, reference_um: float) -> None:
        """Note what the model says of the displacement without the correction [um], from this time on [s]."""
        self._times_s.append(time_s)
        self._references_um.append(reference_um)

    def step(self, now_s: float, limited_by_v: float, *, is_followed: bool) -> list[tuple[float, float]]:
        """Move the correction on by all measurements since; return times [s] and displacements [um] that were believed.

        Args:
            now_s: time of the loop's clock [s].
            limited_by_v: by how much the last voltage fell short of what was asked for [V].
            is_followed: whether a target is followed; else nothing is added to.
        """
        believed = []
        while self._taken:
            time_s, measured_um = self._taken.popleft()
            reference_um = self._reference_um(time_s)
            if reference_um is None:
                continue
            if not self.guard.accepts(time_s, measured_um, reference_um + self.correction_um):
                continue
            believed.append((time_s, measured_um))
            self.displacement_um = measured_um
            step_s = min(time_s - self._measured_s, _LONGEST_STEP_PERIODS * self.guard.period_s)
            self._measured_s = time_s
            lacking_um = reference_um - measured_um
            if is_followed and lacking_um * limited_by_v <= 0.0:
                self.correction_um += 2.0 * math.pi * self.bandwidth_hz * step_s * lacking_um
        was_closed, self.is_closed = self.is_closed, not self.guard.is_stale(now_s)
        if was_closed and not self.is_closed:
            self.n_opened += 1
        return believed

    def _reference_um(self, time_s: float) -> float | None:
        k = bisect_right(self._times_s, time_s) - 1
        return None if k < 0 else self._references_um[k]

"""Whether the stage has come to its target and stays: predicted by the model, or measured where there is a sensor."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from fomrc_core.compute.arrays import Array

# Of the future: what rings longer than this within the tolerance's reach is not called arrived before.
HORIZON_S = 0.5
# A sensor that has shown so many values near the target in a row, over at least one swing, has shown it to be there.
_LEAST_MEASURED = 5
_LEAST_MEASURED_S = 5e-3


class Arrival:
    """Says when the displacement is within a tolerance of the target and stays there, were the target held.

    Args:
        tolerance_um: how near counts [um].
    """

    def __init__(self, tolerance_um: float) -> None:
        self.tolerance_um = tolerance_um
        self.has_arrived = False
        self._target_um = math.nan
        self._due_s: float | None = None
        self._near: deque[float] = deque()

    @property
    def due_s(self) -> float | None:
        """When it arrives by the model, on the clock of the loop [s]; None where that is not known."""
        return self._due_s

    def is_new(self, target_um: float) -> bool:
        """Take the target in force [um]; return whether it is another one, to which nothing has arrived."""
        if target_um == self._target_um:
            return False
        self._target_um, self._due_s, self.has_arrived = target_um, None, False
        self._near.clear()
        return True

    @property
    def needs_prediction(self) -> bool:
        """Whether it is not known when the stage arrives."""
        return self._due_s is None

    def forget_prediction(self) -> None:
        """The voltage is kept from its plan: what was predicted does not come true."""
        self._due_s, self.has_arrived = None, False

    def predict(self, now_s: float, times_s: Array, displacement_um: Array) -> None:
        """Take what the model says of the future while the target is held.

        Args:
            now_s: time of the loop's clock [s].
            times_s: times from now on [s], from 0, shape (n,).
            displacement_um: displacement then [um], shape (n,).
        """
        away = np.flatnonzero(np.abs(displacement_um - self._target_um) > self.tolerance_um)
        if away.size == 0:
            self._due_s = now_s
        elif away[-1] + 1 < times_s.size:
            self._due_s = now_s + float(times_s[away[-1] + 1])

    def judge_predicted(self, now_s: float) -> bool:
        """Return whether it has arrived by the model."""
        self.has_arrived = self._due_s is not None and now_s >= self._due_s - 1e-9
        return self.has_arrived

    def judge_measured(self, time_s: float, displacement_um: float) -> bool:
        """Return whether it has arrived, a measurement [um] of this time [s] taken into account; once it has, it has.

        A load that pushes the stage away again is the sensor's to mend, and takes the arrival back.
        """
        if not abs(displacement_um - self._target_um) <= self.tolerance_um:
            self._near.clear()
            self.has_arrived = False
            return False
        self._near.append(time_s)
        if len(self._near) > _LEAST_MEASURED and self._near[-1] - self._near[1] >= _LEAST_MEASURED_S:
            self._near.popleft()
        is_long = self._near[-1] - self._near[0] >= _LEAST_MEASURED_S
        self.has_arrived = self.has_arrived or (len(self._near) >= _LEAST_MEASURED and is_long)
        return self.has_arrived

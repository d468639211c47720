"""The memory of hysteresis: the turning points of its input that later ones have not wiped out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_DEFAULT_CAPACITY = 2048


class TurningPoints:
    """The reduced history of an input that started at zero, relaxed.

    A play or stop operator of any threshold ends in the same state whether it sees the whole history or only
    these points (Madelung's rules: a larger loop wipes out a smaller one inside it). So they carry the memory
    of one model over to another.

    Args:
        points: from ``to_list`` of a former one.
        capacity: most points kept; beyond it the smallest loop is forgotten.
    """

    def __init__(self, points: Sequence[float] = (0.0,), capacity: int = _DEFAULT_CAPACITY) -> None:
        self._points = [float(point) for point in points] or [0.0]
        self._capacity = capacity

    def move(self, value: float) -> None:
        """Add the next value of the input."""
        points = self._points
        if len(points) == 1:
            if value != points[0]:
                points.append(value)
            return
        end, before = points[-1], points[-2]
        if (value - end) * (end - before) >= 0.0:
            points[-1] = value
        else:
            points.append(value)
        while len(points) >= 4 and abs(points[-1] - points[-2]) >= abs(points[-2] - points[-3]):
            del points[-3:-1]
        # Back beyond the largest excursion from the relaxed state, to either side: nothing older is left.
        if len(points) == 3 and abs(points[2]) >= abs(points[1]):
            del points[1]
        if len(points) > self._capacity:
            self._forget_smallest()

    def _forget_smallest(self) -> None:
        sizes = np.abs(np.diff(np.array(self._points[1:-1])))
        k = int(np.argmin(sizes)) + 1
        del self._points[k : k + 2]

    def plays(self, thresholds: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the states of plays with these thresholds, shape of ``thresholds``."""
        plays = np.zeros(thresholds.size)
        for point in self._points:
            plays = np.minimum(np.maximum(plays, point - thresholds), point + thresholds)
        return plays

    def copy(self) -> TurningPoints:
        """Return an independent copy."""
        return TurningPoints(self._points, self._capacity)

    def to_list(self) -> list[float]:
        """Return the points, oldest first."""
        return list(self._points)

    def __len__(self) -> int:
        return len(self._points)

"""What a sensor had to add to the feedforward: the model's error, as it runs."""

from __future__ import annotations

import math

# A scan of some seconds is seen whole, and what has passed is forgotten.
_REMEMBERS_S = 10.0
_LEAST_MOTION = 1e-6  # of the displacement's size: less tells no slope


class ModelError:
    """Running moments of the correction and of the displacement, the older ones fading."""

    def __init__(self) -> None:
        self._weight = 0.0
        self._means = [0.0, 0.0, 0.0, 0.0, 0.0]  # of c, c^2, x, x^2, c x

    def note(self, added_um: float, desired_um: float, step_s: float) -> None:
        """Note what was added [um] where the stage was to be [um], for a time [s]."""
        keep = math.exp(-step_s / _REMEMBERS_S)
        self._weight = keep * self._weight + 1.0 - keep
        share = (1.0 - keep) / self._weight
        values = (added_um, added_um**2, desired_um, desired_um**2, added_um * desired_um)
        self._means = [mean + share * (value - mean) for mean, value in zip(self._means, values, strict=True)]

    @property
    def rms_um(self) -> float:
        """Root mean square of what was added [um]."""
        return math.sqrt(max(self._means[1], 0.0))

    @property
    def slope(self) -> float:
        """How it rises with the displacement [um/um]; nan where the stage does not move."""
        mean, _, moved, moved_squared, product = self._means
        variance = moved_squared - moved**2
        if not variance > _LEAST_MOTION**2 * max(moved_squared, 1e-300):
            return math.nan
        return (product - mean * moved) / variance

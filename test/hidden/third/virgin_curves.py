"""Closed curves of the first loading, from which a whole hysteresis follows by Masing's rule."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from test.hidden.third.arrays import Array

# What bends, over z = |v| / knee, less what is linear: value and slope. All are convex with slope 0 at zero, as domains
# only add to a small field's response.
_BENDS: Mapping[str, tuple[Callable[[Array, float], Array], Callable[[Array, float], Array]]] = {
    "tanh": (lambda z, p: z - np.tanh(z), lambda z, p: np.tanh(z) ** 2),
    "power": (lambda z, p: z**p / p, lambda z, p: z ** (p - 1.0)),
    "rational": (lambda z, p: z**2 / (1.0 + z), lambda z, p: z * (2.0 + z) / (1.0 + z) ** 2),
    "exponential": (lambda z, p: z - 1.0 + np.exp(-z), lambda z, p: 1.0 - np.exp(-z)),
}
FAMILIES = tuple(_BENDS)


@dataclass(frozen=True)
class VirginCurve:
    """Displacement over voltage of a first loading from the relaxed state, odd in the voltage.

    Args:
        family: one of FAMILIES.
        slope_um_per_v: at zero volts, that of what is reversible.
        bend_um_per_v: scale of the slope that domains add.
        knee_v: voltage about which they do.
        exponent: of the family "power", above 1.
    """

    family: str
    slope_um_per_v: float
    bend_um_per_v: float
    knee_v: float
    exponent: float = 2.0

    def __call__(self, distance_v: Array) -> Array:
        """Return the displacement at a distance from the relaxed state, both of one sign [um]."""
        bent = _BENDS[self.family][0](np.abs(distance_v) / self.knee_v, self.exponent)
        return self.slope_um_per_v * distance_v + np.sign(distance_v) * self.bend_um_per_v * self.knee_v * bent

    def slope(self, distance_v: Array) -> Array:
        """Return the slope at a distance from the relaxed state [um/V]."""
        bent = _BENDS[self.family][1](np.abs(distance_v) / self.knee_v, self.exponent)
        return self.slope_um_per_v + self.bend_um_per_v * bent

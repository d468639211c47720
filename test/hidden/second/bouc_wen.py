"""Bouc-Wen hysteresis, x = d u - h z with dz/du = 1 - |z|^n (gamma + beta sgn(z du)) (R. Bouc; Y.-K. Wen, 1976).

z depends on the way of u alone, not on time: along a sweep it is one curve Z(s), entered where it stands. Falling
is rising turned round.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from test.hidden.second.reversals import sweeps_of

_N_KNOTS = 8001
_NEARNESS = 1e-10  # to saturation, over which the curve is taken as flat


@dataclass(frozen=True)
class BoucWen:
    """Bouc-Wen hysteresis with z in units of the drive over ``scale_v``.

    Args:
        slope_um_per_v: d [um/V].
        share_um: h, taken off for each unit of z [um].
        scale_v: drive [V] that is one unit of u in the equation.
        exponent: n >= 1.
        beta, gamma: of the equation, beta > 0, beta + gamma > 0, |gamma| <= beta.
    """

    slope_um_per_v: float
    share_um: float
    scale_v: float
    exponent: float
    beta: float
    gamma: float

    def run(self, drive_v: np.ndarray) -> np.ndarray:
        """Return the response [um] to a drive [V] that starts relaxed at 0; shape (n_samples,)."""
        return self.slope_um_per_v * drive_v - self.share_um * self.internal(drive_v / self.scale_v)

    def internal(self, u: np.ndarray) -> np.ndarray:
        """Return z, shape of u, from z = 0."""
        curve, length = self._rising
        along, side = np.zeros(u.size), np.ones(u.size)
        z = 0.0
        sweeps = sweeps_of(u)
        entry = self._place(0.0)
        along[:] = entry
        for first, last, heading in zip(
            sweeps.first.tolist(), sweeps.last.tolist(), sweeps.heading.tolist(), strict=True
        ):
            entry = self._place(heading * z)
            along[first + 1 : last + 1] = entry + heading * (u[first + 1 : last + 1] - u[first])
            side[first + 1 : last + 1] = heading
            z = heading * float(curve(min(along[last], length)))
        return side * curve(np.minimum(along, length))

    def switching(self, reach_v: float) -> BoucWen:
        """Return the part that creeps the more: all that is not reversible."""
        return BoucWen(0.0, self.share_um, self.scale_v, self.exponent, self.beta, self.gamma)

    def _slope(self, z: np.ndarray | float) -> np.ndarray | float:
        return 1.0 - np.abs(z) ** self.exponent * (self.gamma + self.beta * np.sign(z))

    @cached_property
    def _rising(self) -> tuple[CubicHermiteSpline, float]:
        """The curve of a rising sweep from negative saturation, and where it has ended."""
        largest = (self.beta + self.gamma) ** (-1.0 / self.exponent)

        def arrived(_: float, z: np.ndarray) -> float:
            return float(z[0] - largest * (1.0 - _NEARNESS))

        arrived.terminal = True  # type: ignore[attr-defined]
        way = solve_ivp(
            lambda _, z: self._slope(z),
            (0.0, 1e4 * largest),
            [-largest],
            method="DOP853",
            dense_output=True,
            events=arrived,
            rtol=1e-12,
            atol=1e-14 * largest,
        )
        s = np.linspace(0.0, way.t[-1], _N_KNOTS)
        z = way.sol(s)[0]
        return CubicHermiteSpline(s, z, self._slope(z)), float(way.t[-1])

    def _place(self, z: float) -> float:
        """Return where on the rising curve it is at z."""
        curve, length = self._rising
        knots, values = curve.x, curve(curve.x)
        s = float(np.interp(z, values, knots))
        for _ in range(4):
            slope = float(self._slope(z))
            if slope < 1e-6:
                break  # saturated: the curve is flat and any place near it as good
            s = min(max(s + (z - float(curve(s))) / slope, 0.0), length)
        return s

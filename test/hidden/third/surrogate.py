"""A plain base, re-fitted by least squares: what it leaves of an effect is how visible the effect is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from test.hidden.third.arrays import Array
from test.hidden.third.creep_kernel import late, power_law, time_constants
from test.hidden.third.frame import Frame

# Creep orders that are tried, over the bench's own.
_ORDER_FACTORS = (0.25, 0.5, 0.75, 1.0, 1.35, 2.0, 4.0)
# Below this share of the largest, an eigenvalue of the normal equations is rounding.
_LEAST_VALUE = 1e-12


def _products(first: Array, second: Array) -> Array:
    return np.asarray(np.einsum("kn,jn->kj", first, second))


def _plays(voltage_v: Array, thresholds_v: Array) -> Array:
    """Return the positions of plays of several thresholds, shape (n_plays, n)."""
    position, out = np.zeros_like(thresholds_v), np.empty((voltage_v.size, thresholds_v.size))
    for k, value in enumerate(voltage_v.tolist()):
        position = np.minimum(np.maximum(position, value - thresholds_v), value + thresholds_v)
        out[k] = position
    return out.T


@dataclass(frozen=True)
class Fit:
    """A base that was fitted: which creep, and the weights of the plays."""

    order: int
    weights: Array


class Base:
    """Plays behind a creep of one order, for one record.

    Args:
        frame: of the record.
        n_plays: how many, evenly over the root of the range: little is lost between 25.
    """

    def __init__(self, frame: Frame, n_plays: int = 25) -> None:
        bench, dt_s = frame.bench, frame.dt_s
        thresholds_v = 0.97 * bench.reach_v * (np.arange(n_plays) / n_plays) ** 1.5
        plays = _plays(frame.recorded_v, thresholds_v)
        constants_s = time_constants(dt_s, frame.duration_s)
        laws = [
            power_law(f * bench.creep_order, bench.creep_reference_s, dt_s, frame.duration_s) for f in _ORDER_FACTORS
        ]
        columns = [law.at_once * plays for law in laws]
        for j, constant_s in enumerate(constants_s):
            followed = late(plays, dt_s, float(constant_s))
            for column, law in zip(columns, laws, strict=True):
                column += law.weights[j] * followed
        self._columns = columns
        # Normal equations, of columns of size one: small enough that no library starts threads for them.
        sizes = [np.sqrt(np.einsum("kn,kn->k", c, c)) for c in columns]
        self._sizes = [np.where(size > 0.0, size, 1.0) for size in sizes]
        self._solved = [
            np.linalg.eigh(_products(c, c) / np.outer(s, s)) for c, s in zip(columns, self._sizes, strict=True)
        ]

    def fit(self, reading_um: Array) -> tuple[Fit, float]:
        """Return the best base for a reading, and the rms it leaves [um]."""
        found: list[tuple[float, Fit]] = []
        for order, (values, vectors) in enumerate(self._solved):
            columns, sizes = self._columns[order], self._sizes[order]
            kept = values > _LEAST_VALUE * values[-1]
            projected = vectors[:, kept].T @ (_products(columns, reading_um[None])[:, 0] / sizes)
            fit = Fit(order, vectors[:, kept] @ (projected / values[kept]) / sizes)
            found.append((self.left_by(fit, reading_um), fit))
        best = min(found, key=lambda pair: pair[0])
        return best[1], best[0]

    def left_by(self, fit: Fit, reading_um: Array) -> float:
        """Return the rms that a base fitted elsewhere leaves of a reading [um]."""
        return float(np.sqrt(np.mean((reading_um - np.einsum("k,kn->n", fit.weights, self._columns[fit.order])) ** 2)))

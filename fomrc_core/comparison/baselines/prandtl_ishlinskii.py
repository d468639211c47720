"""Prandtl-Ishlinskii: a weighted sum of play operators of the voltage; classical and modified.

Classical: Kuhnen and Janocha 2000 (references 7, 8); exact inverse: Krejci and Kuhnen 2001 (reference 6).
Modified: a memory-free superposition of one-sided dead zones behind it, for loops without point symmetry;
Kuhnen, Modeling, identification and compensation of complex hysteretic nonlinearities: a modified
Prandtl-Ishlinskii approach, European Journal of Control 9 (2003) 407-418. Fitted as there on the
generalised error ``H[u] - S^-1(x)``, which is linear in the weights of H and in those of the inverse of S:
convex.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fomrc_core.comparison.baselines.cascade_rival import (
    CreepKind,
    HysteresisFamily,
    HysteresisOperator,
    fitted_creep,
    lagged_columns,
)
from fomrc_core.comparison.baselines.creep_cascade import NO_CREEP, CreepCascade
from fomrc_core.comparison.baselines.rival import FittedRival, Rival, TrainingRecord
from fomrc_core.compute.compiled import compiled
from fomrc_core.compute.least_squares import non_negative_fit
from fomrc_core.errors import ParameterError

Array = NDArray[np.float64]

_CREEP_WORDS = {"none": "", "logarithmic": " + log creep", "linear": " + LTI creep"}


@compiled
def plays(values: Array, thresholds: Array) -> Array:
    """Return the play operators of the values, relaxed at first, shape (n_samples, n_thresholds)."""
    out = np.empty((values.size, thresholds.size))
    state = np.zeros(thresholds.size)
    for k in range(values.size):
        state = np.minimum(np.maximum(state, values[k] - thresholds), values[k] + thresholds)
        out[k] = state
    return out


@dataclass(frozen=True, eq=False)
class PlaySum(HysteresisOperator):
    """A weighted sum of plays.

    Args:
        thresholds: half-widths [input], ascending, the first 0, shape (n,).
        weights: [output/input], shape (n,), >= 0 for a forward operator.
    """

    thresholds: Array
    weights: Array

    @property
    def n_parameters(self) -> int:
        """Number of weights that are not zero."""
        return int(np.count_nonzero(self.weights))

    def forward(self, voltage_v: Array) -> Array:
        """Return the weighted sum of plays, shape (n_samples,)."""
        total: Array = plays(np.ascontiguousarray(voltage_v), self.thresholds) @ self.weights
        return total

    def inverted(self) -> PlaySum:
        """Return the inverse operator, again a sum of plays (reference 6); needs a first weight > 0."""
        if not self.weights[0] > 0.0:
            raise ParameterError("first weight is zero, no inverse", where="PlaySum", allowed="weights[0] > 0")
        sums = np.cumsum(self.weights)
        weights = np.append(1.0 / sums[0], -self.weights[1:] / (sums[1:] * sums[:-1]))
        rises = sums[:-1] * np.diff(self.thresholds)
        return PlaySum(np.append(0.0, np.cumsum(rises)), weights)

    def inverse(self, desired_um: Array) -> Array:
        """Return the voltage [V], shape (n_samples,)."""
        return self.inverted().forward(desired_um)


@dataclass(frozen=True)
class PrandtlIshlinskii(HysteresisFamily):
    """The classical operator.

    Args:
        n_thresholds: number of plays, the one without width included.
        thresholds: half-widths [V]; set by ``scaled_to``.
    """

    n_thresholds: int = 16
    thresholds: tuple[float, ...] = ()
    name: str = field(default="Prandtl-Ishlinskii", init=False)
    publication: str = field(default="Kuhnen and Janocha 2000; Krejci and Kuhnen 2001", init=False)

    def scaled_to(self, records: Sequence[TrainingRecord]) -> PrandtlIshlinskii:
        """Return the family with thresholds from 0 to the largest voltage of the records."""
        largest = max(float(np.abs(r.voltage_v).max()) for r in records)
        return PrandtlIshlinskii(self.n_thresholds, tuple(largest * np.arange(self.n_thresholds) / self.n_thresholds))

    def columns(self, voltage_v: Array) -> Array:
        """Return the plays, shape (n_samples, n_thresholds)."""
        return plays(np.ascontiguousarray(voltage_v), np.array(self.thresholds))

    def operator(self, weights: Array) -> PlaySum:
        """Return the sum of plays with these weights."""
        return PlaySum(np.array(self.thresholds), weights)


@dataclass(frozen=True, eq=False)
class FittedModified(FittedRival):
    """Plays, creep, and a monotone piecewise linear function behind them.

    Attributes:
        play_sum: H.
        creep: behind H.
        output_um: displacements at the knots of S^-1 [um], ascending, shape (n,).
        inner: values of S^-1 at the knots, ascending, shape (n,).
    """

    play_sum: PlaySum
    creep: CreepCascade
    output_um: Array
    inner: Array

    @property
    def n_parameters(self) -> int:
        """Weights of the plays, gains of the creep and slopes of S."""
        return self.play_sum.n_parameters + self.creep.n_parameters + self.inner.size - 2

    def simulate(self, steps_s: Array, voltage_v: Array) -> Array:
        """Return the displacement [um], shape (n_samples,)."""
        return _stretched(self.creep.apply(steps_s, self.play_sum.forward(voltage_v)), self.inner, self.output_um)

    def invert(self, steps_s: Array, desired_um: Array) -> Array:
        """Return the drive [V], shape (n_samples,)."""
        inner = _stretched(desired_um, self.output_um, self.inner)
        return self.play_sum.inverse(self.creep.undo(steps_s, inner))


@dataclass(frozen=True)
class ModifiedPrandtlIshlinskii(Rival):
    """The modified operator with one kind of creep between plays and dead zones (Kuhnen 2005).

    Args:
        n_thresholds: number of plays.
        n_segments: number of straight pieces of S, odd: the middle one has slope 1.
        creep_kind: none, logarithmic or linear.
    """

    n_thresholds: int = 16
    n_segments: int = 7
    creep_kind: CreepKind = "none"
    publication: str = field(default="Kuhnen 2003; with creep Kuhnen 2005", init=False)

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name with the kind of creep."""
        return "modified Prandtl-Ishlinskii" + _CREEP_WORDS[self.creep_kind]

    def fit(self, records: Sequence[TrainingRecord]) -> FittedModified:
        """Return the rival fitted on the generalised error, weights and creep gains by turns."""
        family = PrandtlIshlinskii(self.n_thresholds).scaled_to(records)
        columns = [family.columns(r.voltage_v) for r in records]
        centres = [r.displacement_um - r.displacement_um[r.is_scored].mean() for r in records]
        low = min(float(c[r.is_scored].min()) for r, c in zip(records, centres, strict=True))
        high = max(float(c[r.is_scored].max()) for r, c in zip(records, centres, strict=True))
        knots = np.linspace(low, high, self.n_segments + 1)
        middle = self.n_segments // 2
        pieces = [_pieces(c, knots) for c in centres]
        others = [i for i in range(self.n_segments) if i != middle]
        creep: CreepCascade = NO_CREEP
        for _ in range(1 if self.creep_kind == "none" else 6):
            crept = [creep.apply(r.steps_s, c) for r, c in zip(records, columns, strict=True)]
            basis = [r.centred(np.hstack([h, -p[:, others]])) for r, h, p in zip(records, crept, pieces, strict=True)]
            targets = [r.centred(p[:, middle]) for r, p in zip(records, pieces, strict=True)]
            found = non_negative_fit(basis, targets)
            weights = found[: self.n_thresholds]
            slopes = np.insert(found[self.n_thresholds :], middle, 1.0)
            if self.creep_kind != "none":
                wanted = [r.centred(p @ slopes) for r, p in zip(records, pieces, strict=True)]
                moved = [(c @ weights)[:, None] for c in columns]
                parts = [
                    r.centred(np.hstack([h, *lagged_columns(self.creep_kind, r, h)]))
                    for r, h in zip(records, moved, strict=True)
                ]
                creep = fitted_creep(self.creep_kind, parts, wanted)
        slopes = np.maximum(slopes, 0.05)  # S must stay invertible
        inner = np.concatenate([[0.0], np.cumsum(slopes * np.diff(knots))])
        # The constant between H and S^-1, which centring took out of the fit.
        operator = family.operator(weights)
        shift = np.mean(
            [
                np.mean((creep.apply(r.steps_s, c @ weights) - _stretched(x, knots, inner))[r.is_scored])
                for r, c, x in zip(records, columns, centres, strict=True)
            ]
        )
        return FittedModified(operator, creep, knots, inner + shift)


def _pieces(values: Array, knots: Array) -> Array:
    """Return how far the values go along each piece between the knots, the outer pieces without end."""
    lower = np.append(-np.inf, knots[1:-1])
    upper = np.append(knots[1:-1], np.inf)
    start = np.append(knots[1], knots[1:-1])  # any fixed point of each piece: only differences matter
    clipped = np.clip(values[:, None], lower, upper)
    pieces: Array = clipped - start
    return pieces


def _stretched(values: Array, knots: Array, images: Array) -> Array:
    """Return the piecewise linear function through (knots, images), its end pieces going on."""
    inside = np.interp(values, knots, images)
    first = (images[1] - images[0]) / (knots[1] - knots[0])
    last = (images[-1] - images[-2]) / (knots[-1] - knots[-2])
    below = np.minimum(values - knots[0], 0.0) * first
    above = np.maximum(values - knots[-1], 0.0) * last
    result: Array = inside + below + above
    return result

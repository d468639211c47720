"""Readings that are late without having slipped: by a clock that drifts, or behind whatever is slow or rings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array, Mask

_JUMP = 2.0  # times the change to either side: what changes so between two readings was not followed by them


@dataclass(frozen=True, eq=False)
class Lags:
    """What lags make of the readings of a record.

    Attributes:
        late: by how much each reading is late [samples], shape (n_samples,).
        slow_um: what lags with the acceleration and its change add [um], shape (n_samples,).
    """

    late: Array
    slow_um: Array

    @classmethod
    def none(cls, n_samples: int) -> Lags:
        """Return that nothing lags."""
        return cls(np.zeros(n_samples), np.zeros(n_samples))

    def beside(self, others: Lags) -> Lags:
        """Return both together, to first order."""
        return Lags(self.late + others.late, self.slow_um + others.slow_um)

    def taken_from(self, displacement_um: Array, valid: Mask) -> Array:
        """Return the readings where they belong [um], shape (n_samples,).

        Between two readings they lie on a line, but where the motion jumps: nobody read what was between, and a reading
        is from before the jump or from behind it.

        Args:
            displacement_um: readings [um], shape (n_samples,).
            valid: readings that count, shape (n_samples,).
        """
        known_um = np.interp(np.arange(displacement_um.size), np.flatnonzero(valid), displacement_um[valid])
        last = displacement_um.size - 1
        wanted = np.clip(np.arange(displacement_um.size) + self.late, 0.0, float(last))
        change_um = np.abs(np.diff(known_um, prepend=known_um[:1], append=known_um[-1:]))  # to the reading before
        first = np.minimum(wanted.astype(np.int64), last)
        beside_um = np.maximum(change_um[first], change_um[np.minimum(first + 2, last + 1)])
        jumps = change_um[first + 1] > _JUMP * beside_um
        nearest_um = known_um[np.rint(wanted).astype(np.int64)]
        moved_um = np.where(jumps, nearest_um, np.interp(wanted, np.arange(known_um.size), known_um))
        return np.asarray(moved_um - self.slow_um)


def find_lags(displacement_um: Array, predicted_um: Array, valid: Mask) -> Lags:
    """Return what lags explain of the readings, to first order in what a model leaves of them.

    Readings may be late by a parabola of time, as with a clock that drifts, and lag with the acceleration and its
    change, as behind whatever is slow or rings. Asked again of the readings without them, it finds what is left.

    Args:
        displacement_um: readings [um], shape (n_samples,).
        predicted_um: what a model says of every sample [um], shape (n_samples,).
        valid: readings that count, shape (n_samples,).
    """
    time, rate_um = np.linspace(-1.0, 1.0, predicted_um.size), np.gradient(predicted_um)
    bent_um = np.gradient(rate_um)
    late_um = np.column_stack((rate_um, time * rate_um, time**2 * rate_um))
    slow_um = np.column_stack((bent_um, np.gradient(bent_um)))
    beside_um = np.column_stack((np.ones(predicted_um.size), predicted_um - np.mean(predicted_um)))
    columns = np.hstack((late_um, slow_um, beside_um))
    scale = np.linalg.norm(columns[valid], axis=0)
    scale[scale == 0.0] = np.inf
    weights = np.linalg.lstsq(columns[valid] / scale, (displacement_um - predicted_um)[valid], rcond=None)[0] / scale
    late = -(weights[0] + weights[1] * time + weights[2] * time**2)
    return Lags(late, np.asarray(slow_um @ weights[3:5]))

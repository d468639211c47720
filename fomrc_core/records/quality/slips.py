"""Samples that a reader lost or kept twice without a trace in the stamps: from there on readings are early, or late.

Where readings are early by whole samples, what a model leaves of them is the motion of so many samples:

    residual[k] = predicted[k + n_k] - predicted[k] + what it would leave,   n_k = sum_i n_i 1[k >= k_i],   n_i = +-1

An offset of the whole record, a constant delay and a gain are a model's to take up, and are taken out first. What is
left is searched for one slip after another, each moved to where it explains most beside the others. A clock that drifts
and a stage that lags are no slips: they move readings by all parts of a sample, and ``find_lags`` says what
they would leave.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.records.noise import autocorrelation_inflation
from fomrc_core.records.quality.examination import Examined, masked_recording
from fomrc_core.records.quality.faults import DataFault, DataQuality, FaultKind
from fomrc_core.records.quality.levels import levels_of
from fomrc_core.records.recording import Recording

_MOST = 12  # slips of a record: where more go wrong nobody knows what the rest is worth
_LEAST_GAIN = 2.0  # times the logarithm of the number of places and signs, in chi square
_LEAST_SHARE = 0.03  # of what is left: less may be the model's
_ABOUT = 3  # readings to either side that are left out: the place of a slip is known no better
_AHEAD = 2  # slips looked ahead: where all is jumps one alone undoes no more than it does
_N_LEVEL_ROUNDS = 3  # of levels beside the rest, and the rest beside levels
_N_ROUNDS = 4  # of moving each slip beside the others
_LEAST_POWER = 1e-3  # of the motion: a slip before all of it is a delay, one after it has no place


@dataclass(frozen=True)
class Slip:
    """Readings that are early (lost samples) or late (doubled ones) from one on.

    Attributes:
        sample: the first reading that is not in its place.
        n_lost: samples lost there; negative for doubled ones.
    """

    sample: int
    n_lost: int


def find_slips(
    displacement_um: Array, predicted_um: Array, valid: Mask, *, beside_delay: bool = True, beside_levels: bool = False
) -> tuple[Slip, ...]:
    """Return where readings slipped by whole samples, in order; none where nothing says so surely.

    Args:
        displacement_um: readings [um], shape (n_samples,).
        predicted_um: what a model says of every sample [um], shape (n_samples,).
        valid: readings that count, shape (n_samples,).
        beside_delay: whether all readings may be early or late by as much as one another.
        beside_levels: whether readings may stand higher or lower from some moments on, as under a load.
    """
    fit = _Fit.of(displacement_um - predicted_um, predicted_um, valid, beside_delay, beside_levels)
    units: list[tuple[int, int]] = []
    least = _LEAST_GAIN * float(np.log(2.0 * predicted_um.size))
    left = float(np.sum(fit.left(units) ** 2))
    more = units
    while len(more) < min(len(units) + _AHEAD, _MOST) and left > 0.0:
        more = fit.settled([*more, fit.best(more)])
        rest = fit.left(more)
        after, n_more = float(np.sum(rest**2)), len(more) - len(units)
        spread = after / np.count_nonzero(valid) * autocorrelation_inflation(rest[valid])
        if after <= (1.0 - _LEAST_SHARE) ** n_more * left and left - after >= n_more * least * spread:
            units, left = more, after
    total = Counter[int]()
    for sample, sign in units:
        total[sample] += sign
    return tuple(Slip(sample, n) for sample, n in sorted(total.items()) if n != 0)


def without_slips(recording: Recording, slips: Sequence[Slip]) -> Examined:
    """Return the record with its readings where they belong, those about a slip left out, and what was wrong.

    Args:
        recording: with displacement.
        slips: of ``find_slips``.

    Raises:
        RecordingError: more than a tenth of the readings do not count.
    """
    x, valid = recording.measured_um, recording.valid_samples
    for slip in sorted(slips, key=lambda s: s.sample, reverse=True):
        k, n = slip.sample, abs(slip.n_lost)
        if slip.n_lost > 0:
            x = np.concatenate((x[:k], np.full(n, x[k]), x[k:]))[: x.size]
            valid = np.concatenate((valid[:k], np.zeros(n, dtype=np.bool_), valid[k:]))[: x.size]
        else:
            x = np.concatenate((x[:k], x[k + n :], np.full(n, x[-1])))
            valid = np.concatenate((valid[:k], valid[k + n :], np.zeros(n, dtype=np.bool_)))
        valid[max(k - _ABOUT, 0) : k + max(slip.n_lost, 0) + _ABOUT] = False
    faults = []
    for kind, sign in ((FaultKind.LOST, 1), (FaultKind.DOUBLED, -1)):
        at = np.array([s.sample for s in slips for _ in range(max(sign * s.n_lost, 0))], dtype=np.int64)
        if at.size:
            faults.append(DataFault(kind, at, recording.time_s[at], float(at.size), True, recording.measured_um[at]))
    quality = DataQuality(recording.name, recording.n_samples, tuple(faults), valid)
    moved = replace(recording, displacement_um=x, is_valid=valid)
    return Examined(masked_recording(moved, quality), quality)


@dataclass(frozen=True, eq=False)
class _Fit:
    """A residual, what is predicted, and what else may be in the residual; zero where readings do not count."""

    residual_um: Array
    predicted_um: Array
    rate_um: Array
    aside: Array
    valid: Mask
    has_levels: bool

    @classmethod
    def of(cls, residual_um: Array, predicted_um: Array, valid: Mask, has_delay: bool, has_levels: bool) -> _Fit:
        rate_um = np.gradient(predicted_um)
        others = [np.ones(predicted_um.size), predicted_um - np.mean(predicted_um)]
        if has_delay:
            # the rate to first order and the acceleration to second
            others += [rate_um, np.gradient(rate_um)]
        aside, _ = np.linalg.qr(np.column_stack(others) * valid[:, None])
        centred_um = (residual_um - np.mean(residual_um[valid])) * valid
        return cls(centred_um, predicted_um, rate_um, aside, valid, has_levels)

    def _read(self, units: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
        """Return which sample each reading is of where readings slipped so, shape (n_samples,)."""
        n_early = np.zeros(self.rate_um.size, dtype=np.int64)
        for sample, sign in units:
            n_early[sample:] += sign
        return np.asarray(np.clip(np.arange(n_early.size) + n_early, 0, n_early.size - 1), dtype=np.int64)

    def left(self, units: Sequence[tuple[int, int]]) -> Array:
        """Return what slips of one sample each leave, shape (n_samples,)."""
        moved_um = self.predicted_um[self._read(units)] - self.predicted_um
        rest = self.residual_um - moved_um * self.valid
        levels = np.zeros(rest.size)
        for _ in range(_N_LEVEL_ROUNDS if self.has_levels else 0):
            others = self.aside @ (self.aside.T @ (rest - levels))
            levels = levels_of(rest - others, self.valid) * self.valid
        rest = rest - levels
        return np.asarray(rest - self.aside @ (self.aside.T @ rest))

    def best(self, units: Sequence[tuple[int, int]]) -> tuple[int, int]:
        """Return place and sign of the slip that takes most beside others: a reader loses or doubles, not both.

        One more is nearly the motion of a sample, taken where those others have the reading.
        """
        rate_um = self.rate_um[self._read(units)] * self.valid
        powers = _from_here_on(rate_um**2) - np.sum(_from_here_on(self.aside * rate_um[:, None]) ** 2, axis=1)
        along = _from_here_on(rate_um * self.left(units))
        is_weak = powers < _LEAST_POWER * float(np.sum(rate_um**2))
        found = []
        for sign in {sign for _, sign in units} or (-1, 1):
            change = np.where(is_weak, np.inf, powers - 2.0 * sign * along)
            place = int(np.argmin(change))
            found.append((float(change[place]), place, sign))
        return min(found)[1:]

    def settled(self, units: list[tuple[int, int]]) -> list[tuple[int, int]]:
        """Return the slips, each where it takes most beside the others."""
        for _ in range(_N_ROUNDS):
            before = list(units)
            for i in range(len(units)):
                units[i] = self.best(units[:i] + units[i + 1 :])
            if units == before:
                break
        return units


def _from_here_on(values: Array) -> Array:
    return np.asarray(np.cumsum(values[::-1], axis=0)[::-1])

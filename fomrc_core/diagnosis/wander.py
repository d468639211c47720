"""Whether a cause explains more than noise that wanders might: a likelihood ratio on the noise's innovations.

Plays and creep, fitted by least squares, bend after a sensor that wanders, and beside a drift they need not: most of
what is left is then gone with the drift, in every block of the record, and none of it shows that anything drifts. The
question is whether the model needs the cause beside noise that wanders. With and without it the model is fitted to what
such noise does not know of a sample before it comes (generalized least squares; Harvey, "Forecasting, structural time
series models and the Kalman filter", 1989, ch. 4), each beside the noise that it is likeliest with: what is left with a
drift wanders less than the noise did, and beside that what is left without it would always be too much. The noise is
one that forgets, at any rate or never (a first-order process, in the limit a random walk), beside white noise of any
share.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.least_squares import normal_equations, whitening_of
from fomrc_core.compute.runs import runs_of
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.present_model import with_effects
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.free_parameters import free_parameters
from fomrc_core.fitting.linear_part import residuals, tangent
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.noise import autocorrelation_inflation

# What noise forgets from one sample to the next, 0 of a walk; between two of these a likelihood hardly changes.
_FORGOTTEN = (0.0, *np.geomspace(1.0 / 4096.0, 0.7, 13))
# The same of the moving average that white noise beside it makes: by factors of two in the share that wanders.
_AVERAGED = (*np.geomspace(1.0 / 512.0, 0.7, 17), 1.0)
_FILTERS = ((1.0, 1.0), *((f, a) for f in _FORGOTTEN for a in _AVERAGED if a > f))
# How often in a record noise forgets for each direction a fit can move in, if it is known to forget at all: every
# direction takes what is as slow as itself from noise that wanders, and what is left of a walk seems to forget.
_TIMES_PER_DIRECTION = 10.0
# What a slow direction gains of a walk by chance, in log likelihood: 2.25 in twice of it in the mean and as much again
# times 1.3 in one case of twenty (simulated, see ``noise_spectrum``).
_TAKEN_FROM_WALK = 0.5 * 2.25 * 2.3
_MOST_TURNS = 4  # noise and model told from each other in turn; two do as a rule
_SHORTEST = 16  # samples of a stretch: of fewer the filter's beginning is much
_ROWS_TOGETHER = 1 << 15  # filtered at a time: some tens of megabytes for a hundred columns


def gain_beyond_wander(model: TrialModel, cause: str, split: DataSplit) -> float:
    """Return by how much a model is likelier with a cause than without it, where noise may wander, in log likelihood.

    Each is fitted anew in all directions it can move. Samples count as often as the innovations are independent; half
    of one is taken off for each direction that the cause adds (Akaike, 1974), more where without it the noise is a
    walk.

    Args:
        model: with the cause, fitted to the training records.
        cause: its name.
        split: records, of which the training ones are asked.
    """
    with_it, without = _both_likeliest(model, model.without(cause), split)
    if with_it.power_um2 <= 0.0:
        return math.inf
    n_independent = with_it.n_samples / max(with_it.inflation, 1.0)
    added = max(with_it.rank - without.rank, 0)
    by_chance = _TAKEN_FROM_WALK if without.noise.is_walk else 0.5
    return 0.5 * n_independent * math.log(without.power_um2 / with_it.power_um2) - by_chance * added


@dataclass(frozen=True)
class Wander:
    """How noise wanders: a first-order process beside white noise, told as a filter of its innovations.

    Attributes:
        pole: what is left of it after a sample [1]: 1 of a random walk.
        zero: root of the moving average that white noise beside it makes [1], at most the pole; equal to it where the
            noise is white.
    """

    pole: float
    zero: float

    @property
    def is_white(self) -> bool:
        """Whether no sample knows anything of the next."""
        return self.pole == self.zero

    @property
    def is_walk(self) -> bool:
        """Whether it forgets nothing."""
        return self.pole == 1.0 and not self.is_white

    def innovations(self, values: Array) -> Array:
        """Return what of contiguous values could not be foreseen, the first left out, shape (n_samples - 1, ...)."""
        parts = list(self.stretches(values, np.ones(len(values), dtype=np.bool_)))
        return np.concatenate(parts) if parts else values[:0]

    def stretches(self, values: Array, mask: Mask) -> Iterator[Array]:
        """Yield the innovations of each stretch of used samples but for its first, so many rows at a time.

        Args:
            values: shape (n_samples, ...).
            mask: which samples are used, shape (n_samples,).
        """
        from scipy.signal import lfilter  # a second to import, which no node that only drives shall wait for

        for start, stop in runs_of(mask):
            if stop - start < _SHORTEST:
                continue
            state = np.zeros((1, *values.shape[1:]))
            for at in range(start, stop - 1, _ROWS_TOGETHER):
                rows = values[at : min(at + _ROWS_TOGETHER + 1, stop)]
                filtered, state = lfilter([1.0], [1.0, -self.zero], rows[1:] - self.pole * rows[:-1], axis=0, zi=state)
                yield filtered


def wander_beside(model: TrialModel, left_um: Sequence[Array], records: Sequence[FitRecord]) -> Wander:
    """Return the noise of which least is unforeseen of what a model leaves of records.

    It can move in as many directions as it has weights, order of creep and parameters of its causes.

    Args:
        model: fitted to the records.
        left_um: measured minus predicted of each record [um], shape (n_samples,).
        records: the records.
    """
    used_um = [values[record.is_used] for values, record in zip(left_um, records, strict=True)]
    return wander_of(used_um, model.weights.size + 1 + len(free_parameters(model)))


def wander_of(values_um: Sequence[Array], n_moved: int) -> Wander:
    """Return the noise of which least is unforeseen of what a fit left.

    What forgets too slowly for a fit to leave it as it was is told as a walk.

    Args:
        values_um: what a fit left, contiguous stretches [um].
        n_moved: number of directions it could move in.
    """
    centred_um = [values - np.mean(values) for values in values_um]
    least_forgotten = _TIMES_PER_DIRECTION * n_moved / max(1, sum(values.size for values in values_um))
    told = [Wander(1.0 - f, 1.0 - a) for f, a in _FILTERS if f == 0.0 or f >= least_forgotten]
    return min(told, key=lambda noise: mean_square([noise.innovations(values) for values in centred_um]))


@dataclass(frozen=True)
class _Innovations:
    """What a model leaves of the records that could not be foreseen: mean square, samples, correlation, directions."""

    power_um2: float
    n_samples: int
    inflation: float
    rank: int
    noise: Wander


@dataclass(frozen=True, eq=False)
class _Moved:
    """A model that may move in all its directions, and the offsets of the records.

    Attributes:
        left_um: what it leaves of each training record [um].
        columns: displacement per unit of each direction, the offset of each record last.
        masks: used samples of each record.
        rest_um: what is left by least squares [um].
    """

    left_um: tuple[Array, ...]
    columns: list[Array]
    masks: list[Mask]
    rest_um: tuple[Array, ...]

    @classmethod
    def of(cls, model: TrialModel, split: DataSplit) -> _Moved:
        left_um = residuals(model, split.train)
        directions = with_effects(tangent(model, split.train), model, split.train)
        masks = [record.is_used for record in split.train]
        # the offset of a record is not known, and not the mean where noise wanders
        columns = [np.column_stack((c, own)) for c, own in zip(directions.columns, offset_columns(masks), strict=True)]
        return cls(left_um, columns, masks, directions.remove(split.train, left_um))

    def beside(self, noise: Wander) -> tuple[_Innovations, list[Array]]:
        """Return the innovations of what is left beside a noise, and what is left [um]."""
        change, rank = change_beside(self.left_um, self.columns, self.masks, noise)
        rest_um = [u - rows @ change for u, rows in zip(self.left_um, self.columns, strict=True)]
        own = unforeseen(rest_um, self.masks, noise)
        inflation = max((autocorrelation_inflation(part) for part in own), default=1.0)
        return _Innovations(mean_square(own), sum(part.size for part in own), inflation, rank, noise), rest_um


def _both_likeliest(model: TrialModel, fewer: TrialModel, split: DataSplit) -> tuple[_Innovations, _Innovations]:
    """Return the innovations of a model and of one with fewer directions, each beside the noise it leaves least of.

    Noise and what is left are told from each other in turn, and each is asked beside the other's noise as well: who has
    more directions leaves no more. No noise is told that what has more directions could not leave.
    """
    told: list[list[_Innovations]] = []
    moved = [_Moved.of(each, split) for each in (model, fewer)]
    for each in moved:
        found: list[_Innovations] = []
        rest_um: Sequence[Array] = each.rest_um
        for _ in range(_MOST_TURNS):
            noise = wander_beside(model, rest_um, split.train)
            if any(known.noise == noise for known in found):
                break
            innovations, rest_um = each.beside(noise)
            found.append(innovations)
        told.append(found)
    best = [min(found, key=_power) for found in told]
    with_it, without = (
        min(own, each.beside(others.noise)[0], key=_power)
        for each, own, others in zip(moved, best, best[::-1], strict=True)
    )
    return with_it, without


def _power(innovations: _Innovations) -> float:
    return innovations.power_um2


def offset_columns(masks: Sequence[Mask]) -> list[Array]:
    """Return the offset of each record, one column for each of them, zero in the others: shapes (n_samples, n)."""
    return [np.tile(np.arange(len(masks)) == at, (mask.size, 1)).astype(np.float64) for at, mask in enumerate(masks)]


def change_beside(
    left_um: Sequence[Array], columns: Sequence[Array], masks: Sequence[Mask], noise: Wander
) -> tuple[Array, int]:
    """Return the change along the columns that leaves the least innovations, and how many directions have a say."""
    parts = (
        (part[:, :-1], part[:, -1], np.ones(len(part), dtype=np.bool_))
        for u, rows, mask in zip(left_um, columns, masks, strict=True)
        for part in noise.stretches(np.column_stack((rows, u)), mask)
    )
    equations = normal_equations(parts)
    whitening = whitening_of(equations.gram)
    return np.asarray(whitening @ (whitening.T @ equations.moment)), int(whitening.shape[1])


def unforeseen(values_um: Sequence[Array], masks: Sequence[Mask], noise: Wander) -> list[Array]:
    """Return what is not foreseen of the used samples of each record [um]; of one with too few of them nothing."""
    parts = [np.concatenate(list(noise.stretches(v, m)) or [v[:0]]) for v, m in zip(values_um, masks, strict=True)]
    return [part for part in parts if part.size]


def mean_square(innovations: Sequence[Array]) -> float:
    """Return the mean square of all of them [um^2]."""
    n = sum(part.size for part in innovations)
    return sum(float(part @ part) for part in innovations) / n if n else 0.0

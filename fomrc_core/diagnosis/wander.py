"""Whether a cause explains more than noise that wanders might: a likelihood ratio on the noise's innovations.

Plays and creep, fitted by least squares, bend after a sensor that wanders, and beside a drift they need not: most of
what is left is then gone with the drift, in every block of the record, and none of it shows that anything drifts. The
question is whether the model needs the cause once the noise may wander as it likes. Model with and without it are both
fitted to what the noise, a random walk beside white noise of any share, does not know of a sample before it comes
(generalized least squares; Harvey, "Forecasting, structural time series models and the Kalman filter", 1989, ch. 4).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.least_squares import normal_equations, whitening_of
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.present_model import with_effects
from fomrc_core.fitting.linear_part import residuals, tangent
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.noise import autocorrelation_inflation

# Of a walk seen through white noise the moving-average root: 0 a walk alone, 1 white noise alone. Between two of these
# the share that wanders changes by a factor of two, within which a likelihood hardly changes.
_ROOTS = (0.0, *(1.0 - np.geomspace(0.7, 1.0 / 512.0, 17)), 1.0)
_MOST_TURNS = 4  # of fit and root after each other: mostly the second finds the root it had
_SHORTEST = 16  # samples of a stretch: of fewer the filter's beginning is much
_ROWS_TOGETHER = 1 << 15  # filtered at a time: some tens of megabytes for a hundred columns


def gain_beyond_wander(model: TrialModel, cause: str, split: DataSplit) -> float:
    """Return by how much a model is likelier with a cause than without it, where noise may wander, in log likelihood.

    Each is fitted anew in all directions it can move. Samples count as often as the innovations are independent; half
    of one is taken off for each direction that the cause adds (Akaike, 1974).

    Args:
        model: with the cause, fitted to the training records.
        cause: its name.
        split: records, of which the training ones are asked.
    """
    with_it, without = _innovations(model, split), _innovations(model.without(cause), split)
    n_independent = with_it.n_samples / max(with_it.inflation, 1.0)
    if with_it.power_um2 <= 0.0:
        return math.inf
    added = max(with_it.rank - without.rank, 0)
    return 0.5 * n_independent * math.log(without.power_um2 / with_it.power_um2) - 0.5 * added


def wander_root(values_um: Sequence[Array]) -> float:
    """Return the moving-average root with which least of contiguous values [um] is unforeseen: 1 of white noise."""
    masks = [np.ones(values.size, dtype=np.bool_) for values in values_um]
    return float(min(_ROOTS, key=lambda trial: _mean_square(_unforeseen(values_um, masks, trial))))


def innovations(values_um: Array, root: float) -> Array:
    """Return what of contiguous values [um] could not be foreseen, one fewer where noise wanders (root below 1)."""
    parts = list(_filtered(values_um, np.ones(values_um.size, dtype=np.bool_), root))
    return np.concatenate(parts) if parts else values_um[:0]


@dataclass(frozen=True)
class _Innovations:
    """What a model leaves of the records that could not be foreseen: mean square, samples, correlation, directions."""

    power_um2: float
    n_samples: int
    inflation: float
    rank: int


def _innovations(model: TrialModel, split: DataSplit) -> _Innovations:
    left_um = residuals(model, split.train)
    directions = with_effects(tangent(model, split.train), model, split.train)
    masks = [record.is_used for record in split.train]
    root, fits = 1.0, list[tuple[_Innovations, float]]()
    for _ in range(_MOST_TURNS):
        change, rank = _least_squares(left_um, directions.columns, masks, root)
        rest_um = [u - columns @ change for u, columns in zip(left_um, directions.columns, strict=True)]
        own = _unforeseen(rest_um, masks, root)
        fits.append((_summary(own, rank), root))
        best = min(_ROOTS, key=lambda trial: _mean_square(_unforeseen(rest_um, masks, trial)))
        if any(best == asked for _, asked in fits):
            break
        root = best
    return min((fit for fit, _ in fits), key=lambda fit: fit.power_um2)


def _least_squares(
    left_um: Sequence[Array], columns: Sequence[Array], masks: Sequence[Mask], root: float
) -> tuple[Array, int]:
    """Return the change along the columns that leaves the least innovations, and how many directions have a say."""
    parts = (
        (part[:, :-1], part[:, -1], np.ones(len(part), dtype=np.bool_))
        for u, rows, mask in zip(left_um, columns, masks, strict=True)
        for part in _filtered(np.column_stack((rows, u)), mask, root)
    )
    equations = normal_equations(parts)
    whitening = whitening_of(equations.gram)
    return np.asarray(whitening @ (whitening.T @ equations.moment)), int(whitening.shape[1])


def _unforeseen(values_um: Sequence[Array], masks: Sequence[Mask], root: float) -> list[Array]:
    parts = [np.concatenate(list(_filtered(v, m, root)) or [v[:0]]) for v, m in zip(values_um, masks, strict=True)]
    return [part for part in parts if part.size]


def _summary(innovations: Sequence[Array], rank: int) -> _Innovations:
    inflation = max((autocorrelation_inflation(part) for part in innovations), default=1.0)
    return _Innovations(_mean_square(innovations), sum(part.size for part in innovations), inflation, rank)


def _mean_square(innovations: Sequence[Array]) -> float:
    n = sum(part.size for part in innovations)
    return sum(float(part @ part) for part in innovations) / n if n else 0.0


def _filtered(values: Array, mask: Mask, root: float) -> Iterator[Array]:
    """Yield the innovations of each stretch of used samples, so many rows at a time."""
    from scipy.signal import lfilter  # a second to import, which no node that only drives shall wait for

    edges = np.flatnonzero(np.diff(np.concatenate(([0], np.asarray(mask).astype(np.int8), [0]))))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        if stop - start < _SHORTEST:
            continue
        stretch = values[start:stop]
        if root >= 1.0:
            yield stretch - np.mean(stretch, axis=0)
            continue
        state = np.zeros((1, *values.shape[1:]))
        for at in range(0, stop - start - 1, _ROWS_TOGETHER):
            steps = np.diff(stretch[at : at + _ROWS_TOGETHER + 1], axis=0)
            filtered, state = lfilter([1.0], [1.0, -root], steps, axis=0, zi=state)
            yield filtered

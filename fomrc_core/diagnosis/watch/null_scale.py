"""How large a statistic of the residual is in normal work, as it depends on what the stage does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.least_squares import non_negative_fit

# What a model gets wrong depends on where the stage has been; a few minutes have not seen all of it.
_SAFETY = 1.4
# Motion of a kind that was not seen yet is not known to be free of error: a model is no better than some parts in ten
# thousand of how far the stage goes, and, jump by jump, of what it does between two samples.
_LEAST_SHARES = (0.0, 2e-4, 5e-4, 5e-3)
# Blocks of least motion, from which the constant part is believed where the fit would let others explain it.
_QUIET_SHARE = 0.25
_MEDIAN_TO_DEVIATION = 1.4826
# Blocks whose statistic is small count as much as those where it is large: weighted by what is expected of them.
_N_REWEIGHTINGS = 6


@dataclass(frozen=True, eq=False)
class NullScale:
    """Standard deviation of a statistic in normal work: the root of a sum of squares.

    A part is there always (noise, and what the model never gets right), others grow with what the stage does.

    Attributes:
        shares: of the constant and of each measure of motion, in the unit of the square, shape (4,).
    """

    shares: Array

    def of(self, measures: Array) -> Array:
        """Return the standard deviation for measures of motion, shape (n_blocks, n_measures) -> (n_blocks,)."""
        return np.asarray(np.sqrt(_squares(measures) @ self.shares))


def learnt_scale(statistic: Array, measures: Array, floor: float = 0.0) -> NullScale:
    """Return the scale that what was seen in normal work does not pass more often than a Gaussian would.

    Args:
        statistic: of each block of normal work, shape (n_blocks,).
        measures: measures of its motion, >= 0, shape (n_blocks, 3).
        floor: smallest standard deviation that is believed.
    """
    squares = _squares(measures)
    power = statistic**2
    motion = measures.sum(axis=1)
    quiet = np.abs(statistic[motion <= np.quantile(motion, _QUIET_SHARE)])
    smallest = max(floor, _MEDIAN_TO_DEVIATION * float(np.median(quiet)), 1e-150) ** 2
    shares = np.zeros(squares.shape[1])
    weights = np.ones(power.size)
    units = np.maximum(squares.max(axis=0), 1e-300)
    for _ in range(_N_REWEIGHTINGS):
        shares = non_negative_fit([(squares / units) * weights[:, None]], [power * weights]) / units
        shares[0] = max(shares[0], smallest)
        weights = 1.0 / (squares @ shares)
    # The furthest of n Gaussian values lies at about sqrt(2 log n).
    furthest = float(np.max(np.abs(statistic) / np.sqrt(squares @ shares)))
    excess = max(1.0, furthest / np.sqrt(2.0 * np.log(max(power.size, 2))))
    return NullScale(np.maximum(shares * (_SAFETY * excess) ** 2, np.square(_LEAST_SHARES)))


def _squares(measures: Array) -> Array:
    return np.column_stack((np.ones(measures.shape[0]), measures**2))

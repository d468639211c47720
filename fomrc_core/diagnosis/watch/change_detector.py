"""A sequential test for a change, with a stated mean time between false alarms.

An e-detector of Shiryaev-Roberts' form (J. Shin, A. Ramdas, A. Rinaldo: "E-detectors: a nonparametric framework for
sequential change detection", New England Journal of Statistics in Data Science 2 (2024), theorem 2.4): the sum over all
times a change might have come at of the evidence gathered since, raised as an alarm at the wanted mean run length, is
raised in normal work no earlier than that in the mean, whatever the change may be.

The evidence of one block is a likelihood ratio of Gaussian alternatives (mixture over shifts and widths, H. Robbins:
"Statistical methods related to the law of the iterated logarithm", Ann. Math. Statist. 41 (1970)) to a Gaussian that is
at least as wide as what was seen. What a model gets wrong is never white: blocks beside each other depend on each
other. The geometric mean of the evidence of so many blocks as do is evidence still (Hoelder's inequality), so that
each counts with the power one over their number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array

# Alternatives, in standard deviations of normal work: shifts to either side, and spreads.
_SHIFTS = (3.0, 8.0)
_SPREADS = (4.0, 15.0)
# What is learnt in minutes says little of how long errors last: blocks within two seconds count as one at least.
_LEAST_DEPENDENT = 4.0
# Correlation of blocks further apart than this share of what was learnt from cannot be told from chance.
_LONGEST_SHARE = 0.125
_LARGEST_VALUE = 40.0


def log_evidence(values: Array, *, is_signed: bool) -> Array:
    """Return the logarithm of the evidence against normal work, one column for each alternative.

    Args:
        values: statistics in standard deviations of normal work, shape (n_blocks,).
        is_signed: whether they have a sign, so that shifts to either side are alternatives beside wider spreads.

    Returns:
        Shape (n_blocks, n_alternatives).
    """
    x = np.clip(values, -_LARGEST_VALUE, _LARGEST_VALUE)
    columns = [0.5 * x**2 * (1.0 - 1.0 / spread**2) - np.log(spread) for spread in _SPREADS]
    if is_signed:
        columns += [sign * shift * x - 0.5 * shift**2 for shift in _SHIFTS for sign in (1.0, -1.0)]
    return np.column_stack(columns)


def n_dependent(values: Array) -> float:
    """Return over how many blocks values that follow each other depend on each other.

    The sum of the autocorrelations up to the first that is not positive.
    """
    centred = values - np.mean(values)
    power = float(centred @ centred)
    if not power > 0.0:
        return _LEAST_DEPENDENT
    total = 1.0
    for lag in range(1, max(2, int(_LONGEST_SHARE * values.size))):
        correlation = float(centred[lag:] @ centred[:-lag]) / power
        if correlation <= 0.0:
            break
        total += 2.0 * correlation
    return max(total, _LEAST_DEPENDENT)


@dataclass(frozen=True)
class Crossing:
    """The evidence has passed the threshold.

    Attributes:
        block: number of the block, from the first one the detector was given, in which it passed.
        since_block: block at which the change is likeliest to have begun.
        statistic: which of the statistics gave most of the evidence.
    """

    block: int
    since_block: int
    statistic: int


class ChangeDetector:
    """Gathers the evidence of several statistics, block by block.

    Args:
        n_dependent_blocks: of each statistic, over how many blocks it depends on itself.
        is_signed: of each statistic, whether it has a sign.
        mean_blocks_between_alarms: mean number of blocks of normal work to a false alarm.

    Attributes:
        n_blocks: blocks taken in.
    """

    def __init__(
        self, n_dependent_blocks: Sequence[float], is_signed: Sequence[bool], mean_blocks_between_alarms: float
    ) -> None:
        self._is_signed = tuple(is_signed)
        counts = [log_evidence(np.zeros(1), is_signed=signed).shape[1] for signed in is_signed]
        self._powers = np.repeat(1.0 / np.asarray(n_dependent_blocks), counts)
        self._statistic_of = np.repeat(np.arange(len(counts)), counts)
        n = self._powers.size
        self._log_threshold = float(np.log(mean_blocks_between_alarms) + np.log(n))
        self._log_sums = np.full(n, -np.inf)
        self._log_peaks = np.zeros(n)
        self._since = np.zeros(n, dtype=np.int64)
        self.n_blocks = 0

    @property
    def share_of_threshold(self) -> float:
        """How far the evidence has come on the way to an alarm, by its logarithm, 0 to 1."""
        return float(np.clip(np.max(self._log_sums, initial=0.0) / self._log_threshold, 0.0, 1.0))

    def add(self, values: Array) -> Crossing | None:
        """Take in blocks; return the first alarm they raise; what comes after it is not taken in.

        Args:
            values: of each statistic, in standard deviations of normal work, shape (n_blocks, n_statistics).
        """
        columns = [log_evidence(values[:, k], is_signed=signed) for k, signed in enumerate(self._is_signed)]
        for evidence in np.concatenate(columns, axis=1) * self._powers:
            self._log_sums = np.logaddexp(self._log_sums, 0.0) + evidence
            starts_anew = self._log_peaks <= 0.0
            self._since[starts_anew] = self.n_blocks
            self._log_peaks = np.maximum(self._log_peaks, 0.0) + evidence
            self.n_blocks += 1
            if np.max(self._log_sums) >= self._log_threshold:
                worst = int(np.argmax(self._log_sums))
                return Crossing(self.n_blocks - 1, int(self._since[worst]), int(self._statistic_of[worst]))
        return None

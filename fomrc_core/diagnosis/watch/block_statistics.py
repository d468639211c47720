"""What is told of each block of samples: where the residual stands, how it moves, and with what it goes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fomrc_core.compute.arrays import Array, Mask

STATISTICS = ("level", "gain", "unrest", "lag", "bend", "spike")
IS_SIGNED = (True, True, False, True, True, False)
MEASURES = ("place", "motion", "jump")
# Slower than this is the drift of a day: the model's creep over hours, the warmth of the room.
_FORGETTING_S = 30.0
# A projection on a motion that is hardly there would be a ratio of small numbers.
_SMALL_MOTION = 3.0


@dataclass(frozen=True, eq=False)
class Blocks:
    """Some blocks that follow each other.

    Attributes:
        statistics: in the order of STATISTICS [um], shape (n_blocks, 6).
        measures: of what the stage did, in the order of MEASURES [um], shape (n_blocks, 3).
        rested: share of rest in what slow drift is reckoned from [1], shape (n_blocks,).
    """

    statistics: Array
    measures: Array
    rested: Array


@dataclass
class BlockStatistics:
    """Makes the statistics, block after block; slow drift is forgotten.

    Args:
        period_s: sample period [s].
        n_block: samples of a block.
        small_um: what the model gets wrong where it is right [um].
    """

    period_s: float
    n_block: int
    small_um: float
    _residual_base_um: float = field(default=np.nan, init=False)
    _place_base_um: float = field(default=np.nan, init=False)
    _rested: float = field(default=0.0, init=False)
    _before_um: tuple[float, float] = field(default=(np.nan, 0.0), init=False)

    def of(self, residual_um: Array, predicted_um: Array) -> Blocks:
        """Return the statistics of the next blocks.

        Args:
            residual_um: measured minus predicted displacement [um], shape (n_blocks * n_block,).
            predicted_um: predicted displacement [um], same shape.
        """
        if np.isnan(self._before_um[0]):
            first = slice(self.n_block)
            self._residual_base_um = float(np.mean(residual_um[first]))
            self._place_base_um = float(np.mean(predicted_um[first]))
            self._before_um = float(predicted_um[0]), 0.0
        residual, self._residual_base_um = self._without_drift(residual_um, self._residual_base_um)
        place, self._place_base_um = self._without_drift(predicted_um, self._place_base_um)
        changes = np.diff(predicted_um, prepend=self._before_um[0])
        bends = np.diff(changes, prepend=self._before_um[1])
        self._before_um = float(predicted_um[-1]), float(changes[-1])
        in_blocks = (values.reshape(-1, self.n_block) for values in (residual, place, changes, bends))
        residual, place, changes, bends = in_blocks
        level, within = self._level_and_within(residual)
        statistics = (
            level,
            self._along(residual, place),
            np.sqrt(np.mean(within**2, axis=1)),
            self._along(within, self._level_and_within(changes)[1]),
            self._along(within, self._level_and_within(bends)[1]),
            np.max(np.abs(within), axis=1),
        )
        measures = (np.sqrt(np.mean(place**2, axis=1)), np.std(place, axis=1), np.max(np.abs(changes), axis=1))
        rested = self._followed_rest(np.ptp(place, axis=1) < _SMALL_MOTION * self.small_um)
        return Blocks(np.column_stack(statistics), np.column_stack(measures), rested)

    def _followed_rest(self, is_at_rest: Mask) -> Array:
        block_s = self.n_block * self.period_s
        share = block_s / (_FORGETTING_S + block_s)
        state = np.array([(1.0 - share) * self._rested])
        from scipy.signal import lfilter  # slow to import, and only who watches needs it

        rested, _ = lfilter([share], [1.0, share - 1.0], is_at_rest.astype(np.float64), zi=state)
        self._rested = float(rested[-1])
        return np.asarray(rested)

    def _along(self, values: Array, direction: Array) -> Array:
        """Return what of the values goes with a motion, as an rms [um], signed."""
        power = np.sum(direction**2, axis=1) + self.n_block * (_SMALL_MOTION * self.small_um) ** 2
        return np.asarray(np.sum(values * direction, axis=1) / np.sqrt(self.n_block * power))

    def _level_and_within(self, values: Array) -> tuple[Array, Array]:
        """Return the mean of each block, and what is left with the mean and a straight line taken out."""
        line = np.linspace(-1.0, 1.0, self.n_block)
        line /= np.sqrt(line @ line)
        level = np.mean(values, axis=1)
        within = values - level[:, None]
        return level, within - (within @ line)[:, None] * line

    def _without_drift(self, values: Array, base: float) -> tuple[Array, float]:
        share = self.period_s / (_FORGETTING_S + self.period_s)
        from scipy.signal import lfilter  # slow to import, and only who watches needs it

        followed, _ = lfilter([share], [1.0, share - 1.0], values, zi=np.array([(1.0 - share) * base]))
        return values - followed, float(followed[-1])

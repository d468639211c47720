"""Whether one model is truly better than another on data neither was fitted to."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, wilcoxon
from scipy.stats import t as student

from fomrc_core.records.noise import autocorrelation_inflation

Array = NDArray[np.float64]

SURE = 10.0  # difference in log likelihood that settles it
WORTHWHILE_LOG_GAIN = 0.08
WORTHWHILE_LOCAL_LOG_GAIN = 0.5
_ACTIVE_ENERGY = 0.95
_LOCAL_SHARE = 0.4
# Blocks are independent where each is many times as long as what it averages is correlated with itself. An effect
# that acts at a few moments has few blocks to speak for it: there they are made shorter, but never so short that
# neighbours say the same.
_BLOCK_CORRELATIONS = (16.0, 8.0, 4.0)
_ENOUGH_BLOCKS = 14  # ranks of fewer cannot be surer than 1e-4
_MOST_BLOCKS = 400  # more make the test no surer, only the tails of single samples heavier


@dataclass(frozen=True)
class HeldOutScore:
    """How a model compares with the one before it on held-out data.

    Attributes:
        log_gain: logarithm of the ratio of mean squared errors, before over after [1].
        local_log_gain: the same where the two differ; 0 where they differ nearly everywhere.
        p_value: of the hypothesis that nothing was gained (Clark-West for nested models, blocks of samples).
        rms_before_um: error before [um].
        rms_after_um: error after [um].
    """

    log_gain: float
    local_log_gain: float
    p_value: float
    rms_before_um: float
    rms_after_um: float

    def is_worthwhile(self) -> bool:
        """Return whether the gain is real and not only statistically sure."""
        return self.log_gain >= WORTHWHILE_LOG_GAIN or (
            self.local_log_gain >= WORTHWHILE_LOCAL_LOG_GAIN and self.log_gain > 0.0
        )


def held_out_score(before: list[Array], after: list[Array]) -> HeldOutScore:
    """Return the score of residuals before and after on held-out stretches of samples.

    Args:
        before: residuals of the smaller model [um], an array per stretch.
        after: residuals of the larger model [um], the same stretches.
    """
    b, a = np.concatenate(before), np.concatenate(after)
    mse_before, mse_after = float(np.mean(b * b)), float(np.mean(a * a))
    difference = (b - a) ** 2
    local = 0.0
    order = np.sort(difference)[::-1]
    energy = np.cumsum(order)
    if energy[-1] > 0.0:
        n_active = int(np.searchsorted(energy, _ACTIVE_ENERGY * energy[-1])) + 1
        if n_active < _LOCAL_SHARE * b.size:
            active = difference >= order[n_active - 1]
            local = _log_ratio(float(np.mean(b[active] ** 2)), float(np.mean(a[active] ** 2)))
    return HeldOutScore(
        _log_ratio(mse_before, mse_after),
        local,
        _clark_west(before, after),
        math.sqrt(mse_before),
        math.sqrt(mse_after),
    )


def _log_ratio(before: float, after: float) -> float:
    return math.log(max(before, 1e-300) / max(after, 1e-300))


def _clark_west(before: list[Array], after: list[Array]) -> float:
    # The larger of two nested models carries the noise of its extra parameters; Clark and West (2007) add it back.
    gain = [b * b - a * a + (b - a) ** 2 for b, a in zip(before, after, strict=True)]
    activity = [(b - a) ** 2 for b, a in zip(before, after, strict=True)]
    inflation = _inflation(gain)
    active = np.zeros(0)
    for correlations in _BLOCK_CORRELATIONS:
        m = np.array(_block_means(gain, correlations * inflation))
        w = np.array(_block_means(activity, correlations * inflation))
        # blocks in which the two models hardly differ cannot speak for either
        active = m[w > 1e-3 * max(float(np.max(w)), 1e-300)]
        if active.size >= _ENOUGH_BLOCKS:
            break
    if active.size < _ENOUGH_BLOCKS:
        return _by_noise(before, after)
    spread = float(np.std(active, ddof=1))
    if spread == 0.0:
        return 0.0 if float(np.mean(active)) > 0.0 else 1.0
    by_mean = float(student.sf(float(np.mean(active)) / (spread / math.sqrt(active.size)), active.size - 1))
    # Gains of an effect that acts at a few moments are far from normal; their ranks are not. Two tests: twice the p.
    by_rank = float(wilcoxon(active, alternative="greater").pvalue)
    return min(1.0, 2.0 * min(by_mean, by_rank))


def _inflation(series: list[Array]) -> float:
    """Return by how much the mean of the longest stretch varies more than if its samples were independent."""
    return autocorrelation_inflation(max(series, key=lambda values: values.size))


def _block_means(series: list[Array], block: float) -> list[float]:
    """Return means over blocks of at least this many samples, stretch by stretch."""
    n_samples = sum(values.size for values in series)
    size = max(block, n_samples / _MOST_BLOCKS)
    return [
        float(np.mean(part)) for values in series for part in np.array_split(values, max(int(values.size / size), 1))
    ]


def _by_noise(before: list[Array], after: list[Array]) -> float:
    # Too few moments for their own spread: were the smaller model true, its residual b were noise, and the drop of the
    # sum of squares normal about -sum d^2 with variance 4 sigma^2 sum d^2 (d the difference of the two models), as many
    # times larger as the noise is correlated with itself over the moments in which d acts.
    b, a = np.concatenate(before), np.concatenate(after)
    power = float(np.sum((b - a) ** 2))
    if power == 0.0:
        return 1.0
    drop = float(np.sum(b * b - a * a))
    inflation = max(_inflation(after), 1.0)
    spread = 2.0 * math.sqrt(inflation * float(np.mean(a * a)) * power)
    return float(norm.sf((drop + power) / spread))


def loses_to(best: list[Array], other: list[Array]) -> float:
    """Return the p-value of the hypothesis that the other model is as good as the best one.

    Of mean losses over blocks (Diebold and Mariano, 1995), or of their ranks: one jump that a model misses by much says
    more than all the rest together, and makes its mean unsure.
    """
    loss = [o * o - b * b for b, o in zip(best, other, strict=True)]
    m = np.array(_block_means(loss, _BLOCK_CORRELATIONS[1] * _inflation(loss)))
    spread = float(np.std(m, ddof=1)) if m.size > 2 else 0.0
    if spread == 0.0:
        return 1.0
    by_mean = float(student.sf(float(np.mean(m)) / (spread / math.sqrt(m.size)), m.size - 1))
    if float(np.mean(m)) <= 0.0:
        return by_mean
    return min(1.0, 2.0 * min(by_mean, float(wilcoxon(m, alternative="greater").pvalue)))

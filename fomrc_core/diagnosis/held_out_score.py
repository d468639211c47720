"""Whether one model is truly better than another on data neither was fitted to."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, wilcoxon
from scipy.stats import t as student

Array = NDArray[np.float64]

WORTHWHILE_LOG_GAIN = 0.08
WORTHWHILE_LOCAL_LOG_GAIN = 0.5
_ACTIVE_ENERGY = 0.95
_LOCAL_SHARE = 0.4
_BLOCK = 250
# An effect that acts at a few moments has few blocks to speak for it: they are made smaller until there are enough.
_BLOCKS = (_BLOCK, 20, 4, 1)
_NOISE_CORRELATION = 4.0
_ENOUGH_BLOCKS = 14  # ranks of fewer cannot be surer than 1e-4


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
    for size in _BLOCKS:
        means, energies = [], []
        for g, e in zip(gain, activity, strict=True):
            n_blocks = max(g.size // size, 1)
            means += [float(np.mean(part)) for part in np.array_split(g, n_blocks)]
            energies += [float(np.sum(part)) for part in np.array_split(e, n_blocks)]
        m, w = np.array(means), np.array(energies)
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
    by_rank = float(wilcoxon(active, alternative="greater").pvalue) if active.size >= 8 else 1.0
    return min(1.0, 2.0 * min(by_mean, by_rank))


def _by_noise(before: list[Array], after: list[Array]) -> float:
    # Too few moments for their own spread: were the smaller model true, its residual b were noise, and the drop of the
    # sum of squares normal about -sum d^2 with variance 4 sigma^2 sum d^2 (d the difference of the two models).
    b, a = np.concatenate(before), np.concatenate(after)
    power = float(np.sum((b - a) ** 2))
    if power == 0.0:
        return 1.0
    drop = float(np.sum(b * b - a * a))
    spread = 2.0 * math.sqrt(_NOISE_CORRELATION * float(np.mean(a * a)) * power)
    return float(norm.sf((drop + power) / spread))


def loses_to(best: list[Array], other: list[Array]) -> float:
    """Return the p-value of the hypothesis that the other model is as good as the best one (Diebold-Mariano)."""
    means = []
    for b, o in zip(best, other, strict=True):
        loss = o * o - b * b
        means += [float(np.mean(part)) for part in np.array_split(loss, max(loss.size // _BLOCK, 1))]
    m = np.array(means)
    spread = float(np.std(m, ddof=1)) if m.size > 2 else 0.0
    if spread == 0.0:
        return 1.0
    return float(student.sf(float(np.mean(m)) / (spread / math.sqrt(m.size)), m.size - 1))

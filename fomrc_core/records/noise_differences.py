"""Noise from the fastest changes of a record alone: fourth differences over 1, 2, 4, ... samples.

Fourth differences take out what moves evenly. Over longer lags they see slower noise and, sooner or later, the motion:
noise no redder than a random walk at most doubles its mean square from one lag to twice the lag, a smooth motion
multiplies it by up to 2^8. Lags are taken up to where it more than doubles. The mean squares are fitted with a sum of
white noise and first-order processes (generalised method of wavelet moments: Guerrier et al., JASA 108 (2013)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.records.noise_parts import OrnsteinUhlenbeckSum, fit_sum

_WEIGHTS = (1.0, -4.0, 6.0, -4.0, 1.0)
# squares of the weights, and the sums that weigh the correlations at one to four lags
_OF_LAGS = np.array([70.0, -112.0, 56.0, -16.0, 2.0])
_EVENEST = 0.34
_MAD_EFFICIENCY = 0.37
# one plus twice the squared autocorrelations of fourth differences of white noise
_OVERLAP = 2.63
_N_SIGMA = 3.0
_N_TAPS = 4


@dataclass(frozen=True)
class DifferenceNoise:
    """Noise as differences show it.

    Attributes:
        parts: white and first-order parts [um].
        longest_lag: longest lag that shows noise and not motion [samples].
        degrees_of_freedom: of the variance [1].
        n_samples: number of differences it rests on, at a lag of one sample.
    """

    parts: OrnsteinUhlenbeckSum
    longest_lag: int
    degrees_of_freedom: float
    n_samples: int


def difference_noise(pairs: Sequence[tuple[Array, Array]]) -> DifferenceNoise:
    """Return the noise of records of drive [V] and displacement [um], each of shape (n_samples,)."""
    lags, powers, freedoms = list[int](), list[float](), list[float]()
    n_first = 0
    lag = 1
    while True:
        parts = [_power(v, x, lag) for v, x in pairs if v.size > 8 * 4 * lag or lag == 1]
        parts = [p for p in parts if p[1] > 0.0]
        freedom = sum(p[1] for p in parts)
        if not parts or (lags and freedom < 8.0):
            break
        power = sum(p[0] * p[1] for p in parts) / freedom
        if lags:
            growth = power / powers[-1] if powers[-1] > 0.0 else np.inf
            slack = _N_SIGMA * np.sqrt(2.0 / freedom + 2.0 / freedoms[-1])
            # a walk that was filtered below half the sample rate grows up to threefold from one sample to two
            most = 2.0 if len(lags) > 1 else 3.0
            if growth > most * (1.0 + slack) or any(p[2] for p in parts):
                # where motion shows at a lag, some of it is in half the lag already
                if len(lags) > 1:
                    lags, powers, freedoms = lags[:-1], powers[:-1], freedoms[:-1]
                break
        else:
            n_first = round(sum(p[1] for p in parts) * _OVERLAP / _MAD_EFFICIENCY)
        lags.append(lag)
        powers.append(power)
        freedoms.append(freedom)
        lag *= 2
    if not lags or max(powers) <= 0.0:
        return DifferenceNoise(OrnsteinUhlenbeckSum(0.0, np.ones(1), np.zeros(1)), 1, 1.0, n_first)
    # the longest length is twice the longest lag
    length = np.asarray(2.0 ** np.arange(1, 1 + len(lags)), dtype=np.float64)
    shapes = np.column_stack((np.full(len(lags), 70.0), _shapes(np.array(lags, dtype=np.float64), length)))
    weights = fit_sum(shapes, np.maximum(np.array(powers), 1e-300), np.array(freedoms))
    parts_found = OrnsteinUhlenbeckSum(float(weights[0]), length, np.asarray(weights[1:]))
    # what longer lags show beyond the first may be motion: it is known to a factor, two degrees of freedom
    total = float(np.sum(weights))
    fast = min(powers[0] / _OF_LAGS[0], total)
    freedom = total**2 / (fast**2 / freedoms[-1] + (total - fast) ** 2 / 2.0)
    return DifferenceNoise(parts_found, lags[-1], freedom, n_first)


def _shapes(lags: Array, length: Array) -> Array:
    decay = np.exp(-np.outer(lags, 1.0 / length))
    return np.asarray(sum(weight * decay**k for k, weight in enumerate(_OF_LAGS)), dtype=np.float64)


def _power(v: Array, x: Array, lag: int) -> tuple[float, float, bool]:
    """Return the mean square of the difference, its degrees of freedom, and whether it is mostly motion."""
    if v.size < 5 * lag + 8:
        return 0.0, 0.0, True
    bend, rough = _difference(v, lag), _difference(x, lag)
    size = np.abs(bend)
    even = size <= max(float(np.quantile(size, _EVENEST)), 1e-12 * float(np.ptp(v)))
    left = rough[even]
    follows = False
    if np.any(size[even] > 1e-12 * float(np.ptp(v))):
        taps = np.column_stack([np.concatenate((np.zeros(k), bend[: bend.size - k]))[even] for k in range(_N_TAPS)])
        # what follows the drive is taken out of the evenest samples too
        left = left - taps @ np.linalg.lstsq(taps, left, rcond=None)[0]
        follows = bool(np.median(np.abs(left)) < 0.5 * np.median(np.abs(rough[even])))
    # median absolute deviation: transients that fall among the even samples do not count
    power = float(np.median(np.abs(left)) / 0.6744897502) ** 2
    return power, _MAD_EFFICIENCY * left.size / (_OVERLAP * lag), follows


def _difference(values: Array, lag: int) -> Array:
    n = values.size - 4 * lag
    return np.asarray(
        sum(weight * values[k * lag : k * lag + n] for k, weight in enumerate(_WEIGHTS)), dtype=np.float64
    )

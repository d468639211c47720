"""Autoregressive prediction: from autocovariance to a filter that makes coloured noise white.

Levinson, "The Wiener RMS error criterion in filter design and prediction", J. Math. Phys. 25 (1947); Burg,
"Maximum entropy spectral analysis", thesis, Stanford (1975), here over several stretches at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array


@dataclass(frozen=True)
class AutoregressiveFilter:
    """A stationary autoregressive process by its reflection coefficients.

    Attributes:
        reflection: reflection coefficients, each within (-1, 1), shape (order,).
        variance_um2: variance of the process [um^2].
    """

    reflection: Array
    variance_um2: float

    @property
    def order(self) -> int:
        """Number of past samples a prediction rests on."""
        return int(self.reflection.size)

    @property
    def coefficients(self) -> Array:
        """Prediction-error filter ``[1, a1, ..., ap]``."""
        return _predictors(self.reflection)[-1]

    @property
    def innovation_um2(self) -> float:
        """Variance of what cannot be predicted [um^2]."""
        return float(self.variance_um2 * np.prod(1.0 - self.reflection**2))

    def whiten(self, values: Array) -> Array:
        """Return the values as independent ones of unit variance, if they are of this process.

        The first samples are predicted from as many as there are before them (exact for the process), so nothing is
        lost at the start.

        Args:
            values: shape (n_samples,) or, for columns of a linear model, (n_samples, n_columns).

        Returns:
            The whitened values, of the same shape.
        """
        from scipy.signal import lfilter  # a second to import, which no node that only drives shall wait for

        x = np.asarray(values, dtype=np.float64)
        white = np.asarray(lfilter(self.coefficients, [1.0], x, axis=0), dtype=np.float64)
        white /= np.sqrt(self.innovation_um2)
        variance = self.variance_um2
        for k, predictor in enumerate(_predictors(self.reflection)[:-1]):
            if k >= x.shape[0]:
                break
            white[k] = np.tensordot(predictor[::-1], x[: k + 1], axes=(0, 0)) / np.sqrt(variance)
            variance *= 1.0 - self.reflection[k] ** 2
        return white

    def autocovariance(self, n_lags: int) -> Array:
        """Return the autocovariance at lags 0 to ``n_lags`` [um^2], shape (n_lags + 1,)."""
        gamma = np.zeros(n_lags + 1)
        gamma[0] = self.variance_um2
        predictors = _predictors(self.reflection)
        for lag in range(1, n_lags + 1):
            predictor = predictors[min(lag, self.order)]
            gamma[lag] = -float(
                np.dot(
                    predictor[1:],
                    gamma[lag - 1 : lag - predictor.size : -1] if lag >= predictor.size else gamma[lag - 1 :: -1],
                )
            )
        return gamma

    def density(self, frequency: Array) -> Array:
        """Return the one-sided spectral density [um^2 per cycle per sample] at frequencies [cycles per sample]."""
        response = np.abs(np.exp(-2j * np.pi * np.outer(frequency, np.arange(self.order + 1))) @ self.coefficients) ** 2
        return np.asarray(2.0 * self.innovation_um2 / response, dtype=np.float64)

    def log_determinant(self, n_samples: int) -> float:
        """Return the logarithm of the determinant of the covariance of so many samples [log um^2]."""
        shrink = np.log1p(-(self.reflection**2))
        remaining = np.clip(n_samples - 1 - np.arange(self.order), 0, None)
        return float(n_samples * np.log(self.variance_um2) + np.dot(shrink, remaining))


def _predictors(reflection: Array) -> list[Array]:
    predictors = [np.ones(1)]
    for k in reflection:
        longer = np.append(predictors[-1], 0.0)
        predictors.append(longer + k * longer[::-1])
    return predictors


def process_of(coefficients: Array, innovation_um2: float) -> AutoregressiveFilter:
    """Return the process of a prediction-error filter ``[1, a1, ..., ap]`` with its roots inside the unit circle."""
    predictor, reflection = np.asarray(coefficients, dtype=np.float64), []
    while predictor.size > 1:
        # rounding can put a root of a product of filters on the unit circle
        k = float(np.clip(predictor[-1], -1.0 + 1e-12, 1.0 - 1e-12))
        reflection.append(k)
        predictor = (predictor - k * predictor[::-1])[:-1] / (1.0 - k * k)
    reflections = np.array(reflection[::-1])
    return AutoregressiveFilter(reflections, float(innovation_um2 / np.prod(1.0 - reflections**2)))


def levinson(autocovariance: Array, slack: float = 1e-3) -> AutoregressiveFilter:
    """Return the process of an autocovariance, of the lowest order that predicts as well as the highest.

    Args:
        autocovariance: at lags 0, 1, ... [um^2], positive definite, shape (max_order + 1,).
        slack: share of the innovation variance by which the chosen order may be worse than the highest [1].
    """
    gamma = np.asarray(autocovariance, dtype=np.float64)
    variance, reflection, left = float(gamma[0]), [], [float(gamma[0])]
    predictor = np.ones(1)
    for order in range(1, gamma.size):
        k = -float(np.dot(predictor, gamma[order:0:-1])) / variance
        # rounding can push a nearly unpredictable step over the edge of stability
        k = float(np.clip(k, -1.0 + 1e-12, 1.0 - 1e-12))
        longer = np.append(predictor, 0.0)
        predictor = longer + k * longer[::-1]
        variance *= 1.0 - k * k
        reflection.append(k)
        left.append(variance)
    enough = int(np.argmax(np.array(left) <= (1.0 + slack) * left[-1]))
    return AutoregressiveFilter(np.array(reflection[:enough]), float(gamma[0]))


def burg(stretches: Sequence[Array], max_order: int) -> AutoregressiveFilter:
    """Return the autoregressive process of several stretches of one noise, its order by Schwarz's criterion (BIC).

    Akaike's criterion would spend coefficients on the notch that taking out drift leaves at frequency zero.

    Args:
        stretches: values without their mean, each of shape (n_samples,).
        max_order: highest order tried.

    Returns:
        The process; of order 0 where nothing can be predicted.
    """
    forward = [np.array(s, dtype=np.float64) for s in stretches if s.size > 1]
    backward = [f.copy() for f in forward]
    n = sum(f.size for f in forward)
    power = sum(float(np.dot(f, f)) for f in forward) / max(n, 1)
    if power <= 0.0:
        return AutoregressiveFilter(np.zeros(0), 0.0)
    variance, reflection = power, list[float]()
    best, best_order = n * np.log(power), 0
    for order in range(1, min(max_order, n // 4) + 1):
        forward = [f[1:] for f in forward]
        backward = [b[:-1] for b in backward]
        product = sum(float(np.dot(f, b)) for f, b in zip(forward, backward, strict=True))
        energy = sum(float(np.dot(f, f) + np.dot(b, b)) for f, b in zip(forward, backward, strict=True))
        if energy <= 0.0:
            break
        k = -2.0 * product / energy
        pairs = [(f + k * b, b + k * f) for f, b in zip(forward, backward, strict=True)]
        forward, backward = [p[0] for p in pairs], [p[1] for p in pairs]
        variance *= 1.0 - k * k
        reflection.append(k)
        if variance <= 0.0:
            break
        criterion = n * np.log(variance) + order * np.log(n)
        if criterion < best - 1e-9:
            best, best_order = criterion, order
    return AutoregressiveFilter(np.array(reflection[:best_order]), power)

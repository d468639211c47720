"""Parts a noise is made of: power in bands of its spectrum, and sums of white and first-order processes.

The correlation lengths of the processes stand an octave apart, their weights are zero or more: such sums come close to
flicker noise and random walks. Weights maximise the Whittle likelihood of the bands by multiplicative updates.

Sources: Riedel & Sidorenko, "Minimum bias multiple taper spectral estimation", IEEE Trans. Signal Process. 43 (1995);
Guerrier et al., "Wavelet-variance-based estimation for composite stochastic processes", JASA 108 (2013), for noise
as a sum of such processes; Fevotte, Bertin & Durrieu, "Nonnegative matrix factorization with the Itakura-Saito
divergence", Neural Computation 21 (2009), for the updates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array

N_TAPERS = 3
_BANDS_PER_OCTAVE = 3
_N_UPDATES = 300


@dataclass(frozen=True)
class Bands:
    """Power in bands that are even in log frequency.

    Attributes:
        frequency: mean frequency of each band [cycles per sample], increasing, shape (n_bands,).
        power: mean one-sided density [um^2 per cycle per sample], shape (n_bands,).
        freedom: degrees of freedom of each power, shape (n_bands,).
    """

    frequency: Array
    power: Array
    freedom: Array


@dataclass(frozen=True)
class OrnsteinUhlenbeckSum:
    """White noise and first-order processes side by side.

    Attributes:
        white_um2: variance of the white part [um^2].
        length: correlation lengths [samples], shape (n,).
        variance_um2: variance of each [um^2], shape (n,).
    """

    white_um2: float
    length: Array
    variance_um2: Array

    def density(self, frequency: Array) -> Array:
        """Return the one-sided density [um^2 per cycle per sample] at frequencies [cycles per sample]."""
        return 2.0 * self.white_um2 + first_order_densities(frequency, self.length) @ self.variance_um2

    def autocovariance(self, n_lags: int) -> Array:
        """Return the autocovariance at lags 0 to ``n_lags`` [um^2]."""
        lags = np.arange(n_lags + 1)
        gamma = np.exp(-np.outer(lags, 1.0 / self.length)) @ self.variance_um2
        gamma[0] += self.white_um2
        return np.asarray(gamma, dtype=np.float64)


def first_order_densities(frequency: Array, length: Array) -> Array:
    """Return one-sided densities of first-order processes of unit variance, shape (n_frequencies, n_lengths)."""
    rho = np.exp(-1.0 / length)[None, :]
    cosine = np.cos(2.0 * np.pi * frequency)[:, None]
    return np.asarray(2.0 * (1.0 - rho**2) / (1.0 - 2.0 * rho * cosine + rho**2), dtype=np.float64)


def bands_of(values: Sequence[Array], lowest: Sequence[float]) -> Bands:
    """Return the mean power of several stretches in bands of three an octave.

    Args:
        values: stretches, each of shape (n_samples,).
        lowest: frequency from which each is believed [cycles per sample].
    """
    edges = 0.5 * 2.0 ** (-np.arange(64 * _BANDS_PER_OCTAVE)[::-1] / _BANDS_PER_OCTAVE)
    power, count, middle = np.zeros(edges.size), np.zeros(edges.size), np.zeros(edges.size)
    for x, low in zip(values, lowest, strict=True):
        density = _multitaper(x)
        frequency = np.fft.rfftfreq(x.size)
        inside = frequency >= min(low, frequency[-1])
        band = np.searchsorted(edges, frequency[inside] * (1.0 - 1e-9))
        power += np.bincount(band, density[inside], edges.size)
        middle += np.bincount(band, frequency[inside], edges.size)
        count += np.bincount(band, minlength=edges.size)
    used = count > 0
    # tapers leave out some of the ends of a stretch, as if it were K / (K + 1/2) times as long; a line has one degree
    # of freedom for each taper and phase
    freedom = 2.0 * np.maximum(count[used] * (N_TAPERS / (N_TAPERS + 0.5)), N_TAPERS)
    return Bands(middle[used] / count[used], np.maximum(power[used] / count[used], 1e-300), freedom)


def _multitaper(x: Array) -> Array:
    """Return the one-sided sine-multitaper density at the Fourier frequencies."""
    n = x.size
    k = np.arange(1, n + 1)
    density = np.zeros(n // 2 + 1)
    for taper in range(1, N_TAPERS + 1):
        weights = np.sqrt(2.0 / (n + 1)) * np.sin(np.pi * taper * k / (n + 1))
        density += np.abs(np.fft.rfft(weights * x)) ** 2
    return np.asarray(2.0 * density / N_TAPERS)


def slow_part(bands: Bands) -> tuple[OrnsteinUhlenbeckSum, float]:
    """Return the sum that fits the bands and Schwarz's criterion of it; white noise alone where it does as well."""
    flat = OrnsteinUhlenbeckSum(0.5 * float(np.average(bands.power, weights=bands.freedom)), np.ones(1), np.zeros(1))
    # octaves from 2 samples to the longest length whose flank is seen
    n_octaves = max(1, int(np.log2(1.0 / bands.frequency[0])))
    length = np.asarray(2.0 ** np.arange(1, n_octaves + 1), dtype=np.float64)
    shapes = np.column_stack((np.full(bands.frequency.size, 2.0), first_order_densities(bands.frequency, length)))
    weights = fit_sum(shapes, bands.power, bands.freedom)
    fitted = OrnsteinUhlenbeckSum(float(weights[0]), length, np.asarray(weights[1:]))
    # weights of zero or more bend to little more than a level and a slope can: two parameters
    penalty = 2.0 * float(np.log(np.sum(bands.freedom)))
    misfits = (-2.0 * _likelihood(flat, bands), -2.0 * _likelihood(fitted, bands) + penalty)
    return (flat, misfits[0]) if misfits[0] <= misfits[1] else (fitted, misfits[1])


def fit_sum(shapes: Array, power: Array, freedom: Array) -> Array:
    """Return weights of zero or more that make a sum of shapes likely to have given the powers.

    Args:
        shapes: expected power of each process with weight one, shape (n_powers, n_processes).
        power: measured powers, chi-squared with the degrees of freedom given about the truth, shape (n_powers,).
        freedom: degrees of freedom of each, shape (n_powers,).
    """
    weights = np.full(shapes.shape[1], float(np.average(power / np.sum(shapes, axis=1), weights=freedom)))
    for _ in range(_N_UPDATES):
        expected = shapes @ weights
        up = shapes.T @ (freedom * power / expected**2)
        down = shapes.T @ (freedom / expected)
        weights = weights * up / np.maximum(down, 1e-300)
        weights = np.maximum(weights, 1e-14 * float(np.max(weights)))
    return np.asarray(weights, dtype=np.float64)


def _likelihood(model: OrnsteinUhlenbeckSum, bands: Bands) -> float:
    expected = model.density(bands.frequency)
    return float(-0.5 * np.sum(bands.freedom * (np.log(expected) + bands.power / expected)))

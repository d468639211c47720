"""What a sensor adds: noise of six kinds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from test.hidden.second.scale import log_uniform

NOISE_KINDS = ("white", "autoregressive", "flicker", "walk", "quantised", "proportional")


@dataclass(frozen=True)
class SensorNoise:
    """Noise of a kind and an rms.

    Args:
        kind: one of NOISE_KINDS.
        rms_um: rms over a record of ``n_reference`` samples, its mean taken out [um].
        correlation: from sample to sample, of "autoregressive".
        coloured_share: share of the variance that is coloured, of "flicker" and "walk"; the rest is white.
        n_reference: samples over which a walk comes to its rms.
        reach_um: displacement at which proportional noise is largest [um].
    """

    kind: str
    rms_um: float
    correlation: float
    coloured_share: float
    n_reference: int
    reach_um: float

    def read(self, true_um: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return what the sensor reads of a true displacement [um], shape (n_samples,)."""
        n = true_um.size
        white = rng.standard_normal(n)
        if self.kind == "white":
            return true_um + self.rms_um * white
        if self.kind == "autoregressive":
            innovation = np.sqrt(1.0 - self.correlation**2) * white
            start = [self.correlation * rng.standard_normal()]
            return true_um + self.rms_um * lfilter([1.0], [1.0, -self.correlation], innovation, zi=start)[0]
        if self.kind in ("flicker", "walk"):
            coloured = flicker(n, rng) if self.kind == "flicker" else walk(n, self.n_reference, rng)
            parts = np.sqrt(1.0 - self.coloured_share) * white + np.sqrt(self.coloured_share) * coloured
            return true_um + self.rms_um * parts
        if self.kind == "quantised":
            # Of the variance three quarters are rounding (step^2 / 12), a quarter is noise before it.
            step = 3.0 * self.rms_um
            return step * np.round((true_um + 0.5 * self.rms_um * white) / step)
        if self.kind == "proportional":
            size = 0.2 + np.abs(true_um) / self.reach_um
            return true_um + self.rms_um * white * size / np.sqrt(np.mean(size**2))
        raise ValueError(f"noise {self.kind!r}, one of {NOISE_KINDS}")


def flicker(n: int, rng: np.random.Generator) -> np.ndarray:
    """Return noise of a spectrum 1/f down to one period in four records, of rms 1 on average."""
    n_whole = 4 * n
    spectrum = np.fft.rfft(rng.standard_normal(n_whole))
    frequency = np.arange(1, spectrum.size)
    spectrum[0] = 0.0
    spectrum[1:] *= frequency**-0.5 / np.sqrt(2.0 * np.sum(1.0 / frequency) / n_whole)
    return np.fft.irfft(spectrum, n_whole)[:n]


def walk(n: int, n_reference: int, rng: np.random.Generator) -> np.ndarray:
    """Return a random walk of an rms of 1 about its mean over the reference length, on average."""
    # The variance of a walk of n steps about its own mean is n / 6.
    return np.cumsum(rng.standard_normal(n)) / np.sqrt(n_reference / 6.0)


def draw_noise(kind: str, rms_um: float, n_reference: int, reach_um: float, rng: np.random.Generator) -> SensorNoise:
    """Draw the rest of a sensor's noise: a correlation of 2 to 30 samples, a coloured share of 0.3 to 0.9."""
    correlation = float(np.exp(-1.0 / log_uniform(rng, 2.0, 30.0)))
    return SensorNoise(kind, rms_um, correlation, rng.uniform(0.3, 0.9), n_reference, reach_um)

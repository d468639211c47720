"""Sensor noise of the truth: coloured, of a stated rms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter


@dataclass(frozen=True)
class Noise:
    """Noise of an rms [um]: first-order autoregressive, with a share of its variance falling as 1/f."""

    rms_um: float
    correlation: float
    flicker_share: float

    def draw(self, n_samples: int, rng: np.random.Generator) -> np.ndarray:
        """Return one realisation [um], shape (n_samples,)."""
        n_lead = 200
        white = rng.standard_normal(n_samples + n_lead)
        quick = lfilter([np.sqrt(1.0 - self.correlation**2)], [1.0, -self.correlation], white)[n_lead:]
        spectrum = np.fft.rfft(rng.standard_normal(n_samples))
        spectrum[0] = 0.0
        spectrum[1:] /= np.sqrt(np.arange(1, spectrum.size))
        flicker = np.fft.irfft(spectrum, n_samples)
        flicker /= np.sqrt(np.mean(flicker**2))
        return self.rms_um * (np.sqrt(1.0 - self.flicker_share) * quick + np.sqrt(self.flicker_share) * flicker)


def draw_noise(rms_um: float, rng: np.random.Generator) -> Noise:
    """Draw the colour of the noise; half of all sensors have some 1/f in them."""
    flicker_share = rng.uniform(0.0, 0.08) if rng.random() < 0.5 else 0.0
    return Noise(rms_um, rng.uniform(0.0, 0.5), flicker_share)

"""How large, how fast and how long: the scales of one laboratory's bench."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

POLARITIES = ("unipolar", "bipolar", "skewed")
_EXTENTS = {  # stroke [um], largest voltage [V], rate [Hz]
    "any": ((1e-2, 2e4), (1.0, 1e4), (0.1, 1e5)),
    "usual": ((5.0, 20.0), (10.0, 150.0), (1000.0, 1000.0)),
}
_LEAST_UM_PER_V = 2e-4  # of one plate of a ceramic that has hysteresis: 0.2 nm/V


@dataclass(frozen=True)
class Scale:
    """Scales of a bench.

    Args:
        stroke_um: displacement over the whole range of the drive [um].
        low_v, high_v: range of the drive [V]; 0 V is in it.
        rate_hz: sampling rate of the training record [Hz].
        n_samples: length of the training record.
        noise_share: rms of the sensor noise over the stroke.
    """

    stroke_um: float
    low_v: float
    high_v: float
    rate_hz: float
    n_samples: int
    noise_share: float

    @property
    def span_v(self) -> float:
        """Range of the drive [V]."""
        return self.high_v - self.low_v

    @property
    def reach_v(self) -> float:
        """Largest voltage of either sign [V]."""
        return max(self.high_v, -self.low_v)

    @property
    def step_s(self) -> float:
        """Time between samples of the training record [s]."""
        return 1.0 / self.rate_hz

    @property
    def duration_s(self) -> float:
        """Length of the training record [s]."""
        return self.n_samples / self.rate_hz

    @property
    def noise_um(self) -> float:
        """Rms of the sensor noise [um]."""
        return self.noise_share * self.stroke_um


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw evenly over the logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def chance(seed: int, purpose: str) -> np.random.Generator:
    """Return the source of chance of one purpose: one more purpose changes nothing of the others."""
    return np.random.default_rng([seed, zlib.crc32(purpose.encode())])


def draw_scale(
    rng: np.random.Generator,
    n_samples: tuple[int, int] = (200, 100_000),
    polarity: str | None = None,
    extent: str = "any",
) -> Scale:
    """Draw a bench.

    Args:
        rng: source of chance.
        n_samples: least and most samples of the training record.
        polarity: one of POLARITIES; at random where None.
        extent: "any" (10 nm to 20 mm, 1 V to 10 kV, 0.1 Hz to 100 kHz) or "usual" (micrometres, 10 to 150 V, 1 kHz).
    """
    if extent not in _EXTENTS:
        raise ValueError(f"extent {extent!r}, one of {tuple(_EXTENTS)}")
    strokes_um, voltages_v, rates_hz = _EXTENTS[extent]
    stroke_um, largest_v = log_uniform(rng, *strokes_um), log_uniform(rng, *voltages_v)
    while stroke_um < _LEAST_UM_PER_V * largest_v:
        stroke_um, largest_v = log_uniform(rng, *strokes_um), log_uniform(rng, *voltages_v)
    drawn = POLARITIES[int(rng.integers(len(POLARITIES)))]
    share = {"unipolar": 0.0, "bipolar": 1.0, "skewed": rng.uniform(0.1, 0.4)}[polarity or drawn]
    return Scale(
        stroke_um=stroke_um,
        low_v=-share * largest_v,
        high_v=largest_v,
        rate_hz=log_uniform(rng, *rates_hz),
        n_samples=round(log_uniform(rng, *n_samples)),
        noise_share=log_uniform(rng, 3e-5, 1e-3),
    )

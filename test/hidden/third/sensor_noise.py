"""Noise of sensors, by kind, all of one rms."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from scipy.signal import butter, lfilter, sosfilt

from test.hidden.third.arrays import Array

Noise = Callable[[np.random.Generator, Array, float], Array]


def _unit(noise: Array) -> Array:
    centred = noise - noise.mean()
    return np.asarray(centred / np.sqrt(np.mean(centred**2)))


def _white(rng: np.random.Generator, clean: Array, share: float) -> Array:
    return rng.standard_normal(clean.size)


def _ar1(rng: np.random.Generator, clean: Array, share: float) -> Array:
    memory = 0.5 + 0.45 * share
    return np.asarray(lfilter([np.sqrt(1.0 - memory**2)], [1.0, -memory], rng.standard_normal(clean.size)))


def _flicker(rng: np.random.Generator, clean: Array, share: float) -> Array:
    spectrum = np.fft.rfft(rng.standard_normal(2 * clean.size))
    spectrum[1:] /= np.sqrt(np.arange(1, spectrum.size))
    spectrum[0] = 0.0
    flicker = _unit(np.fft.irfft(spectrum)[: clean.size])
    return 0.8 * flicker + 0.6 * rng.standard_normal(clean.size)


def _walk(rng: np.random.Generator, clean: Array, share: float) -> Array:
    walk = np.cumsum(rng.standard_normal(clean.size))
    part = 0.3 + 0.4 * share
    return part * (walk - walk[0]) / np.std(walk) + np.sqrt(1.0 - part**2) * rng.standard_normal(clean.size)


def _quantised(rng: np.random.Generator, clean: Array, share: float) -> Array:
    part = 0.5 + 0.4 * share
    step = part * np.sqrt(12.0)
    read = clean + np.sqrt(1.0 - part**2) * rng.standard_normal(clean.size)
    return np.asarray(step * np.round(read / step) - clean)


def _heteroscedastic(rng: np.random.Generator, clean: Array, share: float) -> Array:
    size = 0.3 + np.abs(clean) / np.max(np.abs(clean))
    return np.asarray(size / np.sqrt(np.mean(size**2)) * rng.standard_normal(clean.size))


def _popcorn(rng: np.random.Generator, clean: Array, share: float) -> Array:
    toggles = rng.random(clean.size) < 1.0 / (30.0 + 400.0 * share)
    level = np.where(np.cumsum(toggles) % 2 == 0, -1.0, 1.0)
    return 0.7 * level + np.sqrt(0.51) * rng.standard_normal(clean.size)


def _low_passed(rng: np.random.Generator, clean: Array, share: float) -> Array:
    sos = butter(2, 2.0 * (0.05 + 0.25 * share), output="sos")
    return _unit(sosfilt(sos, rng.standard_normal(clean.size + 200))[200:])


_KINDS: Mapping[str, Noise] = {
    "white": _white,
    "ar1": _ar1,
    "flicker": _flicker,
    "walk": _walk,
    "quantised": _quantised,
    "heteroscedastic": _heteroscedastic,
    "popcorn": _popcorn,
    "low_passed": _low_passed,
}
NOISE_KINDS = tuple(_KINDS)


def draw_noise(rng: np.random.Generator, kind: str, clean_um: Array, noise_um: float, share: float) -> Array:
    """Draw the noise of a record [um].

    Args:
        rng: source of chance.
        kind: one of NOISE_KINDS.
        clean_um: what is read without it; some kinds depend on it.
        noise_um: rms.
        share: 0 to 1, how marked what is special to the kind is; the same in all records of a sensor.
    """
    return noise_um * _KINDS[kind](rng, clean_um / noise_um, share)

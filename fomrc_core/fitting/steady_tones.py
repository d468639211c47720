"""Steady tones, such as mains hum, in what a first fit leaves of a long record, told at the record's own rate.

Kept samples are neither even nor do means of bins belong to their times: a tone must be known before a record is
thinned. Candidates are lines of the averaged spectrum of stretches (Welch, "The use of fast Fourier transform for the
estimation of power spectra", IEEE Transactions on Audio and Electroacoustics 15 (1967) 70). A tone is a line that keeps
amplitude and phase through all stretches; what rings after jumps of the drive, and what is left of a motion that lasts
for a part of the record, does not. How the phase goes on from stretch to stretch is the frequency.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from fomrc_core.compute.arrays import Array, ComplexArray
from fomrc_core.effects.base.spectra import DriveLines

_N_TONES_MAX = 6
_N_CANDIDATES = 16  # lines looked at for each tone: turns of the drive leave lines as well
_N_STRETCHES = 16  # at least: as many phases tell a tone from chance
_SHORTEST, _LONGEST = 1 << 11, 1 << 17  # samples of a stretch
_LEAST_CYCLES = 6  # of a tone in a stretch: fewer are hardly apart from what is slow
_N_AROUND = 40  # frequencies on either side that say what the noise is there
_SIGNIFICANCE = 1e-4  # of the hypothesis that there is no line in the spectrum
_LINE_POWER = 1.5  # times the noise at its frequency, at least
# Power of the mean of all stretches, of the mean of their powers: 1 for a tone, and 1 / n for what has no phase. A
# motion that lasts for half of the record comes to a half.
_STEADY = 0.8
_PADDING = 16


@dataclass(frozen=True)
class SteadyTone:
    """A tone a sin(2 pi f t + p) in the readings of a record, t from its first sample.

    Attributes:
        record: name of the record.
        frequency_hz: f [Hz].
        amplitude_um: a [um].
        phase_rad: p [rad].
    """

    record: str
    frequency_hz: float
    amplitude_um: float
    phase_rad: float

    def at(self, since_s: Array) -> Array:
        """Return the tone [um] at times from the first sample on [s], shape (n,)."""
        return np.asarray(self.amplitude_um * np.sin(2.0 * np.pi * self.frequency_hz * since_s + self.phase_rad))

    def sentence(self) -> str:
        """Return what it is and what was done with it."""
        return (
            f"{self.record}: a steady tone of {self.frequency_hz:.6g} Hz and {1e3 * self.amplitude_um:.4g} nm, apart "
            "from the drive, was taken out of the readings before they were thinned; no cause is named for it"
        )


def steady_tones(record: str, left_um: Array, step_s: float, drive_v: Array, drive_step_s: float) -> list[SteadyTone]:
    """Return the steady tones in what a model leaves of a record that are not its drive's, the clearest first.

    Args:
        record: its name.
        left_um: what the model leaves [um], evenly sampled, shape (n_samples,).
        step_s: sample period [s].
        drive_v: drive [V], as slow as its fastest motion allows, shape (n_drive,).
        drive_step_s: sample period of that [s].
    """
    n_stretch = int(np.clip(2 ** math.floor(math.log2(left_um.size / _N_STRETCHES)), _SHORTEST, _LONGEST))
    if left_um.size < _N_STRETCHES * n_stretch:
        return []
    left_um = np.asarray(left_um - np.mean(left_um), dtype=np.float64)
    lines: DriveLines | None = None
    found: list[SteadyTone] = []
    while len(found) < _N_TONES_MAX:
        stretches = left_um[: left_um.size // n_stretch * n_stretch].reshape(-1, n_stretch)
        for frequency_hz in _lines(stretches, step_s):
            tone = _steady(record, stretches, step_s, frequency_hz)
            if tone is None:
                continue
            lines = lines or DriveLines.of(drive_v, drive_step_s)
            # whatever its height: what is left of a record of millions of samples is seen far below hysteresis
            if not lines.may_reach(tone.frequency_hz, 0.0, 1.0):
                break
        else:
            break
        left_um = np.asarray(left_um - tone.at(np.arange(left_um.size, dtype=np.float64) * step_s))
        found.append(tone)
    return found


def _lines(stretches: Array, step_s: float) -> Iterator[float]:
    """Yield the frequencies [Hz] of the lines that stand out most of the averaged spectrum, the highest first."""
    from scipy.ndimage import median_filter  # slow to import; a model that is only run needs none

    n_stretches, n = stretches.shape
    window = np.hanning(n)
    power = np.zeros(n // 2 + 1)
    for stretch in stretches:
        power += np.abs(np.fft.rfft((stretch - stretch.mean()) * window)) ** 2
    height = power / np.maximum(median_filter(power, 2 * _N_AROUND + 1, mode="nearest"), 1e-300)
    n_degrees = 2.0 * n_stretches
    level = max(float(chi2.isf(_SIGNIFICANCE / power.size, n_degrees)) / n_degrees, _LINE_POWER)
    is_top = (height[1:-1] > level) & (power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:])
    is_top[: _LEAST_CYCLES - 1] = False
    tops = np.flatnonzero(is_top) + 1
    for top in sorted(tops, key=lambda k: -height[k])[:_N_CANDIDATES]:
        left, middle, right = np.log(power[top - 1 : top + 2] + 1e-300)
        yield float((top + 0.5 * (left - right) / (left - 2.0 * middle + right)) / (n * step_s))


def _steady(record: str, stretches: Array, step_s: float, near_hz: float) -> SteadyTone | None:
    """Return the tone near a frequency [Hz]; None where what is there is not steady."""
    n_stretches, n = stretches.shape
    length_s = n * step_s
    number = np.arange(n_stretches)
    heights = _heights(stretches, step_s, near_hz)
    zoomed = np.fft.fft(heights, _PADDING * n_stretches)
    top = int(np.argmax(np.abs(zoomed)))
    steadiness = float(np.abs(zoomed[top])) ** 2 / (n_stretches * float(np.sum(np.abs(heights) ** 2)) + 1e-300)
    if steadiness < _STEADY:
        return None
    frequency_hz = near_hz + float(np.fft.fftfreq(_PADDING * n_stretches, length_s)[top])
    heights = _heights(stretches, step_s, frequency_hz)
    turned = np.angle(heights * np.conj(np.sum(heights)))
    off = number - np.mean(number)
    frequency_hz += float(np.sum(off * turned) / np.sum(off**2)) / (2.0 * np.pi * length_s)
    height = complex(np.mean(_heights(stretches, step_s, frequency_hz)))
    return SteadyTone(record, frequency_hz, abs(height), math.atan2(height.imag, height.real) + 0.5 * math.pi)


def _heights(stretches: Array, step_s: float, frequency_hz: float) -> ComplexArray:
    """Return the complex amplitude at a frequency [Hz] in each stretch [um], phases from the first sample on."""
    n_stretches, n = stretches.shape
    window = np.hanning(n)
    turn = -2.0j * np.pi * frequency_hz * step_s
    one = window * np.exp(turn * np.arange(n))
    each = stretches @ one.real + 1.0j * (stretches @ one.imag)
    return np.asarray(2.0 / np.sum(window) * each * np.exp(turn * n * np.arange(n_stretches)))

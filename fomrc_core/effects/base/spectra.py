"""Spectra that trial instances are read from: lines that stand out of a residual, lines a drive is made of.

A spectrum is measured in cells of one over the record's length, the resolution; no frequency is known better
beforehand, whatever the sampling.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array

_PADDING = 4  # bins a cell: a line between two cells of a plain transform would lose a third of its height
_NARROWEST, _WIDEST = 16, 200  # cells of a neighbourhood: a median of fewer is chance, one of more no neighbourhood
_CHANCE = 0.05  # of a line in a whole spectrum of noise
_LINE_REACH = 10  # cells beside a line in which its window leaks


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Amplitudes of a signal over frequency, several bins to a cell of resolution.

    Attributes:
        frequency_hz: frequencies [Hz], shape (n_bins,).
        amplitude: of a sine at each [unit of the signal], shape (n_bins,).
        resolution_hz: one over the length of the record [Hz].
    """

    frequency_hz: Array
    amplitude: Array
    resolution_hz: float

    @classmethod
    def of(cls, values: Array, step_s: float) -> Spectrum:
        """Return the spectrum of a signal, shape (n_samples,), sampled every ``step_s`` [s], its mean taken out."""
        n = values.size
        window = np.hanning(n)
        transformed = np.fft.rfft((values - np.mean(values)) * window, _PADDING * n)
        amplitude = 2.0 * np.abs(transformed) / max(float(np.sum(window)), 1e-300)
        return cls(
            np.fft.rfftfreq(_PADDING * n, step_s).astype(np.float64),
            np.asarray(amplitude, dtype=np.float64),
            1.0 / (n * step_s),
        )

    def standing(self) -> Array:
        """Return how many times as high each bin is as the median of its neighbourhood, shape (n_bins,).

        Neighbourhoods grow with frequency: what is left of hysteresis and creep falls steeply at low ones.
        """
        edges = [0]
        while edges[-1] < self.amplitude.size:
            cells = min(max(_NARROWEST, edges[-1] // (2 * _PADDING)), _WIDEST)
            edges.append(edges[-1] + _PADDING * cells)
        edges[-1] = self.amplitude.size
        pairs = [(a, b) for a, b in itertools.pairwise(edges) if b > a]
        medians = [float(np.median(self.amplitude[a:b])) for a, b in pairs]
        centres = [0.5 * (a + b) for a, b in pairs]
        level = np.interp(np.arange(self.amplitude.size), centres, medians)
        return np.asarray(self.amplitude / (level + 1e-300))

    @property
    def least_standing(self) -> float:
        """How many times as high as its neighbourhood a line is: noise comes as high anywhere once in twenty records.

        Amplitudes of noise are Rayleigh distributed, P(a > x) = exp(-x^2 / 2), median sqrt(2 ln 2).
        """
        return float(np.sqrt(np.log(self._n_cells / _CHANCE) / np.log(2.0)))

    def chance_of(self, standing: float) -> float:
        """Return the probability that noise stands so many times as high as its neighbourhood anywhere."""
        return float(np.clip(self._n_cells * np.exp2(-(standing**2)), 1e-300, 1.0))

    @property
    def _n_cells(self) -> int:
        return max(self.amplitude.size // _PADDING, 1)

    def lines(self, least_hz: float, n_lines: int) -> list[float]:
        """Return the frequencies of the lines that stand out most [Hz], the highest first.

        Args:
            least_hz: no line below this [Hz].
            n_lines: how many at most.
        """
        least_standing = self.least_standing
        height = np.where(self.frequency_hz > least_hz, self.standing(), 0.0)
        reach = _LINE_REACH * _PADDING
        found: list[float] = []
        while len(found) < n_lines:
            peak = int(np.argmax(height))
            if not height[peak] >= least_standing:
                break
            if 0 < peak < height.size - 1:  # a bin beside a higher one that was taken before is no line
                found.append(self._top(peak))
            height[max(0, peak - reach) : peak + reach + 1] = 0.0
        return found

    def _top(self, peak: int) -> float:
        """Return where the parabola through a bin and its neighbours is highest [Hz]."""
        left, top, right = self.amplitude[peak - 1 : peak + 2]
        curvature = left - 2.0 * top + right
        offset = 0.5 * (left - right) / curvature if curvature < 0.0 else 0.0
        return float(self.frequency_hz[peak] + offset * (self.frequency_hz[1] - self.frequency_hz[0]))


# Beside standing out:
_LEAST_SHARE = 0.01  # of the drive's power in one cell: a sine, a multisine of some lines; no sweep and no noise
# A play bends the response at corners, so that harmonics of the drive fall with their number squared, and all of
# hysteresis is no more than this share of a stroke: what is higher at a harmonic is none, however much is left.
_HARMONIC_SHARE = 0.3
_LEFT_SHARE = 0.01  # of a line, anywhere among its harmonics: what else a model may get wrong of a motion
_N_DRIVE_HARMONICS = 20


@dataclass(frozen=True, eq=False)
class DriveLines:
    """The frequencies a drive keeps up all through a record.

    Attributes:
        frequency_hz: of each [Hz], shape (n_lines,).
        amplitude_v: of each [V], shape (n_lines,).
        resolution_hz: one over the length of the record [Hz].
    """

    frequency_hz: Array
    amplitude_v: Array
    resolution_hz: float

    @classmethod
    def of(cls, voltage_v: Array, step_s: float) -> DriveLines:
        """Return the lines of a drive [V], shape (n_samples,), sampled every ``step_s`` [s]."""
        spectrum = Spectrum.of(voltage_v, step_s)
        inner = spectrum.amplitude[1:-1]
        is_top = (inner >= spectrum.amplitude[:-2]) & (inner > spectrum.amplitude[2:])
        is_line = is_top & (0.5 * inner**2 >= _LEAST_SHARE * float(np.var(voltage_v)))
        is_line &= spectrum.standing()[1:-1] >= spectrum.least_standing
        return cls(spectrum.frequency_hz[1:-1][is_line], inner[is_line], spectrum.resolution_hz)

    def has(self, frequency_hz: float) -> bool:
        """Return whether a frequency is within the resolution of one of the lines."""
        return bool(np.any(np.abs(self.frequency_hz - frequency_hz) <= self.resolution_hz))

    def may_reach(self, frequency_hz: float, amplitude_um: float, gain_um_per_v: float) -> bool:
        """Return whether a tone may be a line of the drive, or a harmonic that hysteresis makes of one.

        Args:
            frequency_hz: of the tone.
            amplitude_um: of the tone.
            gain_um_per_v: of the actuator.
        """
        number = np.arange(2, _N_DRIVE_HARMONICS + 1)
        share = np.maximum(_HARMONIC_SHARE / number**2, _LEFT_SHARE)
        highest_um = gain_um_per_v * self.amplitude_v[:, None] * share
        is_near = np.abs(self.frequency_hz[:, None] * number - frequency_hz) <= self.resolution_hz
        return self.has(frequency_hz) or bool(np.any(is_near & (highest_um >= amplitude_um)))

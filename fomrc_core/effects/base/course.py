"""A course that is known as a whole: evenly sampled, so that linear effects are undone by their frequency response.

What is undone here takes what needs the future from the samples to come. Between the samples a converter goes straight,
which no frequency response of the samples holds: near half the sample rate the inverse would follow its own zeros, so
nothing is undone there (``FLAT``, ``GONE``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from fomrc_core.compute.arrays import Array, ComplexArray

# Of the sample rate: up to the first all is undone, beyond the second nothing. A straight line from sample to sample
# differs from the course it stands for by 1 - sinc^2: 13 % at the first, half at the second.
FLAT, GONE = 0.2, 0.4
_LEAST_PAD = 2048  # samples beyond either end
_PAD = 0.25  # of the course, beyond either end

Gain = Callable[[Array], ComplexArray]


def low_pass(frequency_hz: Array, flat_hz: float, gone_hz: float) -> Array:
    """Return the gain of a zero-phase low-pass [1]: one, a half cosine, zero; no overshoot worth the name.

    Args:
        frequency_hz: frequencies [Hz], any shape.
        flat_hz: up to here all passes [Hz].
        gone_hz: from here on nothing does [Hz], above ``flat_hz``.
    """
    along = np.clip((frequency_hz - flat_hz) / (gone_hz - flat_hz), 0.0, 1.0)
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * along))


@dataclass(frozen=True)
class Course:
    """The even samples of a course that is known as a whole.

    Attributes:
        n_samples: number of samples.
        step_s: their distance [s].
        is_periodic: whether the sample after the last is the first; else it has ends.
        flat, gone: the band in which linear effects are undone, shares of the sample rate.
    """

    n_samples: int
    step_s: float
    is_periodic: bool = False
    flat: float = FLAT
    gone: float = GONE

    @property
    def steps_s(self) -> Array:
        """Step that leads to each sample [s], shape (n_samples,)."""
        return np.full(self.n_samples, self.step_s)

    def tiled(self, n_periods: int) -> Course:
        """Return the course that repeats this one."""
        return replace(self, n_samples=n_periods * self.n_samples)

    def refined(self, n_parts: int) -> Course:
        """Return the same course, each step in equal parts; its band is the same in Hz."""
        return replace(
            self,
            n_samples=n_parts * self.n_samples,
            step_s=self.step_s / n_parts,
            flat=self.flat / n_parts,
            gone=self.gone / n_parts,
        )

    def in_parts(self, values: Array, n_parts: int) -> Array:
        """Return the values in parts of each step, from the first sample on, shape (n_parts n_samples,).

        Nothing is in them beyond half the sample rate; samples stay as they are.
        """
        n_before, padded = self._circle(values)
        fine = n_parts * irfft(rfft(padded), n_parts * padded.size)
        return np.ascontiguousarray(fine[n_parts * n_before : n_parts * (n_before + self.n_samples)])

    def filtered(self, values: Array, gain: Gain) -> Array:
        """Return values that have passed a linear filter, shape (n_samples,).

        Args:
            values: shape (n_samples,).
            gain: complex gain at frequencies [Hz], of one shape.
        """
        n_before, padded = self._circle(values)
        frequency_hz = rfftfreq(padded.size, self.step_s)
        passed = irfft(rfft(padded) * gain(frequency_hz), padded.size)
        return np.ascontiguousarray(passed[n_before : n_before + self.n_samples])

    def filtered_together(self, values: Array, gain: Gain) -> Array:
        """Return several courses that have passed a filter with as many inputs, shape (n_samples, n_outputs).

        Args:
            values: shape (n_samples, n_inputs).
            gain: complex gain at frequencies [Hz], (n,) to (n, n_outputs, n_inputs).
        """
        circles = [self._circle(column) for column in values.T]
        n_before, padded = circles[0][0], np.stack([circle for _, circle in circles], axis=1)
        spectrum = rfft(padded, axis=0)
        passed = irfft(np.einsum("foi,fi->fo", gain(rfftfreq(len(padded), self.step_s)), spectrum), len(padded), axis=0)
        return np.ascontiguousarray(passed[n_before : n_before + self.n_samples])

    def undone(self, values: Array, response: Gain) -> Array:
        """Return what a linear effect turns into these values, in the band that samples hold, shape (n_samples,)."""
        return self.filtered(values, lambda frequency_hz: self._band(frequency_hz) / response(frequency_hz))

    def in_band(self, values: Array) -> Array:
        """Return values less what is beyond the band, shape (n_samples,)."""
        return self.filtered(values, lambda frequency_hz: self._band(frequency_hz).astype(np.complex128))

    def rate(self, values: Array) -> Array:
        """Return the rate of change [1/s] at each sample, shape (n_samples,)."""
        return self.filtered(values, lambda frequency_hz: self._band(frequency_hz) * (2j * np.pi * frequency_hz))

    def _band(self, frequency_hz: Array) -> Array:
        return low_pass(frequency_hz, self.flat / self.step_s, self.gone / self.step_s)

    @property
    def n_beyond(self) -> int:
        """Number of samples beyond either end into which a filter may reach; a period of a periodic one."""
        return self.n_samples if self.is_periodic else max(_LEAST_PAD, int(_PAD * self.n_samples))

    def _circle(self, values: Array) -> tuple[int, Array]:
        return (0, values) if self.is_periodic else self._padded(values)

    def _padded(self, values: Array) -> tuple[int, Array]:
        # Beyond either end it goes on point-symmetrically, without a corner of its own where it is cut in mid-motion;
        # then it is held, and returns smoothly from the last value to the first: a transform knows circles alone.
        n_pad = self.n_beyond
        n_mirror = min(values.size - 1, n_pad)
        n_all = next_fast_len(values.size + 3 * n_pad, real=True)
        n_return = n_all - values.size - 2 * n_pad
        start = np.pad(2.0 * values[0] - values[n_mirror:0:-1], (n_pad - n_mirror, 0), mode="edge")
        end = np.pad(2.0 * values[-1] - values[-2 : -2 - n_mirror : -1], (0, n_pad - n_mirror), mode="edge")
        back = 0.5 + 0.5 * np.cos(np.pi * (np.arange(n_return) + 0.5) / n_return)
        returning = start[0] + (end[-1] - start[0]) * back
        return n_pad, np.concatenate((start, values, end, returning))

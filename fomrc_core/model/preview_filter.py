"""A filter that undoes linear dynamics on a live signal, some samples of whose future are known.

The taps h_j, j = -n_behind .. n_ahead, give the filter H(f) = sum_j h_j exp(2 pi i f j T) that leaves the least of

    sum_f  w(f)^2 |H(f) G(f) - B(f)|^2 + r^2 |H(f)|^2 beyond B,        G the dynamics, B a zero-phase low-pass

by least squares, w falling with frequency as the spectra of motion do. However short a preview, it gets the best filter
there is with it; what that is worth is told beside it (``holds_to_hz``). Slow motion passes exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array, ComplexArray
from fomrc_core.compute.least_squares import NormalEquations
from fomrc_core.effects.base.course import FLAT, GONE, low_pass

# Where dynamics take more than this to undo, the filter ends: thrice the voltage of slow motion is no longer tame.
LARGEST_GAIN = 3.0
_HELD = 0.01  # error of the gain that counts as held
_N_FREQUENCIES = 1024
# Where weights stop to rise towards slow motion, of the sample rate: below it some hundred taps see a straight line.
_SLOW = 0.003
_BESIDE = 0.1  # weight beyond the flat part, of that within
_LEAST_PENALTY = 1e-3  # of gains beyond the band, beside errors of one within
_MOST_PENALTIES = 24  # a doubling each: from next to nothing to all there is
_MOST_TAPS_BEHIND = 64
_MOST_TAPS_AHEAD = 96  # beyond the delay


@dataclass(frozen=True, eq=False)
class PreviewFilter:
    """Taps over the past and the known future of a signal.

    Attributes:
        taps: in the order of time, the oldest sample's first, shape (n_behind + 1 + n_ahead,).
        n_ahead: number of future samples used.
        holds_to_hz: up to here gain and phase are right to one per cent [Hz]; 0 where nowhere.
        reaches_hz: up to here dynamics could be undone with all the preview there may be [Hz].
    """

    taps: Array
    n_ahead: int
    holds_to_hz: float
    reaches_hz: float

    @property
    def n_behind(self) -> int:
        """Number of past samples used, the present one left out."""
        return int(self.taps.size) - 1 - self.n_ahead

    def gain(self, frequency_hz: Array, step_s: float) -> ComplexArray:
        """Return its complex gain [1] at frequencies [Hz], of one shape.

        Args:
            frequency_hz: frequencies [Hz], shape (n,).
            step_s: distance of the samples [s].
        """
        at = np.arange(-self.n_behind, self.n_ahead + 1)
        return np.asarray(np.exp(2j * np.pi * step_s * np.outer(frequency_hz, at)) @ self.taps)


def preview_filter(
    response: Callable[[Array], ComplexArray], step_s: float, n_preview: int, flat: float = FLAT
) -> PreviewFilter:
    """Return the filter that undoes dynamics as well as so many samples of preview let it.

    Args:
        response: complex gain of the dynamics at frequencies [Hz], one at rest.
        step_s: distance of the samples [s].
        n_preview: samples of the future that are known, 0 or more.
        flat: share of the sample rate up to which all is undone, at most; beyond twice that nothing is.
    """
    frequency_hz = np.linspace(0.0, 0.5 / step_s, _N_FREQUENCIES)
    gain = response(frequency_hz)
    flat_hz = _flat_hz(frequency_hz, gain, flat / step_s)
    n_late = int(np.ceil(max(_late_s(response, step_s), 0.0) / step_s))
    n_ahead = min(n_preview, n_late + _MOST_TAPS_AHEAD)
    lags = np.arange(-_MOST_TAPS_BEHIND, n_ahead + 1, dtype=np.int64)
    waves = np.exp(2j * np.pi * step_s * np.outer(frequency_hz, lags))
    taps = _fitted(frequency_hz * step_s, gain, flat_hz * step_s, lags, waves)
    is_off = np.abs((waves @ taps) * gain - 1.0) > _HELD
    holds_to_hz = float(frequency_hz[max(int(np.argmax(is_off)) - 1, 0)]) if np.any(is_off) else 0.5 / step_s
    return PreviewFilter(taps, n_ahead, holds_to_hz, flat_hz)


def _flat_hz(frequency_hz: Array, gain: ComplexArray, most_hz: float) -> float:
    """Return where the band ends [Hz]: the most there may be, or where undoing takes more than ``LARGEST_GAIN``."""
    too_much = np.abs(gain) * LARGEST_GAIN < 1.0
    first_hz = float(frequency_hz[int(np.argmax(too_much))]) if np.any(too_much) else np.inf
    return min(most_hz, 0.5 * first_hz)


def _late_s(response: Callable[[Array], ComplexArray], step_s: float) -> float:
    """Return by how much slow motion comes late [s]."""
    slow_hz = 1e-4 / step_s
    return float(-np.angle(response(np.array([slow_hz]))[0]) / (2.0 * np.pi * slow_hz))


def _fitted(frequency: Array, gain: ComplexArray, flat: float, lags: NDArray[np.int64], waves: ComplexArray) -> Array:
    """Return the taps; frequencies in cycles a sample."""
    band = low_pass(frequency, flat, min(GONE / FLAT * flat, 0.5))
    weight = (_SLOW / (_SLOW + frequency)) * np.where(frequency <= flat, 1.0, _BESIDE)
    power = weight**2 * np.abs(gain) ** 2
    moment = (waves.conj().T @ (weight**2 * band * np.conj(gain))).real
    # The Gram matrix of even samples depends on how far two taps are apart.
    differences = np.cos(2.0 * np.pi * np.outer(np.arange(lags.size), frequency))
    apart = np.abs(lags[:, None] - lags[None, :])
    penalty = _LEAST_PENALTY * _SLOW
    # Little preview asks for much where nothing is gained by it: gains are made dear until they are tame.
    for _ in range(_MOST_PENALTIES):
        column = differences @ (power + penalty**2 * (1.0 - band))
        taps = NormalEquations(column[apart], moment).solution()
        taps /= np.sum(taps)
        if float(np.max(np.abs(waves @ taps))) <= LARGEST_GAIN:
            break
        penalty *= 2.0
    return taps

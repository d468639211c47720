"""The period of the commanded voltage with which what is left comes back."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fomrc_core.compute.arrays import Array

_FEWEST_CYCLES, _MOST_CYCLES = 8.0, 2000.0  # over the range of the drive
_STEP_CYCLES = 0.4  # two sines a cycle apart over the range are told apart
_N_FINER = 41  # about the highest peak
_MOST_SAMPLES = 5000
_HALF_WIDTH = 4  # samples: what runs more slowly is not what a voltage passes with its period
_CHANCE = 0.01  # that noise has so high a peak anywhere


def drive_period_v(voltages_v: Sequence[Array], left_um: Sequence[Array]) -> float | None:
    """Return the period [V]; None where noise would have as high a peak.

    The highest peak of the periodogram of what is left over voltage, in place of time (Lomb and Scargle: Astrophys. J.
    263 (1982) 835-853): of noise its height over the mean is an exponential variable at each frequency.

    Args:
        voltages_v: commanded voltage, per record, shape (n_samples,).
        left_um: what the model leaves there, of the same shapes.
    """
    low, high = min(float(np.min(v)) for v in voltages_v), max(float(np.max(v)) for v in voltages_v)
    if not high > low:
        return None
    quick = np.concatenate([_without_slow(left) for left in left_um])
    share = (np.concatenate(list(voltages_v)) - low) / (high - low)
    # pieces, not every so many samples: those of an even grid would take one frequency for another
    kept = np.arange(min(quick.size, _MOST_SAMPLES)) if quick.size <= _MOST_SAMPLES else _pieces(quick.size)
    quick, share = quick[kept], share[kept]
    power = float(np.sum(quick**2))
    if not power > 0.0:
        return None
    cycles = np.arange(_FEWEST_CYCLES, _MOST_CYCLES, _STEP_CYCLES)
    heights = _heights(quick, share, cycles) / power
    top = int(np.argmax(heights))
    if cycles.size * math.exp(-heights[top]) > _CHANCE:
        return None
    finer = cycles[top] + np.linspace(-_STEP_CYCLES, _STEP_CYCLES, _N_FINER)
    return (high - low) / float(finer[np.argmax(_heights(quick, share, finer))])


def _without_slow(left_um: Array) -> Array:
    width = 2 * _HALF_WIDTH + 1
    padded = np.pad(left_um, _HALF_WIDTH, mode="edge")
    return np.asarray(left_um - np.convolve(padded, np.full(width, 1.0 / width), mode="valid"))


def _pieces(n_samples: int) -> Array:
    """Return the numbers of the samples of some pieces, spread over all of them."""
    n_pieces = 20
    length = _MOST_SAMPLES // n_pieces
    first = np.linspace(0, n_samples - length, n_pieces).astype(np.int64)
    return np.asarray((first[:, None] + np.arange(length)).ravel())


def _heights(quick: Array, share: Array, cycles: Array) -> Array:
    """Return |sum of quick exp(2 pi i cycles share)|^2, shape (n_cycles,), of evenly spaced cycles."""
    turning = quick * np.exp(2j * np.pi * cycles[0] * share)
    turn = np.exp(2j * np.pi * (cycles[1] - cycles[0]) * share)
    found = np.empty(cycles.size)
    for k in range(cycles.size):
        total = np.sum(turning)
        found[k] = total.real**2 + total.imag**2
        turning *= turn
    return found

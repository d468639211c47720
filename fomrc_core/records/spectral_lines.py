"""Lines in a noise, such as mains hum: found by how they stand out of their neighbours, and taken out."""

from __future__ import annotations

import numpy as np

from fomrc_core.compute.arrays import Array

_N_LINES_MAX = 16
_FALSE_ALARM = 0.01
_N_NEIGHBOURS = 33
_N_MIN = 4 * _N_NEIGHBOURS


def without_lines(values: Array) -> tuple[Array, tuple[float, ...]]:
    """Return the values without the lines that stand out of their spectrum, and where these were.

    A line is one where the Hann-windowed periodogram exceeds its neighbours' level, in noise exponentially distributed,
    by more than one record in a hundred would show by chance. It is taken out by least squares of a sine and a cosine
    whose amplitudes may change linearly, which forgives an error of its frequency.

    Args:
        values: shape (n_samples,).

    Returns:
        The values without the lines, and the frequencies of the lines [cycles per sample].
    """
    x = np.asarray(values, dtype=np.float64)
    if x.size < _N_MIN:
        return x, ()
    from scipy.ndimage import median_filter  # slow to import; no node that only drives needs it

    window = np.hanning(x.size + 2)[1:-1]
    t = np.linspace(-1.0, 1.0, x.size)
    lines: list[float] = []
    for _ in range(_N_LINES_MAX):
        power = np.abs(np.fft.rfft(window * x)) ** 2
        level = median_filter(power, _N_NEIGHBOURS, mode="reflect") / np.log(2.0)
        height = power / np.maximum(level, 1e-300)
        # slow noise rises towards zero faster than the median of its neighbours can follow
        height[: _N_NEIGHBOURS // 2] = 0.0
        height[-2:] = 0.0
        top = int(np.argmax(height))
        if height[top] < np.log(power.size / _FALSE_ALARM):
            break
        left, middle, right = np.log(power[top - 1 : top + 2] + 1e-300)
        shift = float(np.clip(0.5 * (left - right) / (left - 2.0 * middle + right), -0.5, 0.5))
        frequency = (top + shift) / x.size
        phase = 2.0 * np.pi * frequency * np.arange(x.size)
        columns = np.column_stack((np.cos(phase), np.sin(phase), t * np.cos(phase), t * np.sin(phase)))
        x = x - columns @ np.linalg.lstsq(columns, x, rcond=None)[0]
        lines.append(frequency)
    return x, tuple(lines)

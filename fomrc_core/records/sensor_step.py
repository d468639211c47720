"""The step of a quantised sensor, and what quantisation hides of a noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from fomrc_core.compute.arrays import Array

_N_LOOKED_AT = 1 << 18
_ROUNDING = 1e-12
_OFF_LATTICE = 0.1
_N_LEVELS_MIN, _N_RECURRING_MIN = 3, 4
_GAP_SHARES = (0.5, 0.2, 0.05)  # of the gaps between levels, rising: which of them is taken for one step


def sensor_step_um(displacement_um: Array) -> float:
    """Return the step all readings are whole multiples of, from some origin [um]; nan where there is none.

    Args:
        displacement_um: readings [um], shape (n_samples,).
    """
    x = np.asarray(displacement_um, dtype=np.float64)
    levels, _ = _levels_of(x[:: -(-x.size // _N_LOOKED_AT)])
    if levels.size < _N_LEVELS_MIN:
        return float("nan")
    above = levels - levels[0]
    step = float(np.min(np.diff(levels)))
    # the step is refined over ever wider stretches, each narrow enough to count its steps with what is known so far
    reach = 8.0 * step
    while True:
        inside = above <= reach
        counts = np.round(above[inside] / step)
        if np.any(counts > 0.0):
            step = float(np.dot(counts, above[inside]) / np.dot(counts, counts))
        if inside.all():
            break
        reach *= 8.0
    off = np.abs(above / step - np.round(above / step))
    return step if float(np.max(off)) <= _OFF_LATTICE else float("nan")


def recurring_step_um(displacement_um: Array) -> float:
    """Return the step of a quantised sensor [um], faulty readings left out; nan where it has none.

    Readings of a coarse sensor come back; what comes once only may be a spike, and a dropout is one value in many.
    """
    levels, counts = _levels_of(displacement_um)
    levels = levels[counts > 1]
    if np.sum(counts[counts > 1]) < 0.5 * displacement_um.size or levels.size < _N_RECURRING_MIN:
        return float("nan")
    apart = np.diff(levels)
    # where a fast motion visits few of the levels most gaps are several steps wide, and the least is one
    for share in _GAP_SHARES:
        step = float(np.quantile(apart, share, method="lower"))
        on_lattice = np.abs(apart / step - np.round(apart / step)) < _OFF_LATTICE
        if float(np.mean(on_lattice)) > 1.0 - _OFF_LATTICE:
            return step
    return float("nan")


def _levels_of(readings_um: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the levels of readings, rising, and how often each was read, shapes (n_levels,).

    A level from which something was taken since, as where a record begins, is the same to rounding only.
    """
    values, counts = np.unique(readings_um, return_counts=True)
    rounding = _ROUNDING * float(np.max(np.abs(values), initial=0.0))
    first = np.flatnonzero(np.concatenate(([True], np.diff(values) > rounding)))
    return values[first], np.add.reduceat(counts, first)


def unquantised_variance_um2(seen_um2: float, step_um: float) -> float:
    """Return the variance a noise has before a quantiser, from what is seen of it when a signal repeats [um^2].

    Two readings of one signal share its quantisation error as far as their noise does not part them: half the mean
    square difference of two readings is ``s q / sqrt(pi)`` for noise far below the step and ``s^2 + q^2 / 12`` far
    above it, the signal evenly spread over the steps (Widrow & Kollar, "Quantization Noise", 2008, ch. 4).

    Args:
        seen_um2: half the mean square difference of readings of one signal [um^2].
        step_um: step of the quantiser [um].
    """
    if not step_um > 0.0 or seen_um2 <= 0.0:
        return max(seen_um2, 0.0)
    seen = seen_um2 / step_um**2
    if seen > 10.0:
        return seen_um2 - step_um**2 / 12.0
    if seen < 1e-4:
        return float(np.pi * (seen * step_um) ** 2)
    # a noise of s steps shows at least s^2
    spread = float(brentq(lambda s: _seen(s) - seen, 1e-6, 1.001 * np.sqrt(seen)))
    return float((spread * step_um) ** 2)


def _seen(spread: float) -> float:
    """Return half the mean square difference of two readings, in steps, for a noise of this rms in steps."""
    width = np.sqrt(2.0) * spread
    size = np.linspace(0.0, 8.0 * width, 4001)
    whole = np.floor(size)
    part = size - whole
    square = whole**2 * (1.0 - part) + (whole + 1.0) ** 2 * part
    density = np.exp(-0.5 * (size / width) ** 2) / (np.sqrt(2.0 * np.pi) * width)
    return float(np.trapezoid(square * density, size))

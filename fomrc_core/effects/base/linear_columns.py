"""Linear dynamics of many inputs at once: what a fit asks of each of its columns.

One input after the other waits for every sample of itself; side by side a processor works on several at a time, and
each sample is read as it lies in memory. Agrees with ``linear_modes`` and ``kernels.run_delay`` to rounding.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.compiled import compiled_sums
from fomrc_core.compute.pulse import beat
from fomrc_core.effects.base.kernels import lag_shares
from fomrc_core.effects.base.linear_modes import pair_weights


def through_modes(rates_per_s: Array, gains: Array, through: float, columns: Array, steps_s: Array) -> Array:
    """Return what ``run_modes`` gives from rest for each column, shape (n_samples, n_columns).

    Args:
        rates_per_s: of real modes [1/s], shape (n_modes,).
        gains: their gains, shape (n_modes,).
        through: share that comes through at once.
        columns: inputs, shape (n_samples, n_columns).
        steps_s: step that leads to each sample [s], shape (n_samples,).
    """
    still = np.zeros(rates_per_s.size)
    return through_pairs(
        np.column_stack((-rates_per_s, still)), np.column_stack((gains, still)), through, columns, steps_s
    )


def through_pairs(poles_per_s: Array, gains: Array, through: float, columns: Array, steps_s: Array) -> Array:
    """Return what ``run_pairs`` and ``through`` times the input give from rest for each column.

    Args:
        poles_per_s: real and imaginary parts [1/s], shape (n_pairs, 2).
        gains: the same of the gains, shape (n_pairs, 2).
        through: share that comes through at once.
        columns: inputs, shape (n_samples, n_columns).
        steps_s: step that leads to each sample [s], shape (n_samples,).
    """
    beat("simulations", columns.shape[1])
    out = np.empty(columns.shape)
    _run_columns(poles_per_s, gains, through, np.ascontiguousarray(columns), np.ascontiguousarray(steps_s), out)
    return out


def read_between(columns: Array, later: NDArray[np.int64], share: Array) -> Array:
    """Return each column between two samples, 0 before the first, shape (n_samples, n_columns).

    Args:
        columns: inputs, shape (n_inputs, n_columns).
        later: the later of the two samples, shape (n_samples,); beside the first, 0, stands nothing.
        share: of the way from the earlier one to it, shape (n_samples,).
    """
    beat("simulations", columns.shape[1])
    out = np.empty((later.size, columns.shape[1]))
    _read_between(np.ascontiguousarray(columns), later, share, out)
    return out


@compiled_sums
def _run_columns(poles: Array, gains: Array, through: float, columns: Array, steps: Array, out: Array) -> None:
    n_pairs, n_columns = poles.shape[0], columns.shape[1]
    weights = np.empty((n_pairs, 4))
    real, imaginary = np.zeros((n_pairs, n_columns)), np.zeros((n_pairs, n_columns))
    before = np.zeros(n_columns)
    step = -1.0
    for k in range(columns.shape[0]):
        if steps[k] != step:
            step = steps[k]
            for m in range(n_pairs):
                if poles[m, 1] == 0.0:
                    weights[m, 0], weights[m, 2] = lag_shares(-poles[m, 0] * step)
                else:
                    w = pair_weights(poles[m, 0] * step, poles[m, 1] * step)
                    weights[m, 0], weights[m, 1], weights[m, 2], weights[m, 3] = w
        now, read = columns[k], out[k]
        for j in range(n_columns):
            read[j] = through * now[j]
        for m in range(n_pairs):
            d, e, r, s = weights[m, 0], weights[m, 1], weights[m, 2], weights[m, 3]
            g, h = gains[m, 0], gains[m, 1]
            re, im = real[m], imaginary[m]
            if poles[m, 1] == 0.0:
                for j in range(n_columns):
                    re[j] += r * now[j] + (d - r) * before[j] - d * re[j]
                    read[j] += g * re[j]
            else:
                b, c = 1.0 - d - r, e + s
                for j in range(n_columns):
                    was = re[j]
                    re[j] = d * was - e * im[j] + b * before[j] + r * now[j]
                    im[j] = d * im[j] + e * was - c * before[j] + s * now[j]
                    read[j] += g * re[j] - h * im[j]
        for j in range(n_columns):
            before[j] = now[j]


@compiled_sums
def _read_between(columns: Array, later: NDArray[np.int64], share: Array, out: Array) -> None:
    n_columns = columns.shape[1]
    for k in range(later.size):
        i, w = later[k], share[k]
        ahead, read = columns[i], out[k]
        if i == 0:
            for j in range(n_columns):
                read[j] = w * ahead[j]
        else:
            behind = columns[i - 1]
            for j in range(n_columns):
                read[j] = behind[j] + w * (ahead[j] - behind[j])

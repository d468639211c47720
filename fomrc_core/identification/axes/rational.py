"""Poles common to several frequency responses: vector fitting, the start of a fit of modes.

Gustavsen and Semlyen, Rational approximation of frequency domain responses by vector fitting, IEEE Trans. Power
Delivery 14 (1999) 1052-1061; each output's own unknowns eliminated first (Deschrijver et al., IEEE Microwave Wireless
Comp. Lett. 18 (2008) 383-385). The responses are not needed: the poles are fitted to the records themselves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.least_squares import rows_without, shortest_weights
from fomrc_core.identification.axes.fit import real_rows
from fomrc_core.identification.axes.periodic import PeriodicRecord

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
_Rows = tuple[Array, Array]

_N_ROUNDS = 12
_START_DAMPING = 0.01
_LEAST_DAMPING, _MOST_DAMPING = 0.002, 0.3  # beyond these a pole follows noise, or a slope, and no mode
_OFF_THE_LINES = 1e-9  # least damping of a pole while poles are moved, far below that of any mode


def common_poles(records: tuple[PeriodicRecord, ...], n_poles: int, delay_s: float) -> tuple[Array, Array]:
    """Return frequencies [Hz] and damping of the modes found with so many pairs of poles, ascending.

    Args:
        records: of one level.
        n_poles: pairs of poles to place; those that follow no mode are left out of the answer.
        delay_s: delay of all responses [s].
    """
    hz = records[0].frequency_hz
    s: ComplexArray = np.asarray(2j * np.pi * hz, dtype=np.complex128)
    spacing = np.linspace(max(hz[0], 0.2 * hz[-1]), hz[-1], n_poles)
    poles: ComplexArray = np.asarray(2.0 * np.pi * spacing * (1j - _START_DAMPING), dtype=np.complex128)
    inputs = [record.voltage * np.exp(-s * delay_s) for record in records]
    for _ in range(_N_ROUNDS):
        poles = _moved(poles, s, inputs, records)
    omega, damping = np.abs(poles), -poles.real / np.abs(poles)
    kept = (damping > _LEAST_DAMPING) & (damping < _MOST_DAMPING) & (omega < 1.05 * abs(s[-1]))
    order = np.argsort(omega[kept])
    return omega[kept][order] / (2.0 * np.pi), damping[kept][order]


def _basis(poles: ComplexArray, s: ComplexArray) -> ComplexArray:
    plus, minus = 1.0 / (s[:, None] - poles), 1.0 / (s[:, None] - poles.conj())
    return np.concatenate([plus + minus, 1j * (plus - minus)], axis=1)


def _moved(
    poles: ComplexArray, s: ComplexArray, inputs: list[ComplexArray], records: tuple[PeriodicRecord, ...]
) -> ComplexArray:
    n, scale = poles.size, np.tile(np.abs(poles), 2)
    basis = _basis(poles, s) * scale
    columns = np.concatenate([basis, np.ones((s.size, 1)), (s / abs(s[-1]))[:, None]], axis=1)
    own = [np.concatenate([columns * u[:, None] for u in drive], axis=1) for drive in inputs]
    left: list[Array] = []
    right: list[Array] = []
    for o in range(records[0].displacement.shape[0]):
        weight = 1.0 / np.sqrt(np.mean([record.rms_um[o] ** 2 for record in records]))

        def rows(mine: ComplexArray, record: PeriodicRecord, o: int = o, weight: float = weight) -> _Rows:
            y = record.displacement[o][:, None] * weight
            return real_rows(np.concatenate([mine * weight, -basis * y], axis=1)), real_rows(y)[:, 0]

        pairs = (rows(mine, record) for mine, record in zip(own, records, strict=True))
        shared, target = rows_without(pairs, own[0].shape[1])
        left.append(shared)
        right.append(target)
    c = shortest_weights(np.concatenate(left), np.concatenate(right)) * scale
    matrix, column, row = np.zeros((2 * n, 2 * n)), np.zeros(2 * n), np.zeros(2 * n)
    for m, p in enumerate(poles):
        k = slice(2 * m, 2 * m + 2)
        matrix[k, k] = [[p.real, p.imag], [-p.imag, p.real]]
        column[2 * m] = 2.0
        row[k] = c[m], c[n + m]
    zeros = np.linalg.eigvals(matrix - np.outer(column, row))
    # a pole that follows one line alone ends upon it, where a basis of fractions has no value
    zeros = -np.maximum(np.abs(zeros.real), _OFF_THE_LINES * np.abs(zeros)) + 1j * zeros.imag
    upper = zeros[zeros.imag > 1.0]
    if upper.size < n:  # pairs that became real start again
        hz = np.linspace(0.25, 0.95, n - upper.size) * abs(s[-1])
        upper = np.concatenate([upper, hz * (1j - _START_DAMPING)])
    return np.asarray(upper[np.argsort(upper.imag)][:n])

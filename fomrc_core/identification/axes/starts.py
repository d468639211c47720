"""Where fits of several axes begin: shapes for given poles, one more mode, one more joint."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Mask
from fomrc_core.compute.least_squares import normal_equations
from fomrc_core.identification.axes.fit import AxesFit, real_rows
from fomrc_core.identification.axes.parameters import AxesParameters
from fomrc_core.identification.axes.periodic import PeriodicRecord
from fomrc_core.model.axes import mode_answers

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_NEAR_HZ = 40.0  # of a band in which the shapes of one more mode are seen
_OF_EACH_MODE = ("softening", "softening_squared", "damping_change", "gain_change")


def empty_parameters(
    frequency_hz: Array, damping: Array, shape: tuple[int, int], delay_s: float, n_plays: int = 0
) -> AxesParameters:
    """Return parameters of so many outputs and inputs, all shapes zero.

    Args:
        frequency_hz: of the modes, (M,).
        damping: of the modes, (M,).
        shape: numbers of outputs and inputs.
        delay_s: of everything.
        n_plays: on each input.
    """
    n, (n_out, n_in) = np.size(frequency_hz), shape
    zeros = np.zeros
    return AxesParameters(
        log_frequency=np.log(2.0 * np.pi * np.asarray(frequency_hz)),
        log_damping=np.log(damping),
        output_re=zeros((n, n_out)),
        output_im=zeros((n, n_out)),
        input_re=zeros((n, n_in)),
        input_im=zeros((n, n_in)),
        softening=zeros(n),
        softening_squared=zeros(n),
        damping_change=zeros(n),
        gain_change=zeros(n),
        static=zeros((n_out, n_in)),
        static_change=zeros(1),
        exponent=np.ones(1),
        delay_s=np.array([delay_s]),
        play_weights=zeros((n_plays, n_in)),
        joint=zeros((0, n)),
    )


def with_shapes(fit: AxesFit, par: AxesParameters) -> AxesParameters:
    """Return parameters with the shapes of least squares for their poles, cut to rank one."""
    matrices, static = _residues(fit, par, np.exp(par.log_frequency), np.exp(par.log_damping), None)
    c, b = _rank_one(matrices)
    return replace(par, output_re=c.real, output_im=c.imag, input_re=b.real, input_im=b.imag, static=static)


def with_mode(fit: AxesFit, par: AxesParameters, frequency_hz: float, damping: float = 0.01) -> AxesParameters:
    """Return parameters with one more mode, its shapes those of what is left near its frequency."""
    omega = np.array([2.0 * np.pi * frequency_hz])
    matrices, _ = _residues(fit, par, omega, np.array([damping]), frequency_hz)
    c, b = _rank_one(matrices)
    levels = {name: np.append(getattr(par, name), np.median(getattr(par, name))) for name in _OF_EACH_MODE}
    return replace(
        par,
        log_frequency=np.append(par.log_frequency, np.log(omega)),
        log_damping=np.append(par.log_damping, np.log(damping)),
        output_re=np.vstack([par.output_re, c.real]),
        output_im=np.vstack([par.output_im, c.imag]),
        input_re=np.vstack([par.input_re, b.real]),
        input_im=np.vstack([par.input_im, b.imag]),
        joint=np.pad(par.joint, ((0, 0), (0, 1))),
        **levels,
    )


def without_mode(par: AxesParameters, m: int) -> AxesParameters:
    """Return parameters without one mode."""
    names = ("log_frequency", "log_damping", "output_re", "output_im", "input_re", "input_im", *_OF_EACH_MODE)
    kept = {name: np.delete(getattr(par, name), m, axis=0) for name in names}
    return replace(par, joint=np.delete(par.joint, m, axis=1), **kept)


def _residues(
    fit: AxesFit, par: AxesParameters, omega: Array, damping: Array, near_hz: float | None
) -> tuple[ComplexArray, Array]:
    """Return residues (M, O, I) of least squares, and the static part (O, I), of what the parameters leave."""
    response = fit.response
    hz, n = response.records[0].frequency_hz, omega.size
    answers = mode_answers(response.z1, omega, damping, response.step_s, float(par.delay_s[0]))
    columns = [0.5 * (answers.plus + answers.minus), 0.5j * (answers.plus - answers.minus)]
    near = np.ones(hz.size, dtype=bool)
    if near_hz is None:
        columns.append(response.z1[:, None])
    else:
        near = np.abs(hz - min(near_hz, hz[-1])) < max(_NEAR_HZ, 0.03 * near_hz)
    basis = np.concatenate(columns, axis=1)[near]

    def rows(r: int, record: PeriodicRecord) -> tuple[Array, Array, Mask]:
        left = record.displacement if near_hz is None else record.displacement - response.spectrum(par, r)
        columns = real_rows(np.concatenate([basis * u[near][:, None] for u in record.voltage], axis=1))
        return columns, real_rows(left[:, near].T), np.ones(columns.shape[0], dtype=np.bool_)

    solution = normal_equations(rows(r, record) for r, record in enumerate(response.records)).solution()
    solved = solution.reshape(len(par.static[0]), basis.shape[1], -1)  # I, columns, O
    matrices = (solved[:, :n] + 1j * solved[:, n : 2 * n]).transpose(1, 2, 0)
    static = solved[:, -1].T.copy() if near_hz is None else par.static
    return matrices, static


def _rank_one(matrices: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    left, size, right = np.linalg.svd(matrices)
    root = np.sqrt(size[:, 0])[:, None]
    return left[:, :, 0] * root, right[:, 0, :] * root

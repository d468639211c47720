"""What the modes of several axes answer, frequency by frequency, exactly as they are stepped.

A drive is held between samples, delayed, and the modes are integrated exactly. A mode with pole p answers a held input
that is delayed by less than a sample by

    xi = kappa (G_a z^-2 + G_b z^-1) / (1 - e^(pT) z^-1),  kappa = -j w^2 / w_d,
    G_a = (e^(pT) - e^(p(T - delay))) / p,  G_b = (e^(p(T - delay)) - 1) / p.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array, ComplexArray
from fomrc_core.model.axes.axes_model import AxesModel
from fomrc_core.model.axes.kernels import SAME


@dataclass(frozen=True, eq=False)
class ModeAnswers:
    """What modes answer at one level: plus and minus are of the pole and of its conjugate, each (K, M)."""

    plus: ComplexArray
    minus: ComplexArray


def mode_answers(z1: ComplexArray, omega: Array, damping: Array, step_s: float, delay_s: float) -> ModeAnswers:
    """Return the answers of modes to a held input.

    Args:
        z1: z^-1 of each frequency, (K,).
        omega: undamped natural frequencies [rad/s], (M,).
        damping: share of critical damping [1], (M,).
        step_s: distance of the samples [s].
        delay_s: of the input [s], 0 to ``step_s``.
    """
    damped = omega * np.sqrt(1.0 - damping**2)
    found = []
    for sign in (1.0, -1.0):
        p = -damping * omega + sign * 1j * damped
        whole, late = np.exp(p * step_s), np.exp(p * (step_s - delay_s))
        kappa = -sign * 1j * omega**2 / damped / p
        drive = (whole - late) * z1[:, None] + (late - 1.0)
        found.append(kappa * drive * z1[:, None] / (1.0 - whole * z1[:, None]))
    return ModeAnswers(found[0], found[1])


def axes_response(model: AxesModel, frequency_hz: Array, step_s: float, level_v: float | None = None) -> ComplexArray:
    """Return what the outputs do for a um of each input's own model, held between samples, (K, n_outputs, n_inputs).

    Joints and the relay of the rate, which are not linear, are left out.

    Args:
        model: the stage.
        frequency_hz: frequencies [Hz], (K,).
        step_s: distance of the samples [s].
        level_v: level of the drive [V rms]; the reference level if left out.
    """
    z1 = np.exp(-2j * np.pi * step_s * frequency_hz)
    q = 0.0 if level_v is None or model.level is None else model.level.change(level_v)
    n_whole = int(np.floor(model.delay_s / step_s + SAME))
    rest_s = max(model.delay_s - n_whole * step_s, 0.0)
    is_split = rest_s > SAME * step_s
    # what moves at once shows what was driven a delay ago: of a delay within a sample, the hold before
    late = z1 ** (n_whole + (1 if is_split else 0))
    gain = late[:, None, None] * (model.static * (1.0 + model.coupling_change * q))
    if model.modes is None:
        return np.asarray(gain, dtype=np.complex128)
    omega, damping, modal = model.modes.at(q)
    answers = mode_answers(z1, omega, damping, step_s, rest_s if is_split else 0.0)
    residues = np.einsum("m,mo,mi->moi", modal, model.modes.output_shape, model.modes.input_shape)
    found = np.tensordot(answers.plus, residues, 1) + np.tensordot(answers.minus, residues.conj(), 1)
    return np.asarray(gain + 0.5 * (z1**n_whole)[:, None, None] * found)

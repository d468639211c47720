"""How sure each number of an identification of several axes is.

What a model leaves is noise of the sensors and, as a rule more, what drives do that its hysteresis does not follow: the
latter passes the modes like the drive, and is largest where the modes are found. A variance that is the same on all
lines would make frequencies and damping too sure. On random-phase multisines what is not linear is, from line to line
and from record to record, as good as independent (Pintelon and Schoukens, System identification, 2012, section 3.4),
so that each line of each record, with all its outputs, is a cluster of ``clustered_covariance``. What was left out for
gaining too little would not have been with other noise: a number is as uncertain as the two models make it together.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.clustered_errors import Selection, clustered_covariance, undetermined
from fomrc_core.identification.axes.fit import AxesFit
from fomrc_core.identification.axes.parameters import AxesParameters, Mask
from fomrc_core.identification.axes.pruning import FREE_LOSS


@dataclass(frozen=True, eq=False)
class AxesStandardErrors:
    """One standard deviation of each number; nan of one that was not fitted, inf of one the records leave open.

    Attributes:
        frequency_hz: of each mode [Hz], (M,).
        damping: of each mode [1], (M,).
        gain: of each mode's ``mode_gains`` [um/um], (M,).
        softening: relative change of frequency with q of the level [1], (M,).
        softening_squared: the same with q squared, (M,).
        damping_change: of the logarithm of damping with q, (M,).
        gain_change: relative change of the mode's gain with q, (M,).
        exponent: of the level law.
        static: direct coupling [um/um], (O, I).
        static_change: its relative change with q.
        delay_s: of everything [s].
        play_weights: of plays, then of the relay of the rate, now and a step later, (P, I).
        joints: shapes of the joints, (J, M).
    """

    frequency_hz: Array
    damping: Array
    gain: Array
    softening: Array
    softening_squared: Array
    damping_change: Array
    gain_change: Array
    exponent: float
    static: Array
    static_change: float
    delay_s: float
    play_weights: Array
    joints: Array


def mode_gains(par: AxesParameters) -> Array:
    """Return the gain of each mode, the root of the squares of its residues' sum over outputs and inputs, (M,)."""
    return np.asarray(np.linalg.norm(par.output_shape, axis=1) * np.linalg.norm(par.input_shape, axis=1))


def standard_errors(fit: AxesFit, par: AxesParameters, asked: Mask, free: Mask) -> AxesStandardErrors:
    """Return the standard errors of fitted parameters.

    A part of a sample more delay, with all phases of shapes free and all direct coupling, is other phases and another
    coupling, sample for sample: where the records leave the delay open so, all else is as sure as it is at this delay.

    Args:
        fit: to all the records learnt from.
        par: the parameters it came to.
        asked: which entries of their vector could have been fitted.
        free: which were to the end; the others were left out as ``pruning`` does.
    """
    gram = fit.linearised(par).equations.gram
    each = np.full(free.size, np.nan)
    delay = int(par.places()["delay_s"][0])
    if free[delay] and undetermined(gram[np.ix_(free, free)])[int(free[:delay].sum())]:
        each[delay] = np.inf
        free = free & ~par.mask("delay_s")
    asked = asked & (free | ~par.mask("delay_s"))
    selection = Selection(free[asked], FREE_LOSS * fit.cost(par))
    covariance = np.zeros((free.size, free.size))
    found = clustered_covariance(gram[np.ix_(asked, asked)], _lines(fit, par, asked), selection)
    covariance[np.ix_(free, free)] = found
    each[free] = np.sqrt(np.diag(covariance)[free])
    of = {name: each[at] for name, at in par.places().items()}
    return AxesStandardErrors(
        frequency_hz=np.exp(par.log_frequency) / (2.0 * np.pi) * of["log_frequency"],
        damping=np.exp(par.log_damping) * of["log_damping"],
        gain=_gain_errors(par, covariance),
        softening=of["softening"],
        softening_squared=of["softening_squared"],
        damping_change=of["damping_change"],
        gain_change=of["gain_change"],
        exponent=float(of["exponent"][0]),
        static=of["static"],
        static_change=float(of["static_change"][0]),
        delay_s=float(of["delay_s"][0]),
        play_weights=of["play_weights"],
        joints=of["joint"],
    )


def _lines(fit: AxesFit, par: AxesParameters, asked: Mask) -> Iterator[tuple[Array, Array]]:
    """Yield of each record columns (K, 2 O, n_asked) and residuals (K, 2 O) of its lines."""
    response = fit.response
    for r, record in enumerate(response.records):
        left = record.displacement - response.spectrum(par, r)
        n_out, n_lines = left.shape
        columns = np.zeros((n_lines, 2, n_out, asked.size))
        for o, derivatives, at in response.derivatives(par, r):
            columns[:, 0, o, at] = derivatives.real * fit.weights[r, o]
            columns[:, 1, o, at] = derivatives.imag * fit.weights[r, o]
        rest = np.stack([left.real.T, left.imag.T], axis=1) * fit.weights[r]
        yield columns[..., asked].reshape(n_lines, 2 * n_out, -1), rest.reshape(n_lines, 2 * n_out)


def _gain_errors(par: AxesParameters, covariance: Array) -> Array:
    """Return the standard errors of ``mode_gains``: their gradient by the parts of both shapes, and the covariance."""
    places = par.places()
    names = ("output_re", "output_im", "input_re", "input_im")
    found = []
    for m, gain in enumerate(mode_gains(par)):
        slopes, at = [], []
        for kind in ("output", "input"):
            size = float(np.sum(getattr(par, f"{kind}_re")[m] ** 2 + getattr(par, f"{kind}_im")[m] ** 2))
            slopes += [getattr(par, f"{kind}_{part}")[m] * gain / max(size, 1e-300) for part in ("re", "im")]
        at = [places[name][m] for name in names]
        slope, where = np.concatenate(slopes), np.concatenate(at)
        block = covariance[np.ix_(where, where)]
        is_open = ~np.isfinite(np.diag(block))
        known = np.where(is_open[:, None] | is_open, 0.0, block)
        found.append(np.inf if np.any(slope[is_open]) else float(slope @ known @ slope))
    return np.sqrt(np.maximum(found, 0.0))

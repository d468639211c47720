"""How much of an effect a base model could see: its rms with and without what any hysteresis explains."""

from __future__ import annotations

import numpy as np
from numba import njit

from test.hidden.creep import fractional_integral

_N_PLAYS = 24


@njit(cache=True)
def _backlash(drive: np.ndarray, radius: float) -> np.ndarray:
    out = np.empty_like(drive)
    z = 0.0
    for k in range(drive.size):
        z = max(drive[k] - radius, min(drive[k] + radius, z))
        out[k] = z
    return out


def absorbable(commands_v: list[np.ndarray], rate_hz: float, creep_order: float) -> np.ndarray:
    """Return an orthonormal basis of what hysteresis, creep and an offset per record can take up.

    Shape (n_samples of all records, n_basis).
    """
    largest = max(float(np.max(np.abs(command_v))) for command_v in commands_v)
    radii = largest * np.concatenate([[0.0], (np.arange(1, _N_PLAYS) / _N_PLAYS) ** 1.3])
    step_s = 1.0 / rate_hz
    rows = []
    for which, command_v in enumerate(commands_v):
        columns = [np.full(command_v.size, float(k == which)) for k in range(len(commands_v))]
        plays = [fractional_integral(_backlash(command_v, r), creep_order, step_s) for r in radii]
        # The derivative with the creep order, of the largest part of the response.
        more = fractional_integral(command_v, creep_order + 1e-3, step_s)
        rows.append(np.stack([*columns, *plays, (more - plays[0]) / 1e-3], axis=1))
    basis = np.concatenate(rows)
    basis /= np.linalg.norm(basis, axis=0)
    q, r = np.linalg.qr(basis)
    return q[:, np.abs(np.diag(r)) > 1e-9]


def rms(values: np.ndarray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def raw_and_visible_um(differences_um: list[np.ndarray], basis: np.ndarray) -> tuple[float, float]:
    """Return the rms [um] of an effect over all records: less offsets, and less what a base could absorb."""
    centred = np.concatenate([d - np.mean(d) for d in differences_um])
    return rms(centred), rms(centred - basis @ (basis.T @ centred))

"""A model that is too coarse: two or three elements read off a slow loop, as someone in a hurry would."""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear

from test.hidden.creep import fractional_integral
from test.hidden.hysteresis import MaxwellChain, RelayPlane


def _slips(displacement: np.ndarray, strength: float) -> np.ndarray:
    held = np.zeros_like(displacement)
    for k in range(1, displacement.size):
        held[k] = min(strength, max(-strength, held[k - 1] + displacement[k] - displacement[k - 1]))
    return held


def coarse_model(
    hysteresis: RelayPlane | MaxwellChain, creep_order: float, low_v: float, high_v: float, n_elements: int
) -> dict[str, object]:
    """Return, as in a model file, a chain of few elements fitted to one slow loop without creep."""
    turns_v = np.array([0.0, high_v, low_v, high_v, 0.6 * high_v + 0.4 * low_v, high_v])
    loop_v = np.interp(np.linspace(0.0, turns_v.size - 1.0, 1501), np.arange(turns_v.size), turns_v)
    loop_um = hysteresis.run(loop_v)
    strengths = 0.5 * np.ptp(loop_um) * np.arange(1, n_elements + 1) / (n_elements + 1.0)
    columns = np.stack([_slips(loop_um, s) for s in strengths] + [loop_um], axis=1)
    # Bounded, lest an element vanish (it would have no kappa) or the spring that holds the rest be gone.
    chord = float(np.ptp(loop_v) / np.ptp(loop_um))
    lowest = chord * np.append(np.full(n_elements, 0.01), 0.4)
    stiffness = lsq_linear(columns, loop_v, (lowest, np.inf)).x
    return {
        "kappa_um_per_v": [float(1.0 / w) for w in stiffness],
        "saturation_v": [float(w * s) for w, s in zip(stiffness[:-1], strengths, strict=True)],
        "creep_order": float(creep_order),
    }


def coarse_displacement_um(model: dict[str, object], command_v: np.ndarray, rate_hz: float) -> np.ndarray:
    """Return what a coarse model makes of a drive [um], solved by the truth's own chain."""
    stiffness = 1.0 / np.asarray(model["kappa_um_per_v"])
    chain = MaxwellChain(stiffness[:-1], np.asarray(model["saturation_v"]), float(stiffness[-1]))
    order = float(model["creep_order"])  # type: ignore[arg-type]
    return fractional_integral(chain.run(command_v), order, 1.0 / rate_hz)

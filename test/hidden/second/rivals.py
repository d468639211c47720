"""How far a hidden cause is from the nearest other cause: what no drive in the records can tell apart is no mistake.

A rival is given the parameters that make its effect as large as that of the truth, a smaller and a larger size beside
it, and any weighting of these: more than a rival can be, so that what it leaves of the truth's effect is a fair bound
from below.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from test.hidden.second.hidden_causes import DRAWS
from test.hidden.second.sizing import Sizing
from test.hidden.second.surrogate import rms

_FAMILIES: tuple[tuple[str, ...], ...] = (
    (
        "amplifier_bandwidth",
        "transport_delay",
        "sensor_bandwidth",
        "voltage_dependent_capacitance",
        "unequal_lag",
        "drive_resonance",
        "mechanical_resonance",
        "second_mode",
        "zero_order_hold",
        "amplifier_slew_limit",
        "clock_skew",
        "rate_dependent_hysteresis",
    ),
    (
        "slow_relaxation",
        "creep_law",
        "amplitude_dependent_creep",
        "charge_leak",
        "initial_state",
        "thermal_drift",
        "gain_drift",
    ),
    (
        "asymmetric_hysteresis",
        "sensor_nonlinearity",
        "lost_preload",
        "amplifier_saturation",
        "dead_zone",
        "cyclic_sensor_error",
        "backlash",
        "amplitude_dependent_creep",
    ),
)
_N_DRAFTS = 2
_N_TURNS = 2
_OVERSAMPLING = 2  # steps of the physics a sample: of both sides, so that what it costs goes out of the comparison
_BESIDE = (0.6, 1.6)  # further sizes of a rival


@dataclass(frozen=True)
class Rival:
    """The cause that comes nearest to the truth.

    Args:
        cause: its name; empty where no cause is of the truth's kind.
        distinct_over_noise: rms over train and test of what it leaves of the truth's visible effect, over the noise.
    """

    cause: str
    distinct_over_noise: float


def nearest_rival(
    sizing: Sizing, cause: str, parameters: dict[str, Any], noise_um: float, rng: np.random.Generator
) -> Rival:
    """Return the cause that comes nearest to a hidden one on the records of a bench.

    Args:
        sizing: of the bench.
        cause: hidden.
        parameters: of it.
        noise_um: rms of the noise [um].
        rng: source of chance, for the rivals' own parameters.
    """
    sizing = sizing.coarser(_OVERSAMPLING)
    own = np.concatenate(sizing.left_um(cause, parameters))
    best = Rival("", rms(own) / noise_um)
    rivals = {name for family in _FAMILIES if cause in family for name in family if name != cause}
    for name in sorted(rivals):
        for _ in range(_N_DRAFTS):
            columns = _columns(sizing, name, rms(own), rng)
            weights = np.linalg.lstsq(columns, own, rcond=1e-6)[0]
            left = rms(own - columns @ weights) / noise_um
            if left < best.distinct_over_noise:
                best = Rival(name, left)
    return best


def _columns(sizing: Sizing, name: str, target_um: float, rng: np.random.Generator) -> np.ndarray:
    """Return what a rival of about a size makes visible, shape (n_samples of both records, n_sizes)."""
    draft = DRAWS[name](sizing.bench, rng)
    size = float(np.sqrt(draft.smallest * draft.largest))
    column = np.concatenate(sizing.left_um(name, draft.build(size)))
    for _ in range(_N_TURNS if draft.smallest < draft.largest else 0):
        turned = size * (target_um / max(rms(column), 1e-6 * target_um)) ** (1.0 / draft.power)
        size = float(np.clip(turned, draft.smallest, draft.largest))
        column = np.concatenate(sizing.left_um(name, draft.build(size)))
    columns = [column]
    for factor in _BESIDE if draft.smallest < draft.largest else ():
        beside = float(np.clip(factor * size, draft.smallest, draft.largest))
        columns.append(np.concatenate(sizing.left_um(name, draft.build(beside))))
    return np.stack(columns, axis=1)

"""Moments in which the reading is somewhere else: bursts of samples far from all others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.runs import runs_of

# A reading is lost where it lies further than so many times what is normal from those around it, for less than this.
_FAR = 6.0
_N_AROUND = 101
_LARGEST_SHARE = 0.2


@dataclass(frozen=True, eq=False)
class Lost:
    """Bursts in which the reading is at another level.

    Attributes:
        levels_um: how far away it is, one level a burst, zero elsewhere [um], shape (n_samples,).
        n_bursts: in how many bursts.
        share: of the samples looked at [1].
    """

    levels_um: Array
    n_bursts: int
    share: float


def lost_samples(residual_um: Array, is_after: Mask, small_um: float) -> Lost | None:
    """Return the bursts in the samples after a change; None where there are none, or too many to be bursts.

    Args:
        residual_um: measured minus predicted displacement [um], shape (n_samples,).
        is_after: samples to look at, shape (n_samples,).
        small_um: what the model gets wrong in normal work [um].
    """
    from scipy.ndimage import median_filter  # slow to import; only a change is looked at by it

    around = median_filter(residual_um, size=min(_N_AROUND, 2 * (residual_um.size // 4) + 1), mode="nearest")
    is_lost = (np.abs(residual_um - around) > _FAR * small_um) & is_after
    share = float(np.mean(is_lost[is_after])) if np.any(is_after) else 0.0
    lost = runs_of(is_lost)
    if lost.shape[0] == 0 or share > _LARGEST_SHARE:
        return None
    # A contact that is lost leaves one level; what swings about it is something else.
    levels_um = np.zeros(residual_um.size)
    for start, stop in lost:
        levels_um[start:stop] = float(np.mean((residual_um - around)[start:stop]))
    return Lost(levels_um, lost.shape[0], share)

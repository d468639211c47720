"""The noise a search goes by, told anew from what it has left: what acts once in a record is no noise of its repeats.

Two copies of a drive differ by the noise, and by whatever acts in one and not in the other: a mass that still rings, a
gain that drifts, a lead that opens. Before anything is found nobody can tell these from noise, and a search that takes
them for it ends before it finds them. What is found takes them out of the residual, and of that the repeats are asked
again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.search_state import AS_NOISE
from fomrc_core.records.noise import noise_of_residuals, sensor_rounding_um
from fomrc_core.records.quality import bridged

_SURELY_LESS = 1.44  # of the power: a fifth of its rms is what noise of repeats may be off


def with_noise_beside(split: DataSplit, left_um: Sequence[Array]) -> DataSplit:
    """Return the split with its noise no larger than repeats and quick changes of a residual show it to be.

    Asked only where no more seems to be left than noise: else the one noise is as good as the other.

    Args:
        split: records.
        left_um: what a model leaves of each training record [um].
    """
    left_um2 = sum(float(left[r.is_used] @ left[r.is_used]) for left, r in zip(left_um, split.train, strict=True))
    if left_um2 >= AS_NOISE * split.noise_um2:
        return split
    recordings = [record.recording for record in split.train]
    bridged_um = [bridged(left, r.valid_samples) for left, r in zip(left_um, recordings, strict=True)]
    again = noise_of_residuals(recordings, bridged_um)
    # noise is no larger than all that is left: then what repeats differ by is still something that came once
    is_refuted = left_um2 < split.n_used * again.floor_um**2 / _SURELY_LESS
    again_um = max(again.differences_um if is_refuted else again.floor_um, sensor_rounding_um(recordings))
    return replace(split, noise_um=again_um) if AS_NOISE * again_um**2 < split.noise_um**2 else split

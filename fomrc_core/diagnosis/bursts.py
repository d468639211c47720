"""Bursts in what a model leaves: most of its power in a few samples that stand far out of all others.

Noise of a sensor, of whatever colour, is about as large in one stretch as in the next. A lead that opens, a knock or a
reading that was lost leaves its power in a few samples, follows no drive and wanders as a walk does: none of the tests
for these sees it, and three openings a thousand times the noise were called noise. Measured is how far the samples lie
from the middle in robust standard deviations (Hampel, J. Amer. Statist. Assoc. 69 (1974) 383).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtr

from fomrc_core.diagnosis.remainder import Dependence, DrivenRecord

_MEDIAN_TO_RMS = 1.4826  # of normal numbers
_STANDS_OUT = 10.0  # standard deviations: a walk of a whole record goes to four or five of them
_MOST = 0.5  # of the power: less may be what jumps of a drive leave, which other tests look at


def bursts(records: Sequence[DrivenRecord]) -> Dependence:
    """Return how much of a residual is in a few samples that stand out, where that is most of it.

    Args:
        records: with the residual of one and the same model.
    """
    told = [record for record in records if np.any(record.is_used)]
    total_um2 = sum(record.left_um2 for record in told)
    n_samples, standing_um2 = 0, 0.0
    for record in told:
        left_um = record.residual_um[record.is_used]
        size_um = np.abs(left_um - np.median(left_um))
        width_um = _MEDIAN_TO_RMS * float(np.median(size_um))
        n_samples += left_um.size
        if width_um > 0.0:  # of readings most of which are alike nothing says how wide the others may lie
            standing = size_um[size_um > _STANDS_OUT * width_um]
            standing_um2 += float(standing @ standing)
    share = min(standing_um2 / total_um2, 1.0) if total_um2 > 0.0 else 0.0
    by_chance = min(2.0 * float(ndtr(-_STANDS_OUT)) * n_samples, 1.0)
    is_burst = share > _MOST
    on = "in a few samples that stand far out of all others"
    return Dependence(on, share if is_burst else 0.0, by_chance if is_burst else 1.0, is_of_drive=False)

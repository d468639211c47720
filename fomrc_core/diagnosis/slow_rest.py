"""Whether what is left beyond the noise of repeats is slower than repeats can show.

Two readings of one place, a lag apart, share what wanders more slowly than the lag: repeats know the noise down to a
frequency. What is left below it may be noise as well, a sensor that wanders over the whole record, and nobody knows; it
is judged as where no repeats are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fomrc_core.diagnosis.judgement import LARGEST_EXCESS, LARGEST_EXCESS_ANYWHERE
from fomrc_core.diagnosis.remainder import DrivenRecord


def is_slower_than_seen(records: Sequence[DrivenRecord], floor_um: float, slowest_seen_s: float) -> bool:
    """Return whether more than the noise is left, and all of that is slower than the slowest noise seen.

    Args:
        records: with the residual of one and the same model.
        floor_um: rms of the noise that repeats show [um].
        slowest_seen_s: longest period of the noise they show [s].
    """
    from scipy.fft import dct  # a part of a second to import, which no node that only drives shall wait for

    whole, quick, sizes = [], [], []
    for record in records:
        left_um = record.residual_um[record.is_used]
        spectrum = dct(left_um - np.mean(left_um), norm="ortho")
        duration_s = left_um.size * float(np.median(np.diff(record.time_s)))
        slowest = int(2.0 * duration_s / slowest_seen_s) + 1
        whole.append(float(np.sum(spectrum**2)))
        quick.append(float(np.sum(spectrum[slowest:] ** 2)))
        sizes.append(left_um.size)
    return _is_more(whole, sizes, floor_um) and not _is_more(quick, sizes, floor_um)


def _is_more(powers_um2: Sequence[float], sizes: Sequence[int], floor_um: float) -> bool:
    """Return whether sums of squares over so many samples are more than noise, in all or in the worst."""
    worst_um = max(np.sqrt(power / n) for power, n in zip(powers_um2, sizes, strict=True))
    pooled_um = np.sqrt(sum(powers_um2) / sum(sizes))
    return bool(pooled_um > LARGEST_EXCESS * floor_um or worst_um > LARGEST_EXCESS_ANYWHERE * floor_um)

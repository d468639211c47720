"""Whether a whitened residual is white: the same power in every band of its spectrum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.records.noise_parts import bands_of

_N_MIN = 16


@dataclass(frozen=True)
class WhitenessTest:
    """Test of the hypothesis that whitened values are white over the frequencies at which the noise was seen.

    Attributes:
        p_value: of the hypothesis.
        worst_frequency: middle of the band that fits it least [cycles per sample].
        worst_ratio: power there over the mean power [1].
    """

    p_value: float
    worst_frequency: float
    worst_ratio: float


def whiteness_test(white: Array, n_model: int, lowest: float = 0.0) -> WhitenessTest:
    """Return the test of whitened values, at the band that fits least and over all bands.

    The power in each third of an octave is held against the mean power by an F test with the degrees of freedom of
    the band, and those the band had in the ``n_model`` samples the whitening filter was made from. Bands are combined
    by Bonferroni's bound for the worst and by Fisher's sum for all, whichever is surer. Lines fall into their bands;
    what is slower than the noise model has seen is left out, for it cannot be told from slower noise.

    Args:
        white: whitened residual, shape (n_samples,).
        n_model: number of samples the noise model rests on.
        lowest: lowest frequency the noise model has seen [cycles per sample].
    """
    from scipy.stats import chi2  # slow to import, and no node that only drives needs it
    from scipy.stats import f as fisher

    values = np.asarray(white, dtype=np.float64) - float(np.mean(white))
    if values.size < _N_MIN or not np.any(values):
        return WhitenessTest(1.0, 0.5, 1.0)
    # the mean takes a line, the tapers smear over four half lines
    bands = bands_of([values], [max(lowest, 2.5 / values.size)])
    mean = float(np.average(bands.power, weights=bands.freedom))
    ratio = bands.power / mean
    of_model = np.maximum(bands.freedom * (n_model / values.size), 2.0)
    p_values = 2.0 * np.minimum(
        fisher.sf(ratio, bands.freedom, of_model),
        fisher.cdf(ratio, bands.freedom, of_model),
    )
    worst = int(np.argmin(p_values))
    least = min(1.0, bands.power.size * float(p_values[worst]))
    together = float(chi2.sf(-2.0 * float(np.sum(np.log(np.maximum(p_values, 1e-300)))), 2 * bands.power.size))
    return WhitenessTest(min(1.0, 2.0 * min(least, together)), float(bands.frequency[worst]), float(ratio[worst]))

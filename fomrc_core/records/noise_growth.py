"""By how much the noise of a whole record is more than that of its repeats, where it grows with displacement."""

from __future__ import annotations

import math

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.records.noise_estimate import growth_of
from fomrc_core.records.noise_spectrum import NoiseStretch
from fomrc_core.records.noise_stretches import N_STRETCH_MIN, stretches_of_repeats
from fomrc_core.records.recording import Recording
from fomrc_core.records.repeats import find_repeats

_SEEN = 0.3  # of the record's range, from which on growth is told


def beyond_repeats(recording: Recording, residual_um: Array, is_used: Mask) -> float:
    """Return the rms of the noise over a record, over that at the places its repeats came to [1].

    A drive may repeat what is near one end of its range only, and there the noise of a sensor that scatters in
    proportion to the displacement is not that of the record. How it grows is told from what changes from sample to
    sample in the residual, for there a model that is wrong shows least, and within the record alone: from record to
    record the zero of a sensor need not be the same.

    Args:
        recording: the record.
        residual_um: what a model leaves of it [um], shape (n_samples,).
        is_used: samples to be used, shape (n_samples,).

    Returns:
        1 where nothing repeats or the noise does not grow, surely.
    """
    is_pair = is_used[1:] & is_used[:-1]
    places = [stretch.displacement_um for stretch in stretches_of_repeats(recording, find_repeats(recording.voltage_v))]
    if not places or np.count_nonzero(is_pair) < N_STRETCH_MIN:
        return 1.0
    measured_um = recording.measured_um
    change_um = np.diff(residual_um)[is_pair] / math.sqrt(2.0)
    stretch = NoiseStretch(change_um, measured_um[1:][is_pair], 1.0, 1)
    slope, centre_um = growth_of([stretch], _SEEN * float(np.ptp(measured_um[is_used])))

    def power(at_um: Array) -> float:
        return float(np.mean(1.0 + (slope * (at_um - centre_um)) ** 2))

    return math.sqrt(power(measured_um[is_used]) / power(np.concatenate(places)))

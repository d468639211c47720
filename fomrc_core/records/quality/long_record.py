"""A long record looked over stretch by stretch, so that memory is bounded by a stretch and not by the record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fomrc_core.records.quality.clock import clock_faults
from fomrc_core.records.quality.examination import Examined, masked_recording, reading_faults
from fomrc_core.records.quality.faults import DataFault, DataQuality, FaultKind
from fomrc_core.records.recording import Recording

_N_STRETCH = 200_000
_N_OVERLAP = 2_000  # samples on either side: longer than any burst, and than what is rough about it


def examine_long(recording: Recording) -> Examined:
    """Return what ``examine`` would of each stretch of a long record, as of one.

    What is noise, rough or a step of the sensor is learnt from each stretch by itself.

    Args:
        recording: with displacement; what its own ``is_valid`` leaves out stays out.

    Raises:
        RecordingError: more than a tenth of the readings are wrong.
    """
    n = recording.n_samples
    valid = recording.valid_samples
    found: dict[FaultKind, list[DataFault]] = {}
    for first in range(0, n, _N_STRETCH):
        stop = min(first + _N_STRETCH, n)
        begin, end = max(first - _N_OVERLAP, 0), min(stop + _N_OVERLAP, n)
        part = Recording(
            recording.time_s[begin:end],
            recording.voltage_v[begin:end],
            recording.measured_um[begin:end],
            is_valid=valid[begin:end],
            name=recording.name,
        )
        for fault in reading_faults(part):
            own = (fault.samples >= first - begin) & (fault.samples < stop - begin)
            if np.any(own):
                at = fault.samples[own] + begin
                kept = replace(fault, samples=at, times_s=fault.times_s[own], readings_um=fault.readings_um[own])
                found.setdefault(fault.kind, []).append(kept)
    faults = list(clock_faults(recording.time_s))
    for kind, parts in found.items():
        samples = np.concatenate([f.samples for f in parts])
        times_s = np.concatenate([f.times_s for f in parts])
        readings_um = np.concatenate([f.readings_um for f in parts])
        faults.append(DataFault(kind, samples, times_s, max(f.size for f in parts), True, readings_um))
        valid[samples] = False
    quality = DataQuality(recording.name, n, tuple(faults), valid)
    return Examined(masked_recording(recording, quality), quality)

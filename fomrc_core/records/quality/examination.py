"""A record looked over before anything is fitted to it, and once more when a first fit has left a residual."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.runs import runs_of
from fomrc_core.errors import RecordingError
from fomrc_core.records.quality.clock import clock_faults
from fomrc_core.records.quality.constant_runs import find_dropouts, find_stuck
from fomrc_core.records.quality.drive_part import drive_part
from fomrc_core.records.quality.excursions import Surroundings, find_excursions
from fomrc_core.records.quality.faults import DataFault, DataQuality, FaultKind
from fomrc_core.records.quality.noisy_drive import drive_noise_v, smoothed_drive_v
from fomrc_core.records.quality.place_of_drive import made_by_drive
from fomrc_core.records.recording import Recording
from fomrc_core.records.sensor_step import recurring_step_um

_N_PASSES = 8  # excursions beside each other hide each other until the larger one is gone
_MASKED_SHARE_MAX = 0.1  # of a record: where more is wrong with it nobody knows what of it is right
_N_SAMPLES_MIN = 32
_N_STOOD = 2  # steps before a burst: of a reading that came twice there is one
_CREEPS = 0.1  # of what a stage that stands has missed


@dataclass(frozen=True, eq=False)
class Examined:
    """A record with the samples that count, and what is wrong with the others."""

    recording: Recording
    quality: DataQuality


def examine(recording: Recording) -> Examined:
    """Return the record with its bad samples masked, their readings bridged by straight lines, and what is wrong.

    The noise of a recorded drive of which the displacement shows nothing is smoothed out.

    Args:
        recording: with displacement; what its own ``is_valid`` leaves out stays out.

    Raises:
        RecordingError: more than a tenth of the readings are wrong.
    """
    valid = recording.valid_samples
    faults = list(clock_faults(recording.time_s))
    noise_v = drive_noise_v(recording.time_s, recording.voltage_v, recording.measured_um)
    if noise_v > 0.0:
        every = np.arange(recording.n_samples)
        faults.append(DataFault(FaultKind.NOISY_DRIVE, every, recording.time_s, noise_v, False, np.zeros(0)))
        recording = replace(recording, voltage_v=smoothed_drive_v(recording.voltage_v, noise_v))
    found = reading_faults(recording)
    faults += found
    for fault in found:
        valid[fault.samples] = False
    quality = DataQuality(recording.name, recording.n_samples, tuple(faults), valid)
    return Examined(masked_recording(recording, quality), quality)


def reading_faults(recording: Recording) -> list[DataFault]:
    """Return what is wrong with the readings of a record; nothing where it is short or its drive rests."""
    x = recording.measured_um
    if x.size < _N_SAMPLES_MIN or not float(np.ptp(recording.voltage_v)) > 0.0:
        return []
    return _masked_faults(recording, recording.valid_samples, recurring_step_um(x))


def examine_residual(recording: Recording, residual_um: Array) -> Examined:
    """Return the same from what a model has left of a record: there smaller spikes stand out.

    Where more than a tenth of the readings would be left out none is: the readings had nothing wrong with them by
    themselves, and it is the model that misses so many.

    Args:
        recording: the record, as ``examine`` gave it.
        residual_um: measured minus simulated [um], shape (n_samples,).
    """
    valid = recording.valid_samples
    left = bridged(residual_um, valid)
    followed = drive_part(recording.voltage_v, left, valid)
    step_um = recurring_step_um(recording.measured_um[valid])
    around = Surroundings.of(recording.voltage_v, left, followed, step_um, float(np.ptp(recording.measured_um)))
    is_spike = find_excursions(around) & valid
    is_spike &= ~_stand_still(recording.measured_um, left, is_spike, around.floor_um)
    is_spike &= ~made_by_drive(is_spike, recording.voltage_v)
    is_spike &= np.count_nonzero(~valid | is_spike) <= _MASKED_SHARE_MAX * recording.n_samples
    faults: tuple[DataFault, ...] = ()
    if np.any(is_spike):
        faults = (_fault(FaultKind.SPIKES, is_spike, recording, np.abs(left - bridged(left, ~is_spike))),)
    quality = DataQuality(recording.name, recording.n_samples, faults, valid & ~is_spike)
    return Examined(masked_recording(recording, quality), quality)


def _masked_faults(recording: Recording, valid: Mask, step_um: float) -> list[DataFault]:
    voltage_v, x = recording.voltage_v, recording.measured_um
    spikes, dropouts = np.zeros(x.size, dtype=np.bool_), np.zeros(x.size, dtype=np.bool_)
    for _ in range(_N_PASSES):
        kept = valid & ~spikes & ~dropouts
        left = bridged(x, kept)
        followed = drive_part(voltage_v, left, kept)
        around = Surroundings.of(voltage_v, left, followed, step_um)
        excursions = find_excursions(around) & kept
        dropped = find_dropouts(left, around, excursions) & kept
        # a value once known to be that of a dropout is looked for among all spikes
        known = np.unique(x[dropouts | dropped])
        dropped |= (excursions | spikes) & np.isin(x, known)
        dropouts |= dropped
        spikes = (spikes | excursions) & ~dropouts
        if not np.any(excursions | (dropped & kept)):
            break
    kept = valid & ~spikes & ~dropouts
    left = bridged(x, kept)
    followed = drive_part(voltage_v, left, kept)
    stuck, release_um = find_stuck(
        voltage_v, left, followed, Surroundings.of(voltage_v, left, followed, step_um), step_um
    )
    stuck &= kept
    jump = np.abs(x - left)
    named = [(FaultKind.SPIKES, spikes), (FaultKind.DROPOUTS, dropouts)]
    found = [_fault(kind, mask, recording, jump) for kind, mask in named if np.any(mask)]
    if np.any(stuck):
        at = np.flatnonzero(stuck)
        found.append(DataFault(FaultKind.STUCK, at, recording.time_s[at], release_um, True, x[at]))
    return found


def _stand_still(readings_um: Array, left_um: Array, is_spike: Mask, floor_um: float) -> Mask:
    """Return which samples of bursts stand where the readings before the burst stood already, or stand on after it.

    It is the model that has moved away there: where a stage misses what its drive does, the last readings before it
    comes back lie farthest from the model, and those before them lie ever farther; where the drive turns meanwhile,
    those about the turn. A spike leaves the readings beside it; a reading that came twice, as where a reader or a
    voltage was late, has not stood while the model moved. What stands creeps by a small share of what it missed.

    Args:
        readings_um: of the record [um], shape (n_samples,).
        left_um: what a model left of them [um], shape (n_samples,).
        is_spike: samples of bursts, shape (n_samples,).
        floor_um: largest change that noise makes [um].
    """
    stand = np.zeros(is_spike.size, dtype=np.bool_)
    for first, stop in runs_of(is_spike):
        for beside, far in ((first - 1, first - 1 - _N_STOOD), (stop, stop + _N_STOOD)):
            if not 0 <= far < is_spike.size:
                continue
            missed_um = abs(left_um[beside] - left_um[far])
            reach_um = max(floor_um, _CREEPS * missed_um)
            here = readings_um[min(first, far) : max(stop, far + 1)]
            if missed_um > floor_um and np.all(np.abs(here - readings_um[beside]) <= reach_um):
                stand[first:stop] = True
    return stand


def _fault(kind: FaultKind, mask: Mask, recording: Recording, jump_um: Array) -> DataFault:
    at = np.flatnonzero(mask)
    readings_um = recording.measured_um[at]
    return DataFault(kind, at, recording.time_s[at], float(np.max(jump_um[at])), True, readings_um)


def bridged(values: Array, valid: Mask) -> Array:
    """Return values with those that are not valid bridged by straight lines, shape (n_samples,)."""
    if bool(np.all(valid)):
        return values
    at = np.flatnonzero(valid)
    return np.interp(np.arange(values.size), at, values[at])


def masked_recording(recording: Recording, quality: DataQuality) -> Recording:
    """Return the record with the samples that do not count bridged; raises RecordingError where they are too many."""
    if quality.n_masked > _MASKED_SHARE_MAX * recording.n_samples:
        worst = max((f for f in quality.faults if f.is_masked), key=lambda f: f.samples.size, default=None)
        raise RecordingError(
            f"{quality.n_masked} of {recording.n_samples} readings are wrong"
            + ("" if worst is None else f", {worst.samples.size} by {worst.kind.value}"),
            where=f"{recording.name}: displacement_um",
            allowed=f"up to {100.0 * _MASKED_SHARE_MAX:g} %; record anew",
        )
    if quality.n_masked == 0:
        return recording
    return replace(
        recording, displacement_um=bridged(recording.measured_um, quality.is_valid), is_valid=quality.is_valid
    )

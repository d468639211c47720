"""One record of a diagnosis before and after, and what the noise floor is once what was found is taken out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.data_split import DataSplit, HeldOut
from fomrc_core.diagnosis.prepared import best_residual
from fomrc_core.diagnosis.remainder import DrivenRecord
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.noise import NoiseFloor, noise_of_residuals, sensor_rounding_um
from fomrc_core.records.noise_growth import beyond_repeats
from fomrc_core.records.quality import bridged
from fomrc_core.records.residual import rms


@dataclass(frozen=True, eq=False)
class RecordView:
    """One record before and after, arrays of shape (n_samples,).

    Attributes:
        name: of the record.
        role: "train", "test" or "report".
        time_s: time from its start [s].
        voltage_v: drive [V].
        measured_um: measured displacement [um].
        residual_before_um: measured minus the base model [um], offset removed, and what nothing taught it.
        residual_after_um: measured minus the extended model [um], the same removed.
        is_scored: samples that say something of the model, those that are not valid left out.
    """

    name: str
    role: str
    time_s: Array
    voltage_v: Array
    measured_um: Array
    residual_before_um: Array
    residual_after_um: Array
    is_scored: NDArray[np.bool_]

    def __str__(self) -> str:
        before, after = 1e3 * rms(self.residual_before_um), 1e3 * rms(self.residual_after_um)
        return f"{self.name} ({self.role}): {self.time_s.size} samples, rms {before:.4g} nm -> {after:.4g} nm"

    def driven(self) -> DrivenRecord:
        """Return what the extended model leaves of the record as tests of a remainder take it."""
        predicted_um = self.measured_um - self.residual_after_um
        return DrivenRecord(self.time_s, self.voltage_v, predicted_um, self.residual_after_um, self.is_scored)


def record_views(
    split: DataSplit, base: TrialModel, model: TrialModel, noise: NoiseFloor
) -> tuple[tuple[RecordView, ...], float, float]:
    """Return the records before and after, the worst rms of any, and the floor with what was found taken out."""
    roles = [("train", HeldOut(record, i)) for i, record in enumerate(split.train)]
    roles += [("test", h) for h in split.held if h.index >= len(split.train)]
    roles += [("report", h) for h in split.report if h.index > len(split.train)]
    views, errors, cleaned, grows = [], [], [], []
    for role, part in roles:
        record = part.record if role != "train" else part.record.using(np.ones(part.record.time_s.size, dtype=np.bool_))
        # what was read at samples that are not valid is no residual, and is shown as none
        valid = record.recording.valid_samples
        before = bridged(part.judged(base, best_residual(base, record, part.index)), valid)
        after = bridged(part.judged(model, best_residual(model, record, part.index)), valid)
        views.append(
            RecordView(
                record.recording.name,
                role,
                record.time_s,
                record.voltage_v,
                record.measured_um,
                before,
                after,
                record.is_used,
            )
        )
        errors.append(rms(after[record.is_used]))
        if role == "train":
            cleaned.append(after)
            grows.append(beyond_repeats(record.recording, after, record.is_used))
    recordings = [record.recording for record in split.train]
    again_um = max(noise_of_residuals(recordings, cleaned).floor_um, sensor_rounding_um(recordings))
    return tuple(views), max(errors), min(noise.floor_um, again_um) * float(np.median(grows))

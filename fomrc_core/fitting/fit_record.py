"""A recording as a fit sees it: times from its start, the samples it may learn from, what else was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.work_tally import WorkTally
from fomrc_core.effects import Covariates
from fomrc_core.model.divided_drive import KeptDivisions
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.model.substeps import Substeps
from fomrc_core.operators.creep import shortest_time_for
from fomrc_core.records.recording import Recording

Array = NDArray[np.float64]


def shortest_time(records: Sequence[FitRecord]) -> float:
    """Return the shortest time creep must hold for in these records [s]."""
    return shortest_time_for(min(float(np.median(record.steps_s)) for record in records))


@dataclass(frozen=True, eq=False)
class FitRecord:
    """A recording as the fit sees it, arrays of shape (n_samples,).

    Attributes:
        recording: where it comes from.
        time_s: time since the first sample [s].
        steps_s: steps [s].
        voltage_v: drive [V].
        measured_um: displacement [um].
        is_used: samples a fit may learn from.
        covariates: what was recorded beside drive and displacement.
        substeps: how finely the steps of the drive are divided, whatever the model.
        tally: how much has been simulated of it, in whatever choice of samples.
        divisions: of its drive, as it was divided last.
    """

    recording: Recording
    time_s: Array
    steps_s: Array
    voltage_v: Array
    measured_um: Array
    is_used: NDArray[np.bool_]
    covariates: Covariates
    substeps: Substeps = Substeps.NONE
    tally: WorkTally = field(default_factory=WorkTally)
    divisions: KeptDivisions = field(default_factory=KeptDivisions)

    @classmethod
    def of(
        cls,
        recording: Recording,
        is_used: NDArray[np.bool_] | None = None,
        substeps: Substeps = Substeps.NONE,
    ) -> FitRecord:
        """Return the prepared recording; every valid sample used, and no step divided, unless told."""
        return cls(
            recording,
            recording.time_s - recording.time_s[0],
            recording.steps_s,
            recording.voltage_v,
            recording.measured_um,
            recording.valid_samples if is_used is None else is_used & recording.valid_samples,
            Covariates.of_recording(recording),
            substeps,
        )

    def using(self, is_used: NDArray[np.bool_]) -> FitRecord:
        """Return the same record with another choice of samples; those that are not valid are never used."""
        return replace(self, is_used=is_used & self.recording.valid_samples)

    def at_rest(self) -> Prehistory:
        """Return the start from a long rest at the first voltage."""
        return Prehistory.long_rest(float(self.voltage_v[0]))

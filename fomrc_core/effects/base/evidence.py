"""What an effect may look at to propose trial instances of itself: the records and what the model left over."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.effects.base.covariates import NO_COVARIATES, Covariate, Covariates
from fomrc_core.records.drive import n_loop_kinds

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RecordEvidence:
    """One record with the residual of the present model, all arrays of shape (n_samples,).

    Attributes:
        time_s: sample times from the record's start [s].
        steps_s: step that leads to each sample [s].
        voltage_v: drive [V].
        predicted_um: displacement the present model gives [um].
        residual_um: measured minus predicted [um], offset removed.
        covariates: what was recorded beside drive and displacement.
        sensor_step_um: step all readings are whole multiples of [um]; nan where there is none.
        step_response: asked for what the model shows after a small step of the drive, of its end [1], sample by sample,
            hysteresis and creep aside; None where nobody knows.
    """

    time_s: Array
    steps_s: Array
    voltage_v: Array
    predicted_um: Array
    residual_um: Array
    covariates: Covariates = NO_COVARIATES
    sensor_step_um: float = math.nan
    step_response: Callable[[], Array] | None = None

    def has(self, covariate: Covariate) -> bool:
        """Return whether this signal was recorded."""
        return self.covariates.of(covariate) is not None


@dataclass(frozen=True, eq=False)
class Evidence:
    """All records a diagnosis learns from.

    Attributes:
        records: what trial instances are proposed for.
        noise_um: noise floor [um].
        beside: the other records there are, where instances are proposed for one record alone.
    """

    records: tuple[RecordEvidence, ...]
    noise_um: float
    beside: tuple[RecordEvidence, ...] = ()

    @property
    def sample_period_s(self) -> float:
        """Median step of the first record [s]."""
        return float(np.median(self.records[0].steps_s))

    @property
    def duration_s(self) -> float:
        """Length of the longest record [s]."""
        return max(float(record.time_s[-1]) for record in self.records)

    @property
    def largest_v(self) -> float:
        """Largest voltage of any record [V]."""
        return max(float(np.max(record.voltage_v)) for record in self.records)

    @property
    def smallest_v(self) -> float:
        """Smallest voltage of any record [V]."""
        return min(float(np.min(record.voltage_v)) for record in self.records)

    @property
    def fastest_v_per_s(self) -> float:
        """Largest rate of the drive [V/s]."""
        return max(float(np.max(np.abs(np.diff(r.voltage_v) / r.steps_s[1:]))) for r in self.records)

    @property
    def n_loop_kinds(self) -> int:
        """Number of kinds of loops of the drive."""
        return n_loop_kinds([record.voltage_v for record in self.records])

    @property
    def stroke_um(self) -> float:
        """Range of the predicted displacement [um]."""
        return max(float(np.ptp(record.predicted_um)) for record in self.records)

    def stroke_per(self, covariate: Covariate) -> float:
        """Return the stroke over the range of a signal [um per unit]; 0 where it was not recorded or rests."""
        recorded = [r.covariates.of(covariate) for r in self.records]
        largest = max((float(np.ptp(values)) for values in recorded if values is not None), default=0.0)
        return self.stroke_um / largest if largest > 0.0 else 0.0

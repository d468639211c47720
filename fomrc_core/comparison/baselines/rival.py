"""What a rival is: fitted on records, it simulates, and inverts where it can. For comparison only."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.pulse import beat
from fomrc_core.errors import ParameterError
from fomrc_core.records.recording import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TrainingRecord:
    """A record as rivals are fitted on it: what came before it is part of the drive, but is not scored.

    Attributes:
        steps_s: step that leads to each sample [s], shape (n_samples,).
        voltage_v: drive [V], shape (n_samples,).
        displacement_um: measured displacement [um], arbitrary offset, shape (n_samples,).
        is_scored: which samples count, shape (n_samples,).
        n_before: samples put before the record, where nothing was measured.
    """

    steps_s: Array
    voltage_v: Array
    displacement_um: Array
    is_scored: NDArray[np.bool_]
    n_before: int = 0

    def centred(self, values: Array) -> Array:
        """Return the scored rows of the values less their mean: the offset of a sensor is arbitrary."""
        scored = values[self.is_scored]
        centred: Array = scored - scored.mean(axis=0)
        return centred


def training_record(recording: Recording, *, settle_s: float = 0.0, skip_s: float = 0.0) -> TrainingRecord:
    """Return the record with its voltage held for ``settle_s`` before it, the first ``skip_s`` not scored."""
    n_held = round(settle_s / recording.sample_period_s)
    voltage = np.concatenate([np.full(n_held, recording.voltage_v[0]), recording.voltage_v])
    displacement = np.concatenate([np.full(n_held, recording.measured_um[0]), recording.measured_um])
    steps = np.concatenate([np.full(n_held, recording.sample_period_s), recording.steps_s])
    elapsed = recording.time_s - recording.time_s[0]
    is_scored = np.concatenate([np.zeros(n_held, dtype=bool), (elapsed >= skip_s) & recording.valid_samples])
    return TrainingRecord(steps, voltage, displacement, is_scored, n_held)


class FittedRival(ABC):
    """A rival with its parameters found; starts relaxed every time."""

    has_inverse: bool = True

    @property
    @abstractmethod
    def n_parameters(self) -> int:
        """Number of parameters fitted, those that ended at zero not counted."""

    @abstractmethod
    def simulate(self, steps_s: Array, voltage_v: Array) -> Array:
        """Return the displacement [um] for a drive [V], shape (n_samples,)."""

    def invert(self, steps_s: Array, desired_um: Array) -> Array:
        """Return the drive [V] for a desired displacement [um], shape (n_samples,).

        Raises:
            ParameterError: the rival has no inverse.
        """
        raise ParameterError("rival has no inverse", where=type(self).__name__)


class Rival(ABC):
    """A way to model an actuator, before it is fitted.

    Attributes:
        name: short name for tables.
        publication: where it was published.
    """

    name: str
    publication: str

    @abstractmethod
    def fit(self, records: Sequence[TrainingRecord]) -> FittedRival:
        """Return the rival fitted on the records.

        Raises:
            ParameterError: the records do not determine it.
        """


def training_error_um(fitted: FittedRival, records: Sequence[TrainingRecord]) -> float:
    """Return the rms error over all scored samples [um], the offset of each record removed."""
    squares, count = 0.0, 0
    for record in records:
        beat("simulations")
        error = record.centred(record.displacement_um - fitted.simulate(record.steps_s, record.voltage_v))
        squares += float(error @ error)
        count += error.size
    return float(np.sqrt(squares / count))

"""What may be recorded beside drive and displacement, and which of it an effect reads."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from fomrc_core.records.recording import Recording

Array = NDArray[np.float64]


class Covariate(Enum):
    """A signal recorded beside drive and displacement; the value is its name in ``Covariates``."""

    TEMPERATURE = "temperature_c"
    SECOND_AXIS = "cross"


@dataclass(frozen=True, eq=False)
class Covariates:
    """The signals beside drive and displacement, each of shape (n_samples,) or None where it is not known.

    Attributes:
        temperature_c: temperature [degC].
        cross: the second axis, displacement [um] where recorded, else voltage [V].
    """

    temperature_c: Array | None = None
    cross: Array | None = None

    @classmethod
    def of_recording(cls, recording: Recording) -> Covariates:
        """Return those of a recording."""
        cross = recording.cross_displacement_um
        return cls(recording.temperature_c, recording.cross_voltage_v if cross is None else cross)

    @classmethod
    def at_one_sample(cls, temperature_c: float, cross: float) -> Covariates:
        """Return those of one sample, not a number where they are not known."""
        known = (None if np.isnan(value) else np.array([value]) for value in (temperature_c, cross))
        return cls(*known)

    def of(self, which: Covariate | None) -> Array | None:
        """Return one of the signals; None where it is not known, or where none is asked for."""
        found: Array | None = None if which is None else getattr(self, which.value)
        return found

    def part(self, samples: slice) -> Covariates:
        """Return the signals at some of the samples."""
        return Covariates(*(None if v is None else v[samples] for v in (self.temperature_c, self.cross)))


NO_COVARIATES = Covariates()

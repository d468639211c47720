"""What stands between voltages and modes in a fit: plays, and a smooth relay of the drive's rate, linear in weights."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled
from fomrc_core.identification.axes.fit import AxesFit
from fomrc_core.identification.axes.kept_descents import KeptDescents
from fomrc_core.identification.axes.periodic import PeriodicRecord
from fomrc_core.identification.axes.response import ResponseFit

Array = NDArray[np.float64]

# Shares of the lowest level at which plays stand: one for what acts like a relay, one for large loops.
PLAY_SHARES = (0.03, 1.0)
RELAY_SHARE = 0.6  # of the lowest level, by which a voltage changes in a step where the relay of the rate bends


@dataclass(frozen=True, eq=False)
class DriveShape:
    """What stands between voltage and modes, but for its weights: thresholds of plays [V], step [V] of the relay."""

    thresholds: Array
    relay_v: float

    @property
    def n_rows(self) -> int:
        """Rows of weights: one for each play, two for the relay."""
        return self.thresholds.size + (2 if self.relay_v > 0.0 else 0)

    @property
    def n_constants(self) -> int:
        """Numbers beside the weights."""
        return self.thresholds.size + (1 if self.relay_v > 0.0 else 0)

    def spectra(self, record: PeriodicRecord) -> NDArray[np.complex128]:
        """Return spectra of what the weights weigh, (n_rows, I, K)."""
        voltage = record.voltage_v
        found = record.spectrum_of(settled_plays(voltage, self.thresholds))
        if self.relay_v <= 0.0:
            return found
        bent = record.spectrum_of(np.arctan((voltage - np.roll(voltage, 1, axis=1)) / self.relay_v))
        late = bent * np.exp(-2j * np.pi * record.frequency_hz / record.rate_hz)
        return np.concatenate([found, bent[None], late[None]])


LINEAR = DriveShape(np.zeros(0), 0.0)


@dataclass(frozen=True, eq=False)
class FitSetting:
    """What the fits of one identification have in common.

    Attributes:
        reference_v: level at which the modes are as they are [V rms].
        drive: what stands between voltages and modes.
        kept: descents of an identification that was stopped.
    """

    reference_v: float
    drive: DriveShape = LINEAR
    kept: KeptDescents = field(default_factory=KeptDescents)

    def fit_of(self, records: tuple[PeriodicRecord, ...]) -> AxesFit:
        """Return the fit of a model with such a drive to records."""
        spectra = [self.drive.spectra(record) for record in records]
        return AxesFit(ResponseFit(records, spectra, self.reference_v, self.drive.thresholds.size), self.kept)


@compiled
def settled_plays(voltage_v: Array, thresholds: Array) -> Array:
    """Return the plays of periodic drives (I, N) in their second period, (P, I, N)."""
    out = np.empty((thresholds.size, voltage_v.shape[0], voltage_v.shape[1]))
    for p in range(thresholds.size):
        for i in range(voltage_v.shape[0]):
            play = 0.0
            for _ in range(2):
                for n in range(voltage_v.shape[1]):
                    value = voltage_v[i, n]
                    play = min(max(play, value - thresholds[p]), value + thresholds[p])
                    out[p, i, n] = play
    return out

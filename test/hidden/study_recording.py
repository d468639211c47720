"""What a hidden world measured, as the recording a diagnosis is given."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from fomrc_core.records.recording import Recording


class Measured(Protocol):
    """One record of any world: columns of a file, arrays of shape (n_samples,), None where one was not recorded."""

    @property
    def name(self) -> str: ...
    @property
    def time_s(self) -> np.ndarray: ...
    @property
    def voltage_v(self) -> np.ndarray: ...
    @property
    def measured_um(self) -> np.ndarray: ...
    @property
    def temperature_c(self) -> np.ndarray | None: ...
    @property
    def cross_voltage_v(self) -> np.ndarray | None: ...
    @property
    def cross_displacement_um(self) -> np.ndarray | None: ...


def recording_of(record: Measured) -> Recording:
    """Wrap what was measured as a recording."""
    from fomrc_core.records.recording import Recording

    return Recording(
        record.time_s,
        record.voltage_v,
        displacement_um=record.measured_um,
        temperature_c=record.temperature_c,
        cross_voltage_v=record.cross_voltage_v,
        cross_displacement_um=record.cross_displacement_um,
        name=record.name,
    )

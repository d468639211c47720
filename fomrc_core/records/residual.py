"""Measured minus predicted: the one sign convention, and the one normalised error."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import RecordingError

Array = NDArray[np.float64]


def residual_um(measured_um: Array, predicted_um: Array) -> Array:
    """Return measured minus predicted displacement [um], shape (n_samples,)."""
    return np.asarray(measured_um, dtype=np.float64) - np.asarray(predicted_um, dtype=np.float64)


def rms(values: Array) -> float:
    """Return the root mean square, in the unit of the values."""
    return float(np.sqrt(np.mean(np.square(values))))


def nrmse_percent(measured_um: Array, predicted_um: Array) -> float:
    """Return 100 RMSE / (max - min of the measured displacement) [%].

    Raises:
        RecordingError: the measured displacement does not move.
    """
    span = float(np.ptp(measured_um))
    if not span > 0.0:
        raise RecordingError("measured displacement is constant", where="displacement_um", value=span, allowed="> 0 um")
    return 100.0 * rms(residual_um(measured_um, predicted_um)) / span

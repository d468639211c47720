"""Measured minus predicted: the one sign convention, the one normalised error, the one measure of non-linearity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.errors import RecordingError


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
    return normalised_percent(rms(residual_um(measured_um, predicted_um)), [measured_um])


def normalised_percent(error_um: float, measured_um: Sequence[Array]) -> float:
    """Return an error in percent of the range of the measured displacement, the widest range of several records.

    Each record has an offset of its own, so that a range over several records together says nothing.

    Args:
        error_um: error, rms or other [um].
        measured_um: measured displacement of each record [um], each of shape (n_samples,).

    Raises:
        RecordingError: the measured displacement does not move.
    """
    span = max(float(np.ptp(values)) for values in measured_um)
    if not span > 0.0:
        raise RecordingError("measured displacement is constant", where="displacement_um", value=span, allowed="> 0 um")
    return 100.0 * error_um / span


def nonlinearity_percent(desired_um: Array, reached_um: Array) -> float:
    """Return the largest deviation from the best straight line, of the largest displacement [%], figure 16.

    The paper does not define it. Of the largest displacement, a loop like Table 1's has 12 %, as figure 16
    says; of the whole range it would have 6 %.

    Args:
        desired_um: desired displacement [um], shape (n_samples,).
        reached_um: displacement from the relaxed state [um], shape (n_samples,).

    Raises:
        RecordingError: the stage does not move.
    """
    largest = float(np.max(np.abs(reached_um)))
    if not largest > 0.0:
        raise RecordingError("displacement is zero", where="displacement_um", value=largest, allowed="> 0 um")
    slope, offset = np.polyfit(desired_um, reached_um, 1)
    deviation = float(np.max(np.abs(reached_um - (slope * desired_um + offset))))
    return 100.0 * deviation / largest

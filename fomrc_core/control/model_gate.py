"""The gate between a calibration and the model in force: what was measured must be a stage that follows its voltage."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter, minimum_filter1d

from fomrc_core.control.plausible_model import check_plausible
from fomrc_core.errors import FomrcError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.record_start import estimate_start, simulate_from
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import residual_um, rms

Array = NDArray[np.float64]

# The widest loops of piezo ceramics are a fifth of the stroke; a straight line through the parabolic arcs of such a
# loop leaves a quarter of the displacement's standard deviation. A model with hysteresis that leaves more has not
# understood what it was shown.
LARGEST_UNEXPLAINED_SHARE = 0.25
# Beyond eight standard deviations, these estimated by the median so that outliers do not hide themselves, noise of
# any common kind leaves less than one sample in a million.
_OUTLIER_DEVIATIONS = 8.0
LARGEST_OUTLIER_SHARE = 1e-3
_MAD_TO_DEVIATION = 1.4826
# On a busy machine a displacement is paired with a voltage some samples early or late; what that explains is no
# outlier of the sensor. So many periods a message waits where a loop is late but not stopped.
_N_SAMPLES_LATE = 5
# An outlier stands apart from the readings about it, these few to either side. Where a model errs for a while (at the
# start of a record, after a voltage that was held up) it is the model, and the readings are as they should be.
_N_ABOUT = 2 * _N_SAMPLES_LATE + 1


def model_error_um(model: PiezoModel, recording: Recording) -> Array:
    """Return measured minus predicted displacement [um] where it counts, offset removed, shape (n_valid,)."""
    predicted_um = simulate_from(model, recording, estimate_start(model, recording))
    error = residual_um(recording.measured_um, predicted_um)[recording.valid_samples]
    return np.asarray(error - np.mean(error))


def why_refused(model: PiezoModel, recording: Recording, *, in_force: PiezoModel | None = None) -> str:
    """Return why a calibrated model must not be put in force, "" where it may.

    Args:
        model: the model fitted to the record.
        recording: what was driven and measured.
        in_force: the model it is to take the place of, None where there is none.
    """
    valid = recording.valid_samples
    voltage_v, measured_um = recording.voltage_v[valid], recording.measured_um[valid]
    spread_um = float(np.std(measured_um))
    if not spread_um > 0.0:
        return "the displacement did not move"
    slope = float(np.polyfit(voltage_v, measured_um, 1)[0])
    if slope <= 0.0:
        return f"the displacement falls as the voltage rises ({slope:.3g} um/V): is the sensor or the drive reversed?"
    try:
        check_plausible(model)
    except FomrcError as error:
        return str(error)
    error_um = model_error_um(model, recording)
    share = rms(error_um) / spread_um
    if not share <= LARGEST_UNEXPLAINED_SHARE:
        return (
            f"the model leaves {100.0 * share:.0f} % of the displacement's deviation unexplained "
            f"(allowed {100.0 * LARGEST_UNEXPLAINED_SHARE:.0f} %): the displacement does not follow the voltage"
        )
    outliers = outlier_share(error_um, measured_um - error_um)
    if outliers > LARGEST_OUTLIER_SHARE:
        return (
            f"{100.0 * outliers:.2g} % of the displacements are outliers "
            f"(allowed {100.0 * LARGEST_OUTLIER_SHARE:g} %): look at the sensor and its cable"
        )
    return "" if in_force is None else _why_worse(error_um, model_error_um(in_force, recording))


def outlier_share(error_um: Array, predicted_um: Array) -> float:
    """Return the share of errors that neither noise nor a sample taken early or late explains, nor those about them.

    Args:
        error_um: errors [um], shape (n_samples,).
        predicted_um: what was predicted at the same times [um], shape (n_samples,).
    """
    near = 2 * _N_SAMPLES_LATE + 1
    passed_um = maximum_filter1d(predicted_um, near) - minimum_filter1d(predicted_um, near)
    is_outlier = np.ones(error_um.size, dtype=np.bool_)
    for usual_um in (np.median(error_um), median_filter(error_um, _N_ABOUT, mode="nearest")):
        deviations = np.abs(error_um - usual_um)
        limit = _OUTLIER_DEVIATIONS * _MAD_TO_DEVIATION * float(np.median(deviations))
        is_outlier &= (deviations > limit + passed_um) & (limit > 0.0)
    return float(np.mean(is_outlier))


def _why_worse(error_um: Array, in_force_error_um: Array) -> str:
    # Both are judged by the same samples with the same noise; an rms of n samples is known to 1/sqrt(2 n) of itself.
    tolerance = 3.0 / np.sqrt(2.0 * error_um.size)
    new_um, old_um = rms(error_um), rms(in_force_error_um)
    if new_um <= old_um * (1.0 + tolerance):
        return ""
    return (
        f"on the same record it is worse than the model in force "
        f"({1e3 * new_um:.3g} nm rms beside {1e3 * old_um:.3g} nm)"
    )


def fewer_elements(n_elements: int, undetermined: Sequence[int]) -> int:
    """Return with how many elements to fit anew where the drive leaves some undetermined."""
    return max(n_elements - len(undetermined), 1)

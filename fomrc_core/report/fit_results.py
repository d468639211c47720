"""An identification, and how sure it is, as plain numbers for programs."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from fomrc_core.report.quality_view import quality_results

if TYPE_CHECKING:
    from fomrc_core.fitting.long_records import Thinning
    from fomrc_core.identification.fit import Fit
    from fomrc_core.identification.uncertainty import Uncertainty


def uncertainty_results(sure: Uncertainty) -> dict[str, Any]:
    """Return the same as plain numbers and lists, None where there is no number."""
    return {
        "creep_order_interval": [_number(v) for v in sure.creep_order_interval],
        "last_kappa_interval_um_per_v": [_number(v) for v in sure.last_kappa_interval_um_per_v],
        "elements": [
            {
                "number": element.number,
                "kappa_relative_error": _number(element.kappa_relative_error),
                "saturation_relative_error": _number(element.saturation_relative_error),
                "knee_v": _number(element.knee_v),
                "is_determined": element.is_determined,
            }
            for element in sure.elements
        ],
        "advice": list(sure.advice),
    }


def fit_results(fit: Fit, record_names: list[str], method: str) -> dict[str, Any]:
    """Return a fit as plain numbers and lists, None where there is no number."""
    return {
        "records": record_names,
        "method": method,
        "outcome": fit.outcome.value,
        "reason": fit.reason,
        "rms_um": _number(fit.rms_um),
        "nrmse_percent": _number(fit.nrmse_percent),
        "noise_um": _number(fit.noise_um),
        "test_nrmse_percent": _number(fit.test_nrmse_percent),
        "offsets_um": [_number(offset) for offset in fit.offsets_um],
        "starts": list(fit.starts),
        "data_quality": [quality_results(quality) for quality in fit.data_quality],
        "creep_order": fit.model.creep_order,
        "creep_order_standard_error": _number(fit.creep_order_standard_error),
        "relative_standard_errors": [_number(error) for error in fit.relative_standard_errors],
        "undetermined_elements": list(fit.undetermined_elements),
        "thinning": thinning_results(fit.thinning),
        "model": fit.model.to_mapping(),
    }


def thinning_results(thinning: Thinning | None) -> dict[str, Any] | None:
    """Return how long records were thinned, and what that loses, as plain numbers; None where they were not."""
    if thinning is None:
        return None
    plain = {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(thinning).items()}
    return {**plain, "words": list(thinning.sentences())}


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None

"""What recordings are good for, as plain numbers for programs."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from fomrc_core.report.fit_results import uncertainty_results

if TYPE_CHECKING:
    from fomrc_core.report.recording_check import RecordingCheck


def check_results(check: RecordingCheck) -> dict[str, Any]:
    """Return a check as numbers, strings and lists."""
    return {
        "is_good": check.is_good,
        "drive": asdict(check.drive),
        "noise_floor_um": check.noise.floor_um,
        "fit_rms_um": check.fit.rms_um,
        "creep_order": check.uncertainty.creep_order,
        "creep_order_relative_error": check.order_error,
        "uncertainty": uncertainty_results(check.uncertainty),
        "detectable": {cause: dict(size) for cause, size in check.detectable.items()},
        "record_next": [asdict(addition) for addition in check.additions],
    }

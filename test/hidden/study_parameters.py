"""How far the parameters found are from the truth, cause by cause."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from test.hidden.truth import HiddenCase

# The truth's name of the main parameter, and the product's.
_MAIN: dict[str, tuple[str, str]] = {
    "amplifier_bandwidth": ("cutoff_hz", "cutoff_hz"),
    "amplifier_slew_limit": ("slew_v_per_s", "slew_v_per_s"),
    "dac_quantization": ("step_v", "step_v"),
    "dead_zone": ("half_width_v", "half_width_v"),
    "transport_delay": ("delay_s", "delay_s"),
    "slow_relaxation": ("amplitude", "amplitude"),
    "mechanical_resonance": ("frequency_hz", "frequency_hz"),
    "external_load": ("size_um", "displacement_um"),
    "cross_axis": ("gain", "gain"),
    "gain_drift": ("per_s", "per_s"),
    "mains_hum": ("frequency_hz", "frequency_hz"),
    "initial_state": ("level_v", "extreme_v"),
    "clock_skew": ("ppm", "ppm"),
}


def parameter_error(cause: str, true: Mapping[str, Any], found: Mapping[str, Any], case: HiddenCase) -> float | None:
    """Return the relative error of a cause's main parameter; None where truth and product share none.

    A saturation is judged by the rails the drive meets, a sensor by its curve (both coefficients together),
    and a drift by its coefficient where truth and product share it.
    """
    if cause in _MAIN:
        true_name, found_name = _MAIN[cause]
        return abs(float(found[found_name]) / float(true[true_name]) - 1.0)
    if cause == "amplifier_saturation":
        drive_v = np.concatenate([r.voltage_v for r in case.recordings])
        errors = []
        if true["high_v"] < drive_v.max():
            errors.append(abs(float(found["high_v"]) / true["high_v"] - 1.0))
        if true["low_v"] > drive_v.min():
            errors.append(abs(float(found["low_v"]) / true["low_v"] - 1.0))
        return max(errors)
    if cause == "sensor_nonlinearity":
        x = np.concatenate([r.measured_um for r in case.recordings])
        x = np.linspace(x.min(), x.max(), 201)
        line = np.stack([np.ones_like(x), x], axis=1)

        def curve(parameters: Mapping[str, Any]) -> np.ndarray:
            bent = float(parameters["quadratic_per_um"]) * x**2 + float(parameters["cubic_per_um2"]) * x**3
            # Gain and offset of the sensor belong to the base model.
            return bent - line @ np.linalg.lstsq(line, bent, rcond=None)[0]

        wanted = curve(true)
        return float(np.linalg.norm(curve(found) - wanted) / np.linalg.norm(wanted))
    if cause == "thermal_drift" and "um_per_degc" in true:
        return abs(float(found["um_per_c"]) / true["um_per_degc"] - 1.0)
    if cause == "thermal_drift" and "rate_um_per_s" in true:
        span_s = case.recordings[0].duration_s
        drift = sum(float(found[n]) * span_s**k for n, k in (("um_per_s", 1), ("um_per_s2", 2), ("um_per_s3", 3)))
        drift += float(found["warm_up_um"]) * (1.0 - np.exp(-span_s / float(found["warm_up_s"])))
        return abs(drift / (true["rate_um_per_s"] * span_s) - 1.0)
    return None

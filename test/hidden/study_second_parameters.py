"""How far parameters found in the second world are from its truth, cause by cause."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from test.hidden.second.second_case import SecondCase

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
    "sensor_bandwidth": ("cutoff_hz", "cutoff_hz"),
    "drive_resonance": ("frequency_hz", "frequency_hz"),
    "lost_preload": ("kink_um", "kink_um"),
    "backlash": ("gap_um", "gap_um"),
    "voltage_dependent_capacitance": ("time_constant_s", "time_constant_s"),
    "unequal_lag": ("rising_s", "rising_s"),
    "charge_leak": ("time_constant_s", "time_constant_s"),
    "cyclic_sensor_error": ("period_um", "period_um"),
    "rate_dependent_hysteresis": ("per_v_per_s", "per_v_per_s"),
    "zero_order_hold": ("hold_s", "hold_s"),
}


def second_parameter_error(
    cause: str, true: Mapping[str, Any], found: Mapping[str, Any], case: SecondCase
) -> float | None:
    """Return the relative error of a cause's main parameter; None where truth and product share none.

    A saturation is judged by the rails the drive meets, a sensor by its curve, a drift by what it comes to over the
    training record.
    """
    if cause in _MAIN:
        true_name, found_name = _MAIN[cause]
        value = found.get(found_name)
        return None if value is None else abs(float(value) / float(true[true_name]) - 1.0)
    if cause == "amplifier_saturation":
        drive_v, span_v = case.train.voltage_v, case.scale.span_v
        errors = [abs(float(found[name]) - true[name]) / span_v for name in ("low_v", "high_v")]
        is_met = (true["low_v"] > drive_v.min(), true["high_v"] < drive_v.max())
        return max(error for error, met in zip(errors, is_met, strict=True) if met)
    if cause == "sensor_nonlinearity":
        return _curve_error(true, found, case)
    if cause == "thermal_drift":
        return _drift_error(true, found, case)
    return None


def _curve_error(true: Mapping[str, Any], found: Mapping[str, Any], case: SecondCase) -> float:
    # From the relaxed zero, at which every record of this world begins.
    x = case.train.clean_um - case.train.clean_um[0]
    x = np.linspace(x.min(), x.max(), 201)
    line = np.stack([np.ones_like(x), x], axis=1)

    def curve(parameters: Mapping[str, Any]) -> np.ndarray:
        bent = float(parameters["quadratic_per_um"]) * x**2 + float(parameters["cubic_per_um2"]) * x**3
        # Gain and offset of the sensor belong to the base model.
        return bent - line @ np.linalg.lstsq(line, bent, rcond=None)[0]

    wanted = curve(true)
    return float(np.linalg.norm(curve(found) - wanted) / np.linalg.norm(wanted))


def _drift_error(true: Mapping[str, Any], found: Mapping[str, Any], case: SecondCase) -> float:
    if "um_per_degc" in true:
        return abs(float(found["um_per_c"]) / true["um_per_degc"] - 1.0)
    span_s = float(case.train.time_s[-1])
    drift = sum(float(found[n]) * span_s**k for n, k in (("um_per_s", 1), ("um_per_s2", 2), ("um_per_s3", 3)))
    drift += float(found["warm_up_um"]) * -math.expm1(-span_s / float(found["warm_up_s"]))
    if "um_per_s" in true:
        wanted = true["um_per_s"] * span_s
    else:
        wanted = -true["amplitude_um"] * math.expm1(-span_s / true["time_constant_s"])
    return abs(drift / wanted - 1.0)

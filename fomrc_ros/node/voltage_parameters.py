"""The parameters that limit a voltage: the same names, ranges and defaults in every node that has them."""

from __future__ import annotations

from fomrc_ros.node.parameters import ParameterSpec

POLICIES = ("hold", "ramp")
# A piezo amplifier's control input; far above any, and far below what a typing error makes.
_LARGEST_VOLTAGE_V = 1000.0

LIMIT_SPECS = (
    ParameterSpec(
        "minimum_voltage_v",
        -2.5,
        "lowest voltage ever published",
        unit="V",
        minimum=-_LARGEST_VOLTAGE_V,
        maximum=_LARGEST_VOLTAGE_V,
    ),
    ParameterSpec(
        "maximum_voltage_v",
        2.5,
        "highest voltage ever published",
        unit="V",
        minimum=-_LARGEST_VOLTAGE_V,
        maximum=_LARGEST_VOLTAGE_V,
    ),
    ParameterSpec("slew_limit_v_per_s", 500.0, "fastest change of voltage", unit="V/s", minimum=1e-3, maximum=1e7),
    ParameterSpec(
        "safe_voltage_v",
        0.0,
        "voltage to ramp to when told to stop",
        unit="V",
        minimum=-_LARGEST_VOLTAGE_V,
        maximum=_LARGEST_VOLTAGE_V,
    ),
    ParameterSpec(
        "safe_ramp_v_per_s",
        10.0,
        "how fast to ramp to the safe voltage",
        unit="V/s",
        minimum=1e-3,
        maximum=1e7,
    ),
)

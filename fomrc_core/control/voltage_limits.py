"""What a voltage may do on its way out: clamp, slew limit and the ramp to a safe value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fomrc_core.errors import ParameterError
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


@dataclass(frozen=True)
class VoltageLimits:
    """Limits on the published voltage.

    Args:
        minimum_v: lowest voltage [V].
        maximum_v: highest voltage [V].
        slew_v_per_s: fastest change [V/s].
        safe_v: voltage to ramp to when told to stop [V].
        safe_ramp_v_per_s: how fast to ramp there [V/s].

    Raises:
        ParameterError: minimum not below maximum, safe voltage outside of them.
    """

    minimum_v: float
    maximum_v: float
    slew_v_per_s: float
    safe_v: float
    safe_ramp_v_per_s: float

    def __post_init__(self) -> None:
        if not self.minimum_v < self.maximum_v:
            raise ParameterError(
                "not below maximum_voltage_v",
                where="minimum_voltage_v",
                value=self.minimum_v,
                allowed=f"less than {self.maximum_v:g} V",
            )
        if not self.minimum_v <= self.safe_v <= self.maximum_v:
            raise ParameterError(
                "outside of the voltage limits",
                where="safe_voltage_v",
                value=self.safe_v,
                allowed=f"{self.minimum_v:g} to {self.maximum_v:g} V",
            )

    @classmethod
    def from_values(cls, values: Mapping[str, Any]) -> VoltageLimits:
        """Return the limits the node's parameters name."""
        return cls(
            values["minimum_voltage_v"],
            values["maximum_voltage_v"],
            values["slew_limit_v_per_s"],
            values["safe_voltage_v"],
            values["safe_ramp_v_per_s"],
        )

    def clamp(self, voltage_v: float) -> float:
        """Return the nearest voltage within the limits [V]."""
        return min(max(voltage_v, self.minimum_v), self.maximum_v)

    def approach(self, last_v: float, goal_v: float, step_s: float) -> float:
        """Return the voltage within clamp and slew limit that is nearest to the goal [V]."""
        reach = self.slew_v_per_s * step_s
        return min(max(self.clamp(goal_v), last_v - reach), last_v + reach)

    def ramp_to_safe(self, last_v: float, step_s: float) -> float:
        """Return the next voltage of the ramp to the safe one [V]."""
        reach = min(self.safe_ramp_v_per_s, self.slew_v_per_s) * step_s
        return min(max(self.safe_v, last_v - reach), last_v + reach)

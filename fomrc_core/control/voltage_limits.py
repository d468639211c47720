"""What a voltage may do on its way out: clamp, slew limit and the ramp to a safe value."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fomrc_core.errors import ParameterError

# A tick that comes late may go so many periods' reach and no more: to the stage all that lies between two voltages is
# one step, however long the node was held up before it. Two, for a timer's jitter may leave one period out.
_MOST_PERIODS = 2.0


@dataclass(frozen=True)
class VoltageLimits:
    """Limits on the published voltage.

    Args:
        minimum_v: lowest voltage [V].
        maximum_v: highest voltage [V].
        slew_v_per_s: fastest change [V/s].
        safe_v: voltage to ramp to when told to stop [V].
        safe_ramp_v_per_s: how fast to ramp there [V/s].
        most_step_s: longest time whose change one voltage may make at once [s].

    Raises:
        ParameterError: minimum not below maximum, safe voltage outside of them.
    """

    minimum_v: float
    maximum_v: float
    slew_v_per_s: float
    safe_v: float
    safe_ramp_v_per_s: float
    most_step_s: float = math.inf

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
        """Return the limits the node's parameters name, its rate_hz among them."""
        return cls(
            values["minimum_voltage_v"],
            values["maximum_voltage_v"],
            values["slew_limit_v_per_s"],
            values["safe_voltage_v"],
            values["safe_ramp_v_per_s"],
            _MOST_PERIODS / values["rate_hz"],
        )

    def clamp(self, voltage_v: float) -> float:
        """Return the nearest voltage within the limits [V]."""
        return min(max(voltage_v, self.minimum_v), self.maximum_v)

    def narrowed(self, other: VoltageLimits) -> VoltageLimits:
        """Return the limits that keep both these and others, the safe voltage as near to these as that allows.

        Raises:
            ParameterError: no voltage is within both.
        """
        low, high = max(self.minimum_v, other.minimum_v), min(self.maximum_v, other.maximum_v)
        return VoltageLimits(
            low,
            high,
            min(self.slew_v_per_s, other.slew_v_per_s),
            min(max(self.safe_v, low), high),
            min(self.safe_ramp_v_per_s, other.safe_ramp_v_per_s),
            min(self.most_step_s, other.most_step_s),
        )

    def approach(self, last_v: float, goal_v: float, step_s: float) -> float:
        """Return the voltage within clamp and slew limit that is nearest to the goal [V].

        The clamp comes last: where the limits have been narrowed and the last voltage lies beyond them, the next
        one lies within them, however far that is.
        """
        reach = self.slew_v_per_s * min(step_s, self.most_step_s)
        return self.clamp(min(max(self.clamp(goal_v), last_v - reach), last_v + reach))

    def ramp_to_safe(self, last_v: float, step_s: float) -> float:
        """Return the next voltage of the ramp to the safe one [V]."""
        reach = min(self.safe_ramp_v_per_s, self.slew_v_per_s) * min(step_s, self.most_step_s)
        return self.clamp(min(max(self.safe_v, last_v - reach), last_v + reach))

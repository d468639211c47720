"""Quality of service of the topics, each open to overrides by ``qos_overrides`` parameters."""

from __future__ import annotations

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rclpy.qos_overriding_options import QoSOverridingOptions

# Commands: only the newest counts.
COMMAND = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1, reliability=ReliabilityPolicy.RELIABLE)
# Measurements: a late one is worth less than the next one.
MEASUREMENT = qos_profile_sensor_data
# A measurement someone records: the same, but with room for a burst.
RECORDED_MEASUREMENT = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=2000, reliability=ReliabilityPolicy.BEST_EFFORT
)
# A result that late joiners must see too.
LATCHED = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


def overridable() -> QoSOverridingOptions:
    """Return options that let parameters override history, depth and reliability of a topic."""
    return QoSOverridingOptions.with_default_policies()

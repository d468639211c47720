"""Parameters that several nodes have alike."""

from __future__ import annotations

from fomrc_ros.conversions import INTERFACES
from fomrc_ros.node.parameters import ParameterSpec

VOLTAGE_INTERFACE = ParameterSpec(
    "voltage_interface",
    "float64",
    "message type of voltage: a number, a joint's effort, or an array of one",
    choices=INTERFACES,
    is_read_only=True,
)
SERVICE_TIMEOUT = ParameterSpec(
    "service_timeout_s",
    30.0,
    "how long the compensator's services may take to appear, and then to answer",
    unit="s",
    minimum=0.1,
    maximum=3600.0,
)

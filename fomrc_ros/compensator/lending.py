"""The compensator lends the voltage: a calibration drives the stage through it, and never beside it.

So there is one publisher of ``voltage``, one set of limits, and a memory of all that was driven. A borrower that
dies falls silent, and the lease runs out.
"""

from __future__ import annotations

import time

from rclpy.node import Node
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from fomrc_core.control.actuator_drive import ActuatorDrive
from fomrc_core.errors import FomrcError
from fomrc_ros.node.other_publishers import other_publishers
from fomrc_ros.node.quality_of_service import COMMAND, overridable


class LendingServices:
    """``~/borrow_voltage``, ``~/return_voltage`` and the topic ``~/borrowed_voltage`` (std_msgs/Float64, V).

    Args:
        node: the compensator.
        drive: what is lent.
        voltage_topic: topic of the voltage, to see who else publishes it.
    """

    def __init__(self, node: Node, drive: ActuatorDrive, voltage_topic: str) -> None:
        self._node, self._drive, self._voltage_topic = node, drive, voltage_topic
        node.create_service(Trigger, "~/borrow_voltage", self._on_borrow)
        node.create_service(Trigger, "~/return_voltage", self._on_return)
        node.create_subscription(
            Float64, "~/borrowed_voltage", self._on_voltage, COMMAND, qos_overriding_options=overridable()
        )

    def _on_borrow(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        others = other_publishers(self._node, self._voltage_topic)
        try:
            if others:
                raise FomrcError(f"{self._voltage_topic} is also published by {', '.join(others)}: stop that first")
            self._drive.lend(time.monotonic())
            response.success = True
            response.message = f"lent while it is asked for at least every {self._drive.settings.lease_s:g} s"
        except FomrcError as error:
            response.success, response.message = False, str(error)
        return response

    def _on_return(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._drive.take_back()
        response.message = "returned" if response.success else "it was not lent"
        return response

    def _on_voltage(self, message: Float64) -> None:
        self._drive.borrow(message.data, time.monotonic())

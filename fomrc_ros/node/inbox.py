"""Messages taken from the middleware when asked for, each with the time at which it was sent."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile


class Inbox:
    """Holds subscriptions of a node that no callback serves.

    The events executor of rclpy 9.1 cannot hand on when a message was sent, and when it gets round to a message says
    nothing about the stage. So a small node of its own, which no executor spins.

    Args:
        node: the node it belongs to; its names and clock are used.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._listener = rclpy.create_node(
            f"{node.get_name()}_inbox",
            context=node.context,
            namespace=node.get_namespace(),
            use_global_arguments=False,
            start_parameter_services=False,
            enable_rosout=False,
        )

    def subscription(self, kind: type[Any], topic: str, quality: QoSProfile) -> Callable[[], list[tuple[Any, float]]]:
        """Subscribe; return what takes the messages that have come since it was last called.

        Each comes with the time it was sent [s], or that of taking where time is simulated: that is in no message.
        """
        held = self._listener.create_subscription(
            kind, self._node.resolve_topic_name(topic), lambda message: None, quality
        )
        return lambda: self._taken(held)

    def close(self) -> None:
        """Listen no more."""
        self._listener.destroy_node()

    def _taken(self, subscription: Any) -> list[tuple[Any, float]]:
        is_simulated = self._node.get_parameter("use_sim_time").value
        now_s = 1e-9 * float(self._node.get_clock().now().nanoseconds)
        found = []
        with subscription.handle:
            while (taken := subscription.handle.take_message(subscription.msg_type, False)) is not None:
                message, info = taken
                sent_s = 1e-9 * float(info["source_timestamp"])
                found.append((message, now_s if is_simulated or not sent_s else sent_s))
        return found

"""Publishing that does not end a node where the middleware does not take a message."""

from __future__ import annotations

from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile

from fomrc_ros.node.quality_of_service import overridable

_SAID_AGAIN_AFTER_S = 5.0


class Sender:
    """A publisher that says what it could not send, and goes on.

    The middleware gives a message up where it has no room for it within a tenth of a second: a machine that is held
    up, or a reader that has stalled behind a topic that keeps all. The client library raises that; out of a timer it
    would end the node. A message lost is what every reader of a topic has to live with.

    Args:
        node: whose publisher it is.
        message_type: type of its messages.
        topic: name of its topic.
        profile: quality of service, open to overrides by ``qos_overrides`` parameters.

    Attributes:
        topic_name: full name of the topic.
        n_lost: messages the middleware did not take.
    """

    def __init__(self, node: Node, message_type: type, topic: str, profile: QoSProfile) -> None:
        self._node = node
        self._publisher = node.create_publisher(message_type, topic, profile, qos_overriding_options=overridable())
        self.topic_name: str = self._publisher.topic_name
        self.n_lost = 0
        self._n_lost_before = 0

    def send(self, message: Any) -> bool:
        """Publish; return whether the middleware took the message."""
        try:
            self._publisher.publish(message)
        except rclpy_implementation.RCLError as error:
            self.n_lost += 1
            self._node.get_logger().warning(
                f"{self.topic_name}: not sent, {self.n_lost} so far: {str(error).splitlines()[0]}",
                throttle_duration_sec=_SAID_AGAIN_AFTER_S,
            )
            return False
        return True

    def lost_since_asked(self) -> int:
        """Return how many more were lost than when this was asked before."""
        new, self._n_lost_before = self.n_lost - self._n_lost_before, self.n_lost
        return new

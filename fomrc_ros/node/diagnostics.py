"""/diagnostics at 1 Hz: what a node does, how well its loop keeps time, and what to look at."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.qos import QoSProfile

from fomrc_ros.node.runtime import steady_clock
from fomrc_ros.node.sender import Sender

OK, WARN, ERROR, STALE = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)
PERIOD_S = 1.0


@dataclass
class Report:
    """One status: level, summary and values."""

    level: bytes = OK
    message: str = "ok"
    values: dict[str, object] = field(default_factory=dict)

    def worsen(self, level: bytes, message: str) -> None:
        """Raise the level; the message of the worst finding wins, equals are joined."""
        if level > self.level:
            self.level, self.message = level, message
        elif level == self.level and level != OK:
            self.message += f"; {message}"


class DiagnosticsPublisher:
    """Publish a node's report once a second.

    Args:
        node: the node.
        hardware_id: what the node drives; its namespace is put before it, so that each axis has its own.
        describe: makes the report, called once a second.
        senders: what the node publishes with: what they lose is reported.
    """

    def __init__(
        self, node: Node, hardware_id: str, describe: Callable[[], Report], senders: Sequence[Sender] = ()
    ) -> None:
        self._node, self._describe, self._senders = node, describe, senders
        self._hardware_id = "/".join(filter(None, (node.get_namespace().strip("/"), hardware_id)))
        self._node_time_ns = node.get_clock().now().nanoseconds
        self._sender = Sender(node, DiagnosticArray, "/diagnostics", QoSProfile(depth=10))
        node.create_timer(PERIOD_S, self.publish, clock=steady_clock())

    def publish(self) -> None:
        """Publish the report now."""
        report = self._describe()
        self._look_at_clock(report)
        self._look_at_senders(report)
        status = DiagnosticStatus(
            level=report.level,
            name=self._node.get_fully_qualified_name().lstrip("/"),
            message=report.message[:500],
            hardware_id=self._hardware_id,
            values=[KeyValue(key=key, value=shown(value)) for key, value in report.values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._sender.send(message)

    def _look_at_senders(self, report: Report) -> None:
        for sender in self._senders:
            if sender.n_lost:
                report.values[f"lost{sender.topic_name.replace('/', '_')}_messages"] = sender.n_lost
            if n_new := sender.lost_since_asked():
                report.worsen(WARN, f"{n_new} messages of {sender.topic_name} not sent")

    def _look_at_clock(self, report: Report) -> None:
        before_ns, self._node_time_ns = self._node_time_ns, self._node.get_clock().now().nanoseconds
        if self._node.get_parameter("use_sim_time").value and self._node_time_ns == before_ns:
            said = "no /clock" if self._node_time_ns == 0 else "/clock stands still"
            report.worsen(WARN, f"{said}: use_sim_time is set, and nothing moves without it")


def shown(value: object) -> str:
    """Return a value as diagnostics text."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key}={shown(entry)}" for key, entry in value.items())
    return str(value)[:1000]

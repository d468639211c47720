"""What the compensators of the axes say of themselves: whether one is there, and whether its target is in reach."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

# Compensators report once a second: this many seconds without a report is one that is gone.
_SILENT_AFTER_S = 5.0


class AxisWatch:
    """Listens to /diagnostics for the compensators of some axes.

    Args:
        node: the node that listens.
        axes: namespaces of the axes, relative to the node's own.
    """

    def __init__(self, node: Node, axes: Sequence[str]) -> None:
        namespace = node.get_namespace().strip("/")
        self._axis_of = {"/".join(filter(None, (namespace, axis.strip("/"), "compensator"))): axis for axis in axes}
        self._shortfalls_um = dict.fromkeys(axes, 0.0)
        self._heard_at_s = dict.fromkeys(axes, -math.inf)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 50)

    def problems(self) -> list[str]:
        """Return what is wrong with the axes, one line each."""
        now_s = time.monotonic()
        found = []
        for axis, heard_at_s in self._heard_at_s.items():
            if now_s - heard_at_s > _SILENT_AFTER_S:
                found.append(f"{axis}: no compensator is heard of")
            elif self._shortfalls_um[axis] > 0.0:
                found.append(f"{axis}: saturated, target out of reach by {self._shortfalls_um[axis]:.3g} um")
        return found

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            axis = self._axis_of.get(status.name.lstrip("/"))
            if axis is None:
                continue
            self._heard_at_s[axis] = time.monotonic()
            told = {pair.key: pair.value for pair in status.values}
            try:
                shortfall_um = float(told.get("shortfall_um", "0"))
            except ValueError:
                continue
            self._shortfalls_um[axis] = shortfall_um if math.isfinite(shortfall_um) else 0.0

"""Listens to what is driven and what the stage does, each message at the time it was sent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from fomrc_core.control.heard_stage import heard_recording
from fomrc_core.errors import FomrcError
from fomrc_core.records.recording import Recording
from fomrc_ros.conversions import PositionInterface
from fomrc_ros.node.inbox import Inbox
from fomrc_ros.node.voltage_interface import VoltageInterface

# Two seconds at the fastest rate: taken many times a second, but a busy machine may be late.
_DEPTH = 10_000
_VOLTAGE = QoSProfile(depth=_DEPTH, reliability=ReliabilityPolicy.RELIABLE)
_DISPLACEMENT = QoSProfile(depth=_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)

Array = NDArray[np.float64]


class StageRecorder:
    """Takes the messages of ``voltage`` and ``displacement`` from the middleware when asked to.

    Args:
        node: the node it belongs to; its names and clock are used.
        interface: message type of displacement.
        voltage: message type of voltage.

    Attributes:
        voltage_v: the voltage last heard [V], None before the first.
        n_displacements: displacements heard that could be used.
    """

    def __init__(self, node: Node, interface: PositionInterface, voltage: VoltageInterface) -> None:
        self._interface, self._voltage_interface = interface, voltage
        self.voltage_v: float | None = None
        self.n_displacements = 0
        self._is_recording = False
        self._sent: list[tuple[float, float]] = []
        self._seen: list[tuple[float, float]] = []
        self._inbox = Inbox(node)
        self._voltages = self._inbox.subscription(voltage.message_type, "voltage", _VOLTAGE)
        self._displacements = self._inbox.subscription(interface.message_type, "displacement", _DISPLACEMENT)

    def close(self) -> None:
        """Listen no more."""
        self._inbox.close()

    def begin(self) -> None:
        """Keep what is heard from now on."""
        self.take()
        self._sent, self._seen = [], []
        self._is_recording = True

    def end(self) -> None:
        """Keep no more."""
        self.take()
        self._is_recording = False

    def take(self) -> None:
        """Take what has come."""
        for message, time_s in self._voltages():
            try:
                self.voltage_v = self._voltage_interface.voltage_v(message)
            except FomrcError:
                continue
            if self._is_recording:
                _append(self._sent, self._voltage_interface.time_s(message, time_s), self.voltage_v)
        for message, time_s in self._displacements():
            try:
                moved_um = self._interface.to_um(message)
            except FomrcError:
                continue  # counts as silence
            self.n_displacements += 1
            if self._is_recording:
                _append(self._seen, self._interface.time_s(message, time_s), moved_um)

    def drain(self) -> tuple[Array, Array]:
        """Return what was kept since the last call, times [s] and voltages [V], times and displacements [um].

        Each of shape (n, 2). It is kept no longer: for who listens without end.
        """
        sent, seen = np.array(self._sent).reshape(-1, 2), np.array(self._seen).reshape(-1, 2)
        # Times go forward from the last one, also over the seam.
        self._sent, self._seen = [], []
        return sent, seen

    def recording(self, name: str, n_expected: int, period_s: float) -> Recording:
        """Return what was driven and measured, at the times of the displacements.

        Args:
            name: name of the recording.
            n_expected: how many voltages were to be driven.
            period_s: the compensator's period [s].

        Raises:
            FomrcError: too little was heard to make a recording of.
        """
        sent, seen = np.array(self._sent), np.array(self._seen)
        if len(sent) < max(0.5 * n_expected, 10):
            raise FomrcError(f"only {len(sent)} voltages of {n_expected} heard of the compensator: is it driving?")
        if len(seen) < 0.5 * len(sent):
            raise FomrcError(f"only {len(seen)} displacements for {len(sent)} voltages: is the stage running?")
        return heard_recording(sent, seen, period_s, name)


def _append(kept: list[tuple[float, float]], time_s: float, value: float) -> None:
    # Time goes forward in a recording, also where a simulated clock has not moved between two messages.
    if kept and time_s <= kept[-1][0]:
        time_s = float(np.nextafter(kept[-1][0], np.inf)) + 1e-9
    kept.append((time_s, value))

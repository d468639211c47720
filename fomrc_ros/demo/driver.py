"""The node that publishes the target of an experiment, and notes what comes back and when."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from fomrc_core.compute.arrays import Array
from fomrc_core.errors import FomrcError
from fomrc_ros.conversions import m_to_um, stamp_s, um_to_m
from fomrc_ros.demo.processor_waits import ProcessorWaits
from fomrc_ros.demo.response import Response, response_of
from fomrc_ros.demo.targets import RATE_HZ, Target
from fomrc_ros.node.quality_of_service import COMMAND, RECORDED_MEASUREMENT
from fomrc_ros.node.sender import Sender

COMPENSATED, UNCOMPENSATED = "compensated", "uncompensated"
# 20 ms between two looks at how long the processes waited: a look costs some 0.2 ms.
_TICKS_PER_LOOK = 10
# Three interpreters that load compiled kernels: some 10 s on an idle machine, ten times that on a busy one.
_READY_TIMEOUT_S = 180.0


class Driver(Node):
    """Publishes the target to the compensated axis, and the same target scaled to the uncompensated stage.

    Args:
        gain_um_per_v: constant gain that stands for compensation on the uncompensated axis [um/V].
        pids: process numbers of the nodes it drives.
        context: context of the demo's own domain.
        is_told_to_end: whether an experiment is to end before its time.
    """

    def __init__(
        self, gain_um_per_v: float, pids: Sequence[int], context: Context, is_told_to_end: Callable[[], bool]
    ) -> None:
        super().__init__("driver", context=context)
        self._gain_um_per_v = gain_um_per_v
        self._is_told_to_end = is_told_to_end
        self._position = Sender(self, Float64, f"{COMPENSATED}/desired_position", COMMAND)
        self._voltage = Sender(self, Float64, f"{UNCOMPENSATED}/voltage", COMMAND)
        self._seen: dict[str, list[tuple[float, float]]] = {COMPENSATED: [], UNCOMPENSATED: []}
        for axis, seen in self._seen.items():
            self.create_subscription(JointState, f"{axis}/displacement", self._recorder(seen), RECORDED_MEASUREMENT)
        # A voltage has no stamp: when it came is when the compensator lived, at the latest.
        self._compensator_lived_s: list[float] = []
        self.create_subscription(Float64, f"{COMPENSATED}/voltage", self._on_voltage, COMMAND)
        # Only the nodes themselves know whether they hear each other.
        self._told: dict[str, dict[str, str]] = {}
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self._pids = (os.getpid(), *pids)
        self._waits = ProcessorWaits(())
        self._waited: list[tuple[float, float]] = []
        self._sent: list[tuple[float, float]] = []
        self._target: Array | None = None
        self._next = 0
        self._finished: Future | None = None
        self._on_progress: Callable[[float], None] = lambda fraction: None
        self._last_um = 0.0
        self.create_timer(1.0 / RATE_HZ, self._tick)

    @property
    def is_ready(self) -> bool:
        """Whether every link holds: target to compensator, voltages to both stages, displacements back."""
        has_target = self._told.get(f"{COMPENSATED}/compensator", {}).get("target_um", "none") != "none"
        has_voltage = all(
            int(self._told.get(f"{axis}/simulated_pea", {}).get("voltage_messages", 0)) > 0 for axis in self._seen
        )
        return has_target and has_voltage and all(self._seen.values())

    def wait_until_ready(self, executor: object, check: Callable[[], None]) -> None:
        """Wait for both axes; ``check`` raises where there is nothing left to wait for.

        Raises:
            FomrcError: they did not answer in time.
        """
        deadline = time.monotonic() + _READY_TIMEOUT_S
        while not self.is_ready:
            check()
            if time.monotonic() > deadline:
                raise FomrcError(f"the nodes did not answer within {_READY_TIMEOUT_S:g} s")
            executor.spin_until_future_complete(Future(), timeout_sec=0.1)  # type: ignore[attr-defined]

    def start(self, target: Target, on_progress: Callable[[float], None]) -> Future:
        """Drive a target; the future completes when it is done, or is told to end."""
        for seen in (*self._seen.values(), self._sent, self._waited):
            seen.clear()
        self._compensator_lived_s.clear()
        self._waits.close()
        self._waits = ProcessorWaits(self._pids)
        self._target, self._next, self._on_progress = target.desired_um, 0, on_progress
        self._finished = Future()
        return self._finished

    def response(self, axis: str) -> Response:
        """Return how an axis answered: the target where it was at the time of each measurement."""
        others = [np.array(self._compensator_lived_s)] if axis == COMPENSATED else []
        return response_of(_pairs(self._sent), _pairs(self._seen[axis]), _pairs(self._waited), others)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self._told[status.name.lstrip("/")] = {pair.key: pair.value for pair in status.values}

    def _on_voltage(self, message: Float64) -> None:
        self._compensator_lived_s.append(self._now_s())

    def _recorder(self, seen: list[tuple[float, float]]) -> Callable[[JointState], None]:
        # By the stage's own stamps: when this process gets to read a message says nothing about the stage.
        return lambda message: seen.append((stamp_s(message.header.stamp), m_to_um(message.position[0])))

    def _now_s(self) -> float:
        return 1e-9 * float(self.get_clock().now().nanoseconds)

    def _tick(self) -> None:
        if self._target is not None:
            self._last_um = float(self._target[self._next])
            now_s = self._now_s()
            self._sent.append((now_s, self._last_um))
            self._next += 1
            if self._next % _TICKS_PER_LOOK == 0:
                self._waited.append((now_s, self._waits.longest_s()))
            if self._next % 50 == 0:
                self._on_progress(self._next / self._target.size)
            if self._next == self._target.size or self._is_told_to_end():
                self._target = None
                if self._finished is not None:
                    self._finished.set_result(None)
        self._position.send(Float64(data=um_to_m(self._last_um)))
        self._voltage.send(Float64(data=self._last_um / self._gain_um_per_v))


def _pairs(noted: list[tuple[float, float]]) -> Array:
    return np.array(noted, dtype=np.float64).reshape(-1, 2)

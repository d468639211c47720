"""The experiments of figures 15 and 16, driven through topics, with and without compensation."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from numpy.typing import NDArray
from rclpy.context import Context
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from fomrc_core.errors import FomrcError
from fomrc_ros.conversions import m_to_um, stamp_s, um_to_m
from fomrc_ros.node.quality_of_service import COMMAND, RECORDED_MEASUREMENT

Array = NDArray[np.float64]

RATE_HZ = 500.0
COMPENSATED, UNCOMPENSATED = "compensated", "uncompensated"
_READY_TIMEOUT_S = 60.0
_TRIANGLE_UM_PER_S = 1.2


@dataclass(frozen=True)
class Target:
    """A desired motion: displacement [um] at each tick of ``RATE_HZ``, and what to call it."""

    name: str
    desired_um: Array


@dataclass(frozen=True)
class Response:
    """How the stage answered.

    Attributes:
        time_s: times of measurement, by the stage's stamps [s].
        desired_um: desired displacement at these times [um].
        measured_um: measured displacement [um].
        largest_gap_s: longest time the target or the stage stood still because the machine was busy [s].
    """

    time_s: Array
    desired_um: Array
    measured_um: Array
    largest_gap_s: float

    @property
    def nrmse_percent(self) -> float:
        """100 RMSE over the range of the measured displacement."""
        error = self.measured_um - self.desired_um
        return float(100.0 * np.sqrt(np.mean(error**2)) / np.ptp(self.measured_um))

    @property
    def nonlinearity_percent(self) -> float:
        """Largest deviation from the best straight line, in per cent of the range."""
        line = np.polyfit(self.desired_um, self.measured_um, 1)
        deviation = np.abs(self.measured_um - np.polyval(line, self.desired_um))
        return float(100.0 * np.max(deviation) / np.ptp(self.measured_um))


def tracking_target(amplitude_um: float) -> Target:
    """Return the motion of figure 15: swings of changing size, and rests in which creep would show."""
    parts = [np.zeros(1)]

    def move(goal: float, duration_s: float) -> None:
        n = int(duration_s * RATE_HZ)
        blend = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, n + 1) / n)
        parts.append(parts[-1][-1] + (goal - parts[-1][-1]) * blend)

    def rest(duration_s: float) -> None:
        parts.append(np.full(int(duration_s * RATE_HZ), parts[-1][-1]))

    for goal, duration_s, rest_s in (
        (0.9, 3.0, 2.0),
        (-0.6, 4.0, 0.0),
        (0.5, 3.0, 2.0),
        (-1.0, 4.0, 1.0),
        (0.2, 3.0, 0.0),
        (-0.4, 2.0, 1.0),
        (0.0, 2.0, 1.0),
    ):
        move(goal, duration_s)
        if rest_s:
            rest(rest_s)
    return Target("tracking (figure 15)", amplitude_um * np.concatenate(parts))


def triangle_target(amplitude_um: float) -> Target:
    """Return the motion of figure 16: a triangle of decreasing amplitude, 1.2 um/s as at 1 V/s."""
    swings = [sign * share for share in (1.0, 0.8, 0.6, 0.4, 0.2) for sign in (1.0, -1.0)]
    corners = [0.0, *swings, 0.0]
    parts = [np.zeros(1)]
    for start, stop in pairwise(corners):
        n = int(abs(stop - start) * amplitude_um / _TRIANGLE_UM_PER_S * RATE_HZ)
        parts.append(start + (stop - start) * np.arange(1, n + 1) / n)
    return Target("triangle (figure 16)", amplitude_um * np.concatenate(parts))


class Driver(Node):
    """Publishes the target to the compensated axis, and the same target scaled to the uncompensated stage.

    Args:
        gain_um_per_v: constant gain that stands for compensation on the uncompensated axis [um/V].
        context: context of the demo's own domain.
    """

    def __init__(self, gain_um_per_v: float, context: Context) -> None:
        super().__init__("driver", context=context)
        self._gain_um_per_v = gain_um_per_v
        self._position = self.create_publisher(Float64, f"{COMPENSATED}/desired_position", COMMAND)
        self._voltage = self.create_publisher(Float64, f"{UNCOMPENSATED}/voltage", COMMAND)
        self._seen: dict[str, list[tuple[float, float]]] = {COMPENSATED: [], UNCOMPENSATED: []}
        for axis, seen in self._seen.items():
            self.create_subscription(JointState, f"{axis}/displacement", self._recorder(seen), RECORDED_MEASUREMENT)
        # Only the nodes themselves know whether they hear each other.
        self._told: dict[str, dict[str, str]] = {}
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
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
        """Drive a target; the future completes when it is done."""
        for seen in self._seen.values():
            seen.clear()
        self._sent = []
        self._target, self._next, self._on_progress = target.desired_um, 0, on_progress
        self._finished = Future()
        return self._finished

    def response(self, axis: str) -> Response:
        """Return how an axis answered: the target where it was at the time of each measurement."""
        sent, seen = np.array(self._sent), np.array(self._seen[axis])
        if len(seen) < 0.5 * len(sent):
            raise FomrcError(f"only {len(seen)} displacements of {axis} for {len(sent)} targets")
        inside = (seen[:, 0] >= sent[0, 0]) & (seen[:, 0] <= sent[-1, 0])
        time_s, measured_um = seen[inside, 0], seen[inside, 1]
        gap_s = max(float(np.max(np.diff(sent[:, 0]))), float(np.max(np.diff(time_s))))
        return Response(time_s - sent[0, 0], np.interp(time_s, sent[:, 0], sent[:, 1]), measured_um, gap_s)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self._told[status.name.lstrip("/")] = {pair.key: pair.value for pair in status.values}

    def _recorder(self, seen: list[tuple[float, float]]) -> Callable[[JointState], None]:
        # By the stage's own stamps: when this process gets to read a message says nothing about the stage.
        return lambda message: seen.append((stamp_s(message.header.stamp), m_to_um(message.position[0])))

    def _now_s(self) -> float:
        return 1e-9 * float(self.get_clock().now().nanoseconds)

    def _tick(self) -> None:
        if self._target is not None:
            self._last_um = float(self._target[self._next])
            self._sent.append((self._now_s(), self._last_um))
            self._next += 1
            if self._next % 50 == 0:
                self._on_progress(self._next / self._target.size)
            if self._next == self._target.size:
                self._target = None
                if self._finished is not None:
                    self._finished.set_result(None)
        self._position.publish(Float64(data=um_to_m(self._last_um)))
        self._voltage.publish(Float64(data=self._last_um / self._gain_um_per_v))

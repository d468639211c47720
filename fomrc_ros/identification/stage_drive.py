"""Drive a stage with a given voltage, tick by tick, and record what it does."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Float64

from fomrc_core.control.tick_grid import TickGrid
from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.errors import FomrcError
from fomrc_core.records.recording import Recording
from fomrc_ros.conversions import PositionInterface
from fomrc_ros.node.quality_of_service import COMMAND, RECORDED_MEASUREMENT, overridable

# Lags tried when voltage and displacement are brought together: message, stage and message again.
_LONGEST_LAG_PERIODS = 20
_LAGS_PER_PERIOD = 4

Array = NDArray[np.float64]


class StageDrive:
    """Publishes ``voltage`` while it drives, and listens to ``displacement``.

    Args:
        node: the node it belongs to.
        interface: message type of displacement.
        rate_hz: rate of the drive [Hz].
    """

    def __init__(self, node: Node, interface: PositionInterface, rate_hz: float) -> None:
        self._node, self._interface = node, interface
        self.period_s = 1.0 / rate_hz
        self.voltage_v: float | None = None
        self.n_done = 0
        self.n_total = 0
        self.is_driving = False
        self.is_silent_for_s = 0.0
        self._limits: VoltageLimits | None = None
        self._plan: list[float] = []
        self._sent: list[tuple[float, float]] = []
        self._seen: list[tuple[float, float]] = []
        self._is_recording = False
        self._timeout_s = 0.0
        self._last_tick_s: float | None = None
        self._finished: Future | None = None
        self._publisher: Any = None
        self._grid = TickGrid(self.period_s)
        self._message = Float64()
        self._subscriptions: list[Any] = []
        self._timer = node.create_timer(self.period_s, self._tick)
        self._timer.cancel()

    def listen(self) -> None:
        """Begin to listen to displacement, and to what others publish as voltage."""
        if self._subscriptions:
            return
        self._publisher = self._node.create_publisher(Float64, "voltage", COMMAND, qos_overriding_options=overridable())
        self._subscriptions = [
            self._node.create_subscription(
                self._interface.message_type,
                "displacement",
                self._on_displacement,
                RECORDED_MEASUREMENT,
                qos_overriding_options=overridable(),
            ),
            self._node.create_subscription(Float64, "voltage", self._on_voltage, COMMAND),
        ]

    def drive(
        self,
        voltages_v: Iterable[float],
        limits: VoltageLimits,
        *,
        records: bool = False,
        displacement_timeout_s: float = 0.0,
    ) -> Future:
        """Drive these voltages, one per tick; the future completes with a reason, "" where all went well.

        Args:
            voltages_v: voltages [V]; clamped and slew-limited.
            limits: voltage limits.
            records: keep what was driven and measured.
            displacement_timeout_s: fail where no displacement comes for this long [s], 0 for never.
        """
        if self.is_driving:
            raise FomrcError("the stage is being driven already")
        self._plan = list(voltages_v)
        self._limits = limits
        self.n_done, self.n_total = 0, len(self._plan)
        self._sent, self._seen = [], []
        self._is_recording = records
        self._timeout_s = displacement_timeout_s
        self.is_silent_for_s = 0.0
        self._grid.restart()
        self._finished = Future(executor=self._node.executor)
        self.is_driving = True
        self._timer.reset()
        return self._finished

    def drive_to(self, goal_v: float, limits: VoltageLimits) -> Future:
        """Ramp to a voltage [V] at the safe ramp's speed."""
        start_v = limits.safe_v if self.voltage_v is None else self.voltage_v
        n_ticks = max(int(np.ceil(abs(goal_v - start_v) / (limits.safe_ramp_v_per_s * self.period_s))), 1)
        return self.drive(np.linspace(start_v, goal_v, n_ticks + 1)[1:].tolist(), limits)

    def stop(self, reason: str) -> None:
        """Stop driving; the voltage stays where it is."""
        if self.is_driving:
            self._end(reason)

    def recording(self, name: str) -> Recording:
        """Return what was driven and measured, brought to the times of the voltage.

        Raises:
            FomrcError: too little displacement was received to make a recording of.
        """
        sent, seen = np.array(self._sent), np.array(self._seen)
        if len(seen) < 0.5 * len(sent) or len(sent) < 10:
            raise FomrcError(f"only {len(seen)} displacements for {len(sent)} voltages: is the stage running?")
        seen = seen[np.concatenate(([True], np.diff(seen[:, 0]) > 0.0))]
        lag_s = best_lag_s(sent, seen, self.period_s)
        inside = (sent[:, 0] + lag_s >= seen[0, 0]) & (sent[:, 0] + lag_s <= seen[-1, 0])
        time_s, voltage_v = with_held_voltage(sent[inside, 0], sent[inside, 1], self.period_s)
        moved = np.interp(time_s + lag_s, seen[:, 0], seen[:, 1])
        return Recording(time_s - time_s[0], voltage_v, moved, name=name)

    def _tick(self) -> None:
        if not self.is_driving or self._limits is None:
            return
        now_s = 1e-9 * self._node.get_clock().now().nanoseconds
        step_s = self._grid.step_s(now_s)
        self.is_silent_for_s += step_s
        if self._timeout_s and self.is_silent_for_s > self._timeout_s:
            self._end(f"no displacement for {self._timeout_s:g} s")
            return
        if self.n_done >= self.n_total:
            self._end("")
            return
        wanted = self._plan[self.n_done]
        last = self._limits.safe_v if self.voltage_v is None else self.voltage_v
        voltage_v = self._limits.approach(last, wanted, step_s)
        self.n_done += 1
        self.voltage_v = self._message.data = voltage_v
        self._publisher.publish(self._message)
        if self._is_recording:
            # The clock may not have moved between two ticks, where it is simulated.
            if self._sent and now_s <= self._sent[-1][0]:
                now_s = self._sent[-1][0] + 1e-3 * self.period_s
            self._sent.append((now_s, voltage_v))

    def _end(self, reason: str) -> None:
        self.is_driving = False
        self._timer.cancel()
        if self._finished is not None and not self._finished.done():
            self._finished.set_result(reason)

    def _on_displacement(self, message: Any) -> None:
        now_s = 1e-9 * self._node.get_clock().now().nanoseconds
        try:
            moved_um = self._interface.to_um(message)
        except FomrcError:
            return  # counts as silence
        self.is_silent_for_s = 0.0
        if self._is_recording and self.is_driving:
            self._seen.append((self._interface.time_s(message, now_s), moved_um))

    def _on_voltage(self, message: Float64) -> None:
        if not self.is_driving and np.isfinite(message.data):
            self.voltage_v = float(message.data)


def with_held_voltage(time_s: Array, voltage_v: Array, period_s: float) -> tuple[Array, Array]:
    """Return times and voltages with missed ticks filled in: the voltage was held until the next one.

    Args:
        time_s: times at which voltages were sent [s], shape (n,).
        voltage_v: the voltages [V], shape (n,).
        period_s: nominal period [s].
    """
    times, voltages = [time_s[:1]], [voltage_v[:1]]
    for k in range(1, time_s.size):
        if time_s[k] - time_s[k - 1] > 2.0 * period_s:
            missed = np.arange(time_s[k - 1] + period_s, time_s[k] - 0.5 * period_s, period_s)
            times.append(missed)
            voltages.append(np.full(missed.size, voltage_v[k - 1]))
        times.append(time_s[k : k + 1])
        voltages.append(voltage_v[k : k + 1])
    return np.concatenate(times), np.concatenate(voltages)


def best_lag_s(sent: Array, seen: Array, period_s: float) -> float:
    """Return the lag [s] at which displacement follows voltage best.

    Args:
        sent: times [s] and voltages [V], shape (n_sent, 2).
        seen: times [s] and displacements [um], shape (n_seen, 2).
        period_s: nominal period [s].
    """
    change_v = np.diff(sent[:, 1])
    best, best_score = 0.0, -np.inf
    for k in range(_LONGEST_LAG_PERIODS * _LAGS_PER_PERIOD + 1):
        lag_s = k * period_s / _LAGS_PER_PERIOD
        score = float(change_v @ np.diff(np.interp(sent[:, 0] + lag_s, seen[:, 0], seen[:, 1])))
        if score > best_score * (1.0 + 1e-6):
            best, best_score = lag_s, score
    return best

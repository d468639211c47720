"""Drive a stage through its compensator, tick by tick, and record what was driven and what the stage did."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Float64

from fomrc_core.control.tick_grid import TickGrid
from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.errors import FomrcError
from fomrc_core.records.recording import Recording
from fomrc_ros.identification.stage_recorder import StageRecorder
from fomrc_ros.node.quality_of_service import COMMAND
from fomrc_ros.node.runtime import steady_clock
from fomrc_ros.node.sender import Sender

# What was asked for is asked for again while nothing else is, so that the lease does not run out.
_RENEWAL_PERIOD_S = 0.2


class StageDrive:
    """Publishes the borrowed voltage while it drives, and listens to ``voltage`` and ``displacement``.

    Args:
        node: the node it belongs to.
        recorder: hears what is driven and what the stage does.
        rate_hz: rate of the drive [Hz].
        compensator: name of the compensator that lends its voltage.

    Attributes:
        is_borrowing: whether what is asked for is to be asked for again while nothing else is.
    """

    def __init__(self, node: Node, recorder: StageRecorder, rate_hz: float, compensator: str) -> None:
        self._node = node
        self.period_s = 1.0 / rate_hz
        self.n_done = self.n_total = 0
        self.is_driving = self.is_borrowing = False
        self._limits: VoltageLimits | None = None
        self._plan: list[float] = []
        self._recorder = recorder
        self._timeout_s = 0.0
        self._silent_s = self._astray_s = 0.0
        self._finished: Future | None = None
        self._grid = TickGrid(self.period_s)
        self._goal = Float64()
        self.sender = Sender(node, Float64, f"{compensator}/borrowed_voltage", COMMAND)
        self._timer = node.create_timer(self.period_s, self._tick)
        self._timer.cancel()
        node.create_timer(_RENEWAL_PERIOD_S, self._renew, clock=steady_clock())

    @property
    def voltage_v(self) -> float | None:
        """The voltage last heard from the compensator [V], None before the first."""
        return self._recorder.voltage_v

    def begin(self) -> None:
        """Forget what was heard of former drives; what is asked for from now on renews the lease."""
        self.is_borrowing = True
        self._goal.data = 0.0 if self.voltage_v is None else self.voltage_v

    def end(self) -> None:
        """Renew the lease no more."""
        self.is_borrowing = False

    def drive(
        self,
        voltages_v: Iterable[float],
        limits: VoltageLimits,
        *,
        records: bool = False,
        timeout_s: float = 0.0,
    ) -> Future:
        """Drive these voltages, one per tick; the future completes with a reason, "" where all went well.

        Args:
            voltages_v: voltages [V]; the compensator clamps and slews them.
            limits: voltage limits.
            records: keep what was driven and measured.
            timeout_s: fail where for this long [s] no displacement comes, or the voltage is another; 0 for never.
        """
        if self.is_driving:
            raise FomrcError("the stage is being driven already")
        self._plan = list(voltages_v)
        self._limits = limits
        self.n_done, self.n_total = 0, len(self._plan)
        if records:
            self._recorder.begin()
        self._timeout_s = timeout_s
        self._silent_s = self._astray_s = 0.0
        self._grid.restart()
        self._finished = Future(executor=self._node.executor)
        self.is_driving = True
        self._timer.reset()
        return self._finished

    def drive_to(self, goal_v: float, limits: VoltageLimits) -> Future:
        """Ramp to a voltage [V] at the safe ramp's speed."""
        start_v = self._goal.data if self.voltage_v is None else self.voltage_v
        n_ticks = max(int(np.ceil(abs(goal_v - start_v) / (limits.safe_ramp_v_per_s * self.period_s))), 1)
        return self.drive(np.linspace(start_v, goal_v, n_ticks + 1)[1:].tolist(), limits)

    def stop(self, reason: str) -> None:
        """Stop driving; the voltage stays where it is."""
        if self.is_driving:
            self._end(reason)

    def recording(self, name: str, period_s: float) -> Recording:
        """Return what was driven and measured in the last drive.

        Args:
            name: name of the recording.
            period_s: period of the compensator [s].

        Raises:
            FomrcError: too little was heard to make a recording of.
        """
        return self._recorder.recording(name, int(self.n_total * self.period_s / period_s), period_s)

    def close(self) -> None:
        """Listen no more."""
        self._recorder.close()

    def _tick(self) -> None:
        if not self.is_driving or self._limits is None:
            return
        step_s = self._grid.step_s(1e-9 * self._node.get_clock().now().nanoseconds)
        n_before = self._recorder.n_displacements
        self._recorder.take()
        self._silent_s = self._silent_s + step_s if self._recorder.n_displacements == n_before else 0.0
        self._note_astray(step_s, self._limits)
        if self._timeout_s and self._silent_s > self._timeout_s:
            self._end(f"no displacement for {self._timeout_s:g} s")
        elif self._timeout_s and self._astray_s > self._timeout_s:
            self._end(f"the compensator has not followed for {self._timeout_s:g} s: has it taken the voltage back?")
        elif self.n_done >= self.n_total:
            self._end("")
        else:
            self._goal.data = self._plan[self.n_done]
            self.n_done += 1
            self.sender.send(self._goal)

    def _note_astray(self, step_s: float, limits: VoltageLimits) -> None:
        # A twentieth of the range, or what the slew limit may leave behind in the time of a long gap.
        slack_v = max(0.05 * (limits.maximum_v - limits.minimum_v), 0.1 * limits.slew_v_per_s)
        is_astray = self.voltage_v is None or abs(self.voltage_v - self._goal.data) > slack_v
        self._astray_s = self._astray_s + step_s if is_astray and self.n_done else 0.0

    def _renew(self) -> None:
        self._recorder.take()
        if self.is_borrowing:
            self.sender.send(self._goal)

    def _end(self, reason: str) -> None:
        self.is_driving = False
        self._timer.cancel()
        self._recorder.end()
        if self._finished is not None and not self._finished.done():
            self._finished.set_result(reason)

"""Where the stage is: ``~/arrived`` out, and ``displacement`` in where there is a sensor to be used."""

from __future__ import annotations

import math
from typing import Any

from rclpy.node import Node
from std_msgs.msg import Bool

from fomrc_core.control.arrival import Arrival
from fomrc_core.control.compensation_loop import CompensationLoop
from fomrc_core.control.feedback import Feedback
from fomrc_core.control.stage_motion import StageMotion
from fomrc_core.errors import FomrcError
from fomrc_ros.conversions import PositionInterface
from fomrc_ros.node.diagnostics import WARN, Report
from fomrc_ros.node.quality_of_service import LATCHED, MEASUREMENT, overridable
from fomrc_ros.node.sender import Sender
from fomrc_ros.parameters.compensator import CompensatorSettings

_SAID_AGAIN_AFTER_S = 5.0
_MISSED_AFTER_S = 2.0  # a sensor that begins beside the node is heard by then


class MotionTopics:
    """Publishes ``~/arrived`` (std_msgs/Bool, latched), subscribes ``displacement`` where feedback is on.

    Args:
        node: the compensator.
        interface: how a position travels.
        settings: those in force.
        period_s: period of the loop [s].
    """

    def __init__(
        self, node: Node, interface: PositionInterface, settings: CompensatorSettings, period_s: float
    ) -> None:
        self._node, self._interface, self._period_s = node, interface, period_s
        self._motion = StageMotion(None, None)
        self._was_closed = False
        self._misses_since_s: float | None = (
            math.nan
        )  # the first measurement: nan before the first tick, None once told
        self._told: bool | None = None
        self._sender = Sender(node, Bool, "~/arrived", LATCHED)
        if settings.feedback_bandwidth_hz:
            node.create_subscription(
                interface.message_type,
                "displacement",
                self._on_displacement,
                MEASUREMENT,
                qos_overriding_options=overridable(),
            )
            self._motion.feedback = Feedback(settings.feedback_bandwidth_hz, period_s)
        self.apply(settings)

    @property
    def uses_sensor(self) -> bool:
        """Whether a sensor adds to the feedforward."""
        return self._motion.feedback is not None

    def apply(self, settings: CompensatorSettings) -> None:
        """Take over changed settings."""
        if self._motion.feedback is not None:
            self._motion.feedback.bandwidth_hz = settings.feedback_bandwidth_hz
        if not settings.arrival_tolerance_um:
            self._motion.arrival = None
        elif self._motion.arrival is None:
            self._motion.arrival = Arrival(settings.arrival_tolerance_um)
        else:
            self._motion.arrival.tolerance_um = settings.arrival_tolerance_um

    def begin(self, loop: CompensationLoop) -> None:
        """Begin with a loop, and with what it knows a sensor has added."""
        if self._motion.feedback is not None:
            self._motion.feedback = Feedback(self._motion.feedback.bandwidth_hz, self._period_s, loop.correction_um)

    def before_tick(self, loop: CompensationLoop | None) -> None:
        """Bring what the sensor has said into the loop."""
        feedback = self._motion.feedback
        if loop is None or feedback is None:
            return
        self._motion.before_tick(loop, self._now_s())
        self._tell_missing(feedback)
        if feedback.is_closed != self._was_closed:
            self._was_closed = feedback.is_closed
            logger, text = self._node.get_logger(), f"feedback {self._state(feedback)}"
            # A logger knows a line of the source by one severity.
            if feedback.is_closed:
                logger.info(text, throttle_duration_sec=_SAID_AGAIN_AFTER_S)
            else:
                logger.warning(text, throttle_duration_sec=_SAID_AGAIN_AFTER_S)

    def _tell_missing(self, feedback: Feedback) -> None:
        """Tell once where no sensor is there at all: nothing opens then, for nothing was closed."""
        if self._misses_since_s is None:
            return
        if math.isnan(self._misses_since_s):
            self._misses_since_s = self._now_s()
        if math.isfinite(feedback.displacement_um):
            self._misses_since_s = None
        elif self._now_s() - self._misses_since_s > _MISSED_AFTER_S:
            self._misses_since_s = None
            self._node.get_logger().warning(f"feedback {self._state(feedback)}: nothing is added without a sensor")

    def after_tick(self, loop: CompensationLoop | None) -> None:
        """Follow what was driven; tell where the stage has arrived, or no longer is there."""
        if loop is None or (self._motion.arrival is None and self._motion.feedback is None):
            return
        self._motion.after_tick(loop, self._now_s())
        has_arrived = self._motion.arrival is not None and self._motion.arrival.has_arrived
        if self._motion.arrival is not None and has_arrived != self._told:
            # One that is lost is told again with the next tick.
            self._told = has_arrived if self._sender.send(Bool(data=has_arrived)) else None

    def describe(self, report: Report) -> None:
        """Add what is known of the stage to a report."""
        arrival, feedback = self._motion.arrival, self._motion.feedback
        if arrival is not None or feedback is not None:
            report.values["predicted_displacement_um"] = self._motion.predicted_um
        if arrival is not None:
            due_s = arrival.due_s
            report.values["arrived"] = arrival.has_arrived
            report.values["arrives_in_s"] = "not known" if due_s is None else max(due_s - self._now_s(), 0.0)
        if feedback is not None:
            report.values["feedback"] = self._state(feedback)
            report.values["feedback_opened"] = feedback.n_opened
            report.values["feedback_refused_measurements"] = feedback.guard.n_refused
            report.values["measured_displacement_um"] = feedback.displacement_um
            report.values["feedback_added_um"] = feedback.correction_um
            report.values["feedback_added_rms_um"] = feedback.error.rms_um
            slope = feedback.error.slope
            report.values["feedback_added_slope_um_per_um"] = "not known" if math.isnan(slope) else slope
            if not feedback.is_closed:
                report.worsen(WARN, f"feedback {self._state(feedback)}")

    @staticmethod
    def _state(feedback: Feedback) -> str:
        return "closed" if feedback.is_closed else f"open: {feedback.guard.problem}"

    def _now_s(self) -> float:
        return 1e-9 * float(self._node.get_clock().now().nanoseconds)

    def _on_displacement(self, message: Any) -> None:
        feedback, now_s = self._motion.feedback, self._now_s()
        if feedback is None:
            return
        try:
            feedback.take(self._interface.time_s(message, now_s), self._interface.to_um(message))
        except FomrcError:
            feedback.take(now_s, math.nan)

"""A stage whose sensor is broken in a chosen way, as a process: voltage in, displacement out at 500 Hz.

What it moves is a model of its own; what it tells is noise, reversed, stuck from half way on, or has outliers. The
scale of the sensor is what it last heard on ``sensor_scale``. Asked for stamps it tells in a JointState what was a
little while ago: on a busy machine a voltage is heard some time after it was sent, and no actuator waits for that.
"""

from __future__ import annotations

import random
import signal
import sys
import time

import rclpy
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time
from sensor_msgs.msg import JointState
from small_model import MODEL
from std_msgs.msg import Float64, Header

from fomrc_core.model.piezo_model import PiezoModel
from fomrc_ros.node.inbox import Inbox
from fomrc_ros.node.runtime import make_executor

PERIOD_S = 0.002
LATE_S = 0.2


class SpoiltStage:
    """Steps the model and spoils what is told of it.

    Args:
        kind: sound, noise, reversed, stuck or outliers.
        is_stamped: whether displacement is a JointState with its stamp.
    """

    def __init__(self, kind: str, is_stamped: bool) -> None:
        self.node = rclpy.create_node("spoilt_stage")
        self._kind, self._random = kind, random.Random(1)
        self._model = PiezoModel.from_mapping(MODEL)
        self._state = self._model.initial_state()
        self._voltage_v, self._n_moving, self._stuck_um = 0.0, 0, 0.0
        self._last_s = time.time()
        self._scale = 1.0
        self._is_stamped = is_stamped
        message_type = JointState if is_stamped else Float64
        self._publisher = self.node.create_publisher(message_type, "displacement", qos_profile_sensor_data)
        self._coming: list[tuple[float, float]] = []  # when which voltages were sent, not yet applied
        self._voltages = Inbox(self.node).subscription(Float64, "voltage", QoSProfile(depth=1000))
        self.node.create_subscription(Float64, "sensor_scale", self._on_scale, 10)
        self.node.create_timer(PERIOD_S, self._tick)

    def _on_scale(self, message: Float64) -> None:
        self._scale = message.data

    def _tick(self) -> None:
        # A stage moves on while a busy machine lets no timer run, each voltage held until the next was sent.
        told_s = time.time() - (LATE_S if self._is_stamped else 0.0)
        self._coming += [(sent_s, message.data) for message, sent_s in self._voltages()]
        while self._coming and (self._coming[0][0] <= told_s or not self._is_stamped):
            sent_s, voltage_v = self._coming.pop(0)
            self._advance(min(sent_s, told_s))
            self._n_moving += voltage_v != self._voltage_v
            self._voltage_v = voltage_v
        moved_um = self._advance(told_s) + self._random.gauss(0.0, 1e-3)
        if self._kind == "noise":
            moved_um = self._random.gauss(0.0, 1.0)
        elif self._kind == "reversed":
            moved_um = -moved_um
        elif self._kind == "stuck" and self._n_moving > 900:
            moved_um = self._stuck_um + self._random.gauss(0.0, 1e-3)
        elif self._kind == "outliers" and self._random.random() < 0.01:
            moved_um += self._random.choice((-1.0, 1.0))
        else:
            self._stuck_um = moved_um
        moved_m = 1e-6 * self._scale * moved_um
        if self._is_stamped:
            stamp = Time(nanoseconds=round(1e9 * told_s)).to_msg()
            self._publisher.publish(JointState(header=Header(stamp=stamp), name=["piezo"], position=[moved_m]))
        else:
            self._publisher.publish(Float64(data=moved_m))

    def _advance(self, until_s: float) -> float:
        step_s = max(until_s - self._last_s, 1e-6)
        self._last_s += step_s
        return self._model.advance(self._state, self._voltage_v, step_s)


def main() -> None:
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    stage = SpoiltStage(sys.argv[1], "--stamped" in sys.argv)
    executor = make_executor()
    executor.add_node(stage.node)
    executor.spin_until_future_complete(rclpy.task.Future(), timeout_sec=1e9)


if __name__ == "__main__":
    main()

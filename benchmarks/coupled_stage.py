"""A stage of three axes on one body as a process: voltages in, displacements out, each axis moving the others by 5 %.

    python -m benchmarks.coupled_stage

Its axes are the actuators of ``config/tunable_filter.yaml``; the sensors have 1 nm of noise.
"""

from __future__ import annotations

import copy
import sys
from pathlib import Path

import numpy as np
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Float64

from fomrc_core.model.axes import AxesModel
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.storage import read_model
from fomrc_ros.node.quality_of_service import COMMAND, MEASUREMENT
from fomrc_ros.node.runtime import run

REPOSITORY = Path(__file__).resolve().parents[1]
AXES = ("axis1", "axis2", "axis3")
CREEP_ORDERS = (0.015, 0.016, 0.014)
COUPLING = 0.05
_PERIOD_S = 0.005
_NOISE_M = 1e-9
_DEPTH = 1000  # voltages that wait where the process is late: each counts, for where a drive turns is remembered


def stage_model() -> AxesModel:
    """Return the stage: three actuators of one kind, of which each moves the two others as well."""
    one = read_model(REPOSITORY / "config" / "pi_p753_table1.yaml")
    axes = tuple(PiezoModel(one.kappa_um_per_v, one.saturation_v, order) for order in CREEP_ORDERS)
    return AxesModel(axes, coupling=np.full((3, 3), COUPLING) + (1.0 - COUPLING) * np.eye(3))


class CoupledStage(Node):
    """Subscribes ``voltage`` (V) and publishes ``displacement`` (m) of three axes at 200 Hz."""

    def __init__(self) -> None:
        super().__init__("coupled_stage")
        self.stopped = Future()
        self._model = stage_model()
        self._state = self._model.initial_state()
        self._voltage_v, self._random = np.zeros(3), np.random.default_rng(0)
        self._model.advance(self._model.initial_state(), self._voltage_v, _PERIOD_S)  # compiled before the loop
        self._last_ns = self.get_clock().now().nanoseconds
        every = copy.copy(COMMAND)
        every.depth = _DEPTH
        for k, axis in enumerate(AXES):
            self.create_subscription(Float64, f"{axis}/voltage", self._listener(k), every)
        self._displacements = [self.create_publisher(Float64, f"{axis}/displacement", MEASUREMENT) for axis in AXES]
        self.create_timer(_PERIOD_S, self._tick)

    def request_stop(self) -> None:
        """Stop at once."""
        if not self.stopped.done():
            self.stopped.set_result(None)

    def _listener(self, k: int):
        def on_voltage(message: Float64) -> None:
            self._advance()
            self._voltage_v[k] = message.data

        return on_voltage

    def _advance(self) -> np.ndarray:
        """Hold the voltages until now; return the displacements [um]."""
        now_ns = self.get_clock().now().nanoseconds
        step_s = max(1e-9 * (now_ns - self._last_ns), 1e-6)
        self._last_ns = now_ns
        return self._model.advance(self._state, self._voltage_v, step_s)

    def _tick(self) -> None:
        for publisher, moved in zip(self._displacements, self._advance(), strict=True):
            publisher.publish(Float64(data=float(1e-6 * moved + _NOISE_M * self._random.standard_normal())))


if __name__ == "__main__":
    sys.exit(run(CoupledStage, None))

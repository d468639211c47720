"""Example of several axes: a tunable filter whose three actuators set a gap, as a pair of nodes.

``gap_command`` turns a desired piston, tip and tilt into the desired positions of three compensators;
``gap_monitor`` turns three displacements back into the piston, tip and tilt there are.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from fomrc_core.errors import FomrcError, ParameterError
from fomrc_core.model.axes import AxesCompensator
from fomrc_core.storage.axes_files import read_axes_model
from fomrc_ros.conversions import Float64Position, m_to_um, um_to_m
from fomrc_ros.gap.axis_watch import AxisWatch
from fomrc_ros.gap.geometry import MOTIONS, GapGeometry, motions_of
from fomrc_ros.node.diagnostics import WARN, DiagnosticsPublisher, Report
from fomrc_ros.node.parameters import NodeParameters, ParameterSpec
from fomrc_ros.node.quality_of_service import COMMAND, MEASUREMENT, overridable
from fomrc_ros.node.runtime import run
from fomrc_ros.node.sender import Sender
from fomrc_ros.parameters.gap import AXES_MODEL_SPEC, AXES_SPEC, GEOMETRY_SPEC, RATE_SPEC, STALE_SPEC
from fomrc_ros.parameters.names import WITHOUT_EFFECTS

Array = NDArray[np.float64]


def _geometry(values: Mapping[str, Any]) -> GapGeometry:
    if len(set(values["axes"])) != 3:
        raise ParameterError("not three axes", where="axes", value=values["axes"], allowed="three namespaces")
    return GapGeometry.from_list(values["geometry"])


def _inverse_of(path: str) -> AxesCompensator | None:
    """Return the inverse of the model in a file; None where no file is named."""
    if not path:
        return None
    model = read_axes_model(path)
    if (model.n_inputs, model.n_outputs) != (3, 3):
        raise ParameterError(
            "not a model of three axes", where="axes_model", value=(model.n_inputs, model.n_outputs), allowed="(3, 3)"
        )
    return AxesCompensator(model)


class _GapNode(Node):
    def __init__(self, name: str, specs: tuple[ParameterSpec, ...]) -> None:
        super().__init__(name, allow_undeclared_parameters=True)
        self.stopped = Future()
        self.parameters = NodeParameters(self, specs, _geometry, lambda geometry: None, WITHOUT_EFFECTS)
        self.parameters.watch()
        self.axes: list[str] = list(self.parameters.values["axes"])
        self.n_refused, self.last_refusal = 0, ""
        self._n_refused_before = 0
        self._watch = AxisWatch(self, self.axes)
        self.senders: list[Sender] = []
        self._diagnostics = DiagnosticsPublisher(self, "gap", self._describe, self.senders)

    def request_stop(self) -> None:
        """Stop at once."""
        if not self.stopped.done():
            self.stopped.set_result(None)

    def refuse(self, error: FomrcError) -> None:
        """Count a message that could not be used."""
        self.n_refused += 1
        self.last_refusal = str(error)
        self.get_logger().warning(f"refused: {error}", throttle_duration_sec=5.0)

    def _describe(self) -> Report:
        report = Report(values={"refused_messages": self.n_refused, "last_refusal": self.last_refusal})
        for problem in (*self.problems(), *self._watch.problems()):
            report.worsen(WARN, problem)
        if self.n_refused > self._n_refused_before:
            report.worsen(WARN, f"{self.n_refused - self._n_refused_before} messages refused: {self.last_refusal}")
        self._n_refused_before = self.n_refused
        return report

    def problems(self) -> list[str]:
        """Return what is wrong beside what the axes say, one line each."""
        return []


class GapCommand(_GapNode):
    """Subscribes ``desired_gap`` (JointState: piston, tip, tilt), publishes ``desired_position`` per axis.

    Where a model of the axes together is given, each position is what its axis must do by itself so that all of them
    are where they are wanted; hysteresis and creep stay with the axes' compensators.
    """

    def __init__(self) -> None:
        super().__init__("gap_command", (GEOMETRY_SPEC, AXES_SPEC, AXES_MODEL_SPEC))
        self._inverse = _inverse_of(self.parameters.values["axes_model"])
        self.senders += [Sender(self, Float64, f"{axis}/desired_position", COMMAND) for axis in self.axes]
        self.create_subscription(JointState, "desired_gap", self._on_gap, COMMAND, qos_overriding_options=overridable())

    def _on_gap(self, message: JointState) -> None:
        try:
            motions = motions_of(message)
        except FomrcError as error:
            self.refuse(error)
            return
        positions_m = self.parameters.settings.displacements_m(motions)
        if self._inverse is not None:
            wanted_um = np.array([[m_to_um(position) for position in positions_m]])
            positions_m = np.array([um_to_m(own) for own in self._inverse.decoupled_um(wanted_um)[0]])
        for sender, position in zip(self.senders, positions_m, strict=True):
            sender.send(Float64(data=float(position)))


class GapMonitor(_GapNode):
    """Subscribes ``displacement`` per axis, publishes ``gap`` (JointState: piston, tip, tilt)."""

    def __init__(self) -> None:
        super().__init__("gap_monitor", (GEOMETRY_SPEC, AXES_SPEC, RATE_SPEC, STALE_SPEC))
        self._displacements_m = np.full(3, np.nan)
        self._heard_at_s = np.full(3, -np.inf)
        for k, axis in enumerate(self.axes):
            self.create_subscription(
                Float64,
                f"{axis}/displacement",
                self._listener(k),
                MEASUREMENT,
                qos_overriding_options=overridable(),
            )
        self.senders.append(Sender(self, JointState, "gap", MEASUREMENT))
        self.create_timer(1.0 / self.parameters.values["rate_hz"], self._tick)

    def _listener(self, k: int) -> Callable[[Float64], None]:
        interface = Float64Position()

        def on_displacement(message: Float64) -> None:
            try:
                self._displacements_m[k] = um_to_m(interface.to_um(message))
                self._heard_at_s[k] = time.monotonic()
            except FomrcError as error:
                self.refuse(error)

        return on_displacement

    def _ages_s(self) -> Array:
        return np.asarray(time.monotonic() - self._heard_at_s)

    def problems(self) -> list[str]:
        """Return which axes give no displacement, one line each."""
        stale_after_s = self.parameters.values["stale_after_s"]
        return [
            f"{axis}: stale, no displacement" + (f" for {age_s:.1f} s" if np.isfinite(age_s) else " yet")
            for axis, age_s in zip(self.axes, self._ages_s(), strict=True)
            if age_s > stale_after_s
        ]

    def _tick(self) -> None:
        # A gap needs all three; what an axis was long ago is no measurement of now.
        if np.any(self._ages_s() > self.parameters.values["stale_after_s"]):
            return
        motions = self.parameters.settings.motions(self._displacements_m)
        message = JointState(name=list(MOTIONS), position=motions.tolist())
        message.header.stamp = self.get_clock().now().to_msg()
        self.senders[0].send(message)


def command_main(arguments: list[str] | None = None) -> int:
    """Run the command node; the entry point of ``ros2 run fomrc_ros gap_command``."""
    return run(GapCommand, arguments)


def monitor_main(arguments: list[str] | None = None) -> int:
    """Run the monitor node; the entry point of ``ros2 run fomrc_ros gap_monitor``."""
    return run(GapMonitor, arguments)

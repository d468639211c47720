"""Nodes as real processes, a probe that talks to them over DDS, and what they must be compared with."""

from __future__ import annotations

import ctypes
import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel

REPOSITORY = Path(__file__).resolve().parents[2]
MODULES = {
    "compensator": "fomrc_ros.compensator.node",
    "simulated_pea": "fomrc_ros.simulated_stage.node",
    "identification": "fomrc_ros.identification.node",
    "gap_command": "fomrc_ros.gap.nodes",
    "gap_monitor": "fomrc_ros.gap.nodes",
}
MODEL = {
    "kappa_um_per_v": [20.0, 12.0, 9.0, 1.4],
    "saturation_v": [0.02, 0.07, 0.2],
    "creep_order": 0.015,
}
_LIBC = ctypes.CDLL(None)
_READ_BEST_EFFORT = QoSProfile(depth=20000, reliability=ReliabilityPolicy.BEST_EFFORT)
_READ = QoSProfile(depth=20000)


def model_file(path: Path, model: dict | None = None, **parameters: object) -> Path:
    """Write a parameter file with a model and further parameters."""
    content = {"/**": {"ros__parameters": {"model": MODEL if model is None else model, **parameters}}}
    path.write_text(yaml.safe_dump(content))
    return path


def compensator_of(model: dict | None = None) -> Compensator:
    return Compensator(PiezoModel.from_mapping(MODEL if model is None else model))


def _die_with_the_test() -> None:
    # PR_SET_PDEATHSIG: a test run that crashes must not leave nodes behind that publish into the next one.
    _LIBC.prctl(1, signal.SIGKILL)


class NodeUnderTest:
    """One node in a process of its own."""

    def __init__(self, kind: str, folder: Path, *files: Path, namespace: str = "", **parameters: object) -> None:
        self.kind, self.namespace = kind, namespace
        self.name = f"{namespace}/{kind}"
        self._output = folder / f"{kind}{time.monotonic_ns()}.log"
        command = [
            sys.executable,
            "-m",
            MODULES[kind],
            *(["--monitor"] if kind == "gap_monitor" else []),
            "--ros-args",
        ]
        for file in files:
            command += ["--params-file", str(file)]
        if namespace:
            command += ["-r", f"__ns:={namespace}"]
        for name, value in parameters.items():
            shown = str(value).lower() if isinstance(value, bool) else f'"{value}"' if value == "" else str(value)
            command += ["-p", f"{name}:={shown}"]
        environment = dict(os.environ, PYTHONPATH=str(REPOSITORY))
        with self._output.open("wb") as output:
            self.process = subprocess.Popen(
                command,
                cwd=folder,
                env=environment,
                stdout=output,
                stderr=output,
                start_new_session=True,
                preexec_fn=_die_with_the_test,
            )

    def output(self) -> str:
        return self._output.read_text(errors="replace")

    def stop(self, number: int = signal.SIGINT, timeout_s: float = 15.0) -> int:
        """Send a signal and wait; return the exit status."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise AssertionError(f"{self.name} did not stop on signal {number}:\n{self.output()}") from None

    def wait_for_exit(self, timeout_s: float = 30.0) -> int:
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"{self.name} did not exit:\n{self.output()}") from None


class Probe:
    """A ROS node in the test's own process."""

    def __init__(self) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node(f"probe{time.monotonic_ns() % 10**9}", context=self.context)
        # Not the events executor of the nodes: it ends the process where endpoints come and go while it spins
        # (rclpy issue 1644), as those of a probe do and those of a node do not.
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.diagnostics: dict[str, dict[str, str]] = {}
        self.levels: dict[str, bytes] = {}
        self.messages: dict[str, str] = {}
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 100)
        self._clients: dict[tuple, object] = {}
        self._publishers: dict[tuple, object] = {}

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.diagnostics["/" + status.name] = {pair.key: pair.value for pair in status.values}
            self.levels["/" + status.name] = status.level
            self.messages["/" + status.name] = status.message

    def until(self, condition: Callable[[], object], what: str, timeout_s: float = 20.0) -> None:
        """Spin until the condition holds."""
        deadline = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline, f"not within {timeout_s:g} s: {what}"
            self.executor.spin_until_future_complete(Future(), timeout_sec=0.01)

    def spin_for(self, duration_s: float) -> None:
        """Let what must not happen have the time to happen."""
        end = time.monotonic() + duration_s
        self.until(lambda: time.monotonic() >= end, "time", duration_s + 5.0)

    def record(self, topic: str, kind: type = Float64) -> list:
        """Return a list that fills with (time of receipt, message)."""
        seen: list = []
        qos = _READ_BEST_EFFORT if topic.endswith(("displacement", "gap")) else _READ
        self.node.create_subscription(kind, topic, lambda m: seen.append((time.perf_counter(), m)), qos)
        return seen

    def publisher(self, topic: str, kind: type = Float64, timeout_s: float = 20.0):
        key = (topic, kind)
        if key not in self._publishers:
            self._publishers[key] = self.node.create_publisher(kind, topic, 10)
        publisher = self._publishers[key]
        self.until(publisher.get_subscription_count, f"someone subscribes {topic}", timeout_s)
        return publisher

    def call(self, kind: type, service: str, request: object, timeout_s: float = 30.0):
        key = (kind, service)
        if key not in self._clients:
            self._clients[key] = self.node.create_client(kind, service)
        client = self._clients[key]
        self.until(client.service_is_ready, f"service {service}", timeout_s)
        future = client.call_async(request)
        self.until(future.done, f"answer of {service}", timeout_s)
        return future.result()

    def trigger(self, service: str, timeout_s: float = 60.0):
        return self.call(Trigger, service, Trigger.Request(), timeout_s)

    def set_one(self, node: str, name: str, value: object):
        """Set one parameter as ``ros2 param set`` does."""
        request = SetParameters.Request(parameters=[_message(name, value)])
        return self.call(SetParameters, f"{node}/set_parameters", request).results[0]

    def set_all(self, node: str, **values: object):
        parameters = [_message(name.replace("__", "."), value) for name, value in values.items()]
        request = SetParametersAtomically.Request(parameters=parameters)
        return self.call(SetParametersAtomically, f"{node}/set_parameters_atomically", request).result

    def get(self, node: str, name: str):
        answer = self.call(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=[name]))
        return rclpy.parameter.parameter_value_to_python(answer.values[0])

    def state(self, node: str) -> str:
        return self.call(GetState, f"{node}/get_state", GetState.Request()).current_state.label

    def transition(self, node: str, label: str) -> bool:
        request = ChangeState.Request()
        request.transition.label = label
        return self.call(ChangeState, f"{node}/change_state", request).success

    def drive(
        self,
        publisher,
        signal_m: Callable[[float], float],
        duration_s: float,
        rate_hz: float = 200.0,
        name: str = "piezo",
    ) -> list[tuple[float, float]]:
        """Publish a signal of time for a while; return when what was sent."""
        sent: list[tuple[float, float]] = []
        began = time.perf_counter()
        while (now := time.perf_counter() - began) < duration_s:
            value = signal_m(now)
            if publisher.msg_type is JointState:
                message = JointState(name=[name], position=[value])
                message.header.stamp = self.node.get_clock().now().to_msg()
            else:
                message = Float64(data=value)
            publisher.publish(message)
            sent.append((time.perf_counter(), value))
            self.executor.spin_until_future_complete(Future(), timeout_sec=1.0 / rate_hz)
        return sent


def _message(name: str, value: object):
    if isinstance(value, Parameter):
        return value.to_parameter_msg()
    return Parameter(name, value=value).to_parameter_msg()


def journal_records(checkpoint: Path) -> np.ndarray:
    """Return the ticks the compensator noted: wall time, step [s], followed [um], voltage [V], second axis."""
    rows = []
    for journal in sorted(checkpoint.parent.glob(checkpoint.name + ".journal.*"), key=lambda p: int(p.suffix[1:])):
        content = journal.read_bytes()
        rows += [struct.unpack_from("<ddddd", content, at) for at in range(0, len(content) - 43, 44)]
    return np.array(rows)[:, [0, 1, 2, 4, 3]]


def clean(output: str) -> list[str]:
    """Return the lines of a node's output that are not log lines of its own."""
    return [line for line in output.splitlines() if line.strip() and "[INFO]" not in line]

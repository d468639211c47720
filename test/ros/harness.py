"""Nodes as real processes, a probe that talks to them over DDS, and what they must be compared with."""

from __future__ import annotations

import contextlib
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
import yaml
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.srv import ChangeState, GetState
from node_under_test import PATIENCE_S, NodeUnderTest, n_dropped_answers, what_became_of_them
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.client import Client
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from rclpy.task import Future
from sensor_msgs.msg import JointState
from small_model import MODEL
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

_READ_BEST_EFFORT = QoSProfile(depth=20000, reliability=ReliabilityPolicy.BEST_EFFORT)
_READ = QoSProfile(depth=20000)
# A node on a busy machine that does not know yet where an answer goes drops it, and says so; then it is asked again.
_LOOK_FOR_DROPPED_S = 5.0
# Asked more seldom the longer nothing comes of it: a test that waits for seconds leaves the processors to the nodes.
_FIRST_PERIOD_S, _LONGEST_PERIOD_S = 0.001, 0.008


def model_file(path: Path, model: dict | None = None, **parameters: object) -> Path:
    """Write a parameter file with a model and further parameters."""
    content = {"/**": {"ros__parameters": {"model": MODEL if model is None else model, **parameters}}}
    path.write_text(yaml.safe_dump(content))
    return path


_LEADS_TO = {"configure": "inactive", "activate": "active", "deactivate": "inactive", "cleanup": "unconfigured"}
"""Where a transition of the life cycle ends."""


class Probe:
    """A ROS node in the test's own process, without an executor.

    It takes messages and answers from the middleware's queues itself, in the one thread that also makes and
    destroys its endpoints. An executor would build a wait set over all of them for each message, which takes ten
    times as long as taking the message and on a busy machine leaves a probe seconds behind a stage of 1 kHz; and
    the events executor ends the process where endpoints come and go while it spins (rclpy issue 1644).
    """

    def __init__(self) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node(
            f"probe{time.monotonic_ns() % 10**9}",
            context=self.context,
            start_parameter_services=False,
            enable_rosout=False,
        )
        # What the middleware stamps with the time of day, told by the clock of the tests.
        self._epoch_s = time.time() - time.perf_counter()
        self.diagnostics: dict[str, dict[str, str]] = {}
        self.levels: dict[str, bytes] = {}
        self.messages: dict[str, str] = {}
        self._subscriptions: list[tuple[Subscription, Callable[[float, Any], None]]] = []
        self._clients: dict[tuple, Client] = {}
        self._publishers: dict[tuple, Publisher] = {}
        self.subscribe(DiagnosticArray, "/diagnostics", lambda _, message: self._on_diagnostics(message), 100)

    def close(self) -> None:
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.diagnostics["/" + status.name] = {pair.key: pair.value for pair in status.values}
            self.levels["/" + status.name] = status.level
            self.messages["/" + status.name] = status.message

    def epoch_offset_s(self) -> float:
        """Return what to add to a time of the tests for the time of day."""
        return self._epoch_s

    def epoch_s(self) -> float:
        """Return the time of day, as nodes know it."""
        return time.perf_counter() + self._epoch_s

    def now_s(self) -> float:
        """Return the time as messages carry the one of their sending.

        What is sent and what is answered come by ways of their own: a message sent before an answer may be taken
        after it. What holds from an answer on is asked of what was sent later than this.
        """
        return time.time() - self._epoch_s

    @staticmethod
    def sent_since(heard: list, time_s: float) -> list:
        """Return what was sent after this time, of a list that ``record`` fills."""
        return [entry for entry in heard if entry[0] > time_s]

    @staticmethod
    def stamp(time_s: float) -> Time:
        """Return a time of day as a stamp."""
        nanoseconds = round(time_s * 1e9)
        return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)

    def subscribe(self, kind: type, topic: str, callback: Callable[[float, Any], None], qos: QoSProfile | int) -> None:
        """Have a function called with every message and the time it was sent."""
        subscription = self.node.create_subscription(kind, topic, lambda message: None, qos)
        self._subscriptions.append((subscription, callback))

    def client(self, kind: type, service: str) -> Client:
        key = (kind, service)
        if key not in self._clients:
            self._clients[key] = self.node.create_client(kind, service)
        return self._clients[key]

    def take(self) -> None:
        """Take what has come: messages and answers."""
        for subscription, callback in self._subscriptions:
            with subscription.handle:
                while (taken := subscription.handle.take_message(subscription.msg_type, False)) is not None:
                    message, info = taken
                    callback(1e-9 * info["source_timestamp"] - self._epoch_s, message)
        for client in self._clients.values():
            with client.handle:
                while True:
                    header, answer = client.handle.take_response(client.srv_type.Response)
                    if header is None:
                        break
                    with contextlib.suppress(KeyError):  # nobody waits for it any more
                        client.get_pending_request(header.request_id.sequence_number).set_result(answer)

    def until(self, condition: Callable[[], object], what: str, timeout_s: float = PATIENCE_S) -> None:
        """Take what comes until the condition holds."""
        deadline, period_s = time.monotonic() + timeout_s, _FIRST_PERIOD_S
        self.take()
        while not condition():
            if time.monotonic() > deadline:
                raise AssertionError(f"not within {timeout_s:g} s: {what}\n{what_became_of_them()}")
            time.sleep(period_s)
            period_s = min(1.2 * period_s, _LONGEST_PERIOD_S)
            self.take()

    def spin_for(self, duration_s: float) -> None:
        """Let what must not happen have the time to happen."""
        end = time.monotonic() + duration_s
        self.until(lambda: time.monotonic() >= end, "time", duration_s + PATIENCE_S)

    def record(self, topic: str, kind: type = Float64) -> list:
        """Return a list that fills with (time of sending, message)."""
        seen: list = []
        qos = _READ_BEST_EFFORT if topic.endswith(("displacement", "gap")) else _READ
        self.subscribe(kind, topic, lambda sent_s, message: seen.append((sent_s, message)), qos)
        return seen

    def publisher(self, topic: str, kind: type = Float64, timeout_s: float = PATIENCE_S) -> Publisher:
        key = (topic, kind)
        if key not in self._publishers:
            self._publishers[key] = self.node.create_publisher(kind, topic, 10)
        publisher = self._publishers[key]
        self.until(publisher.get_subscription_count, f"someone subscribes {topic}", timeout_s)
        return publisher

    def ask(self, kind: type, service: str, request: object) -> Future:
        """Call a service once it is there; the future completes while the probe takes what comes."""
        client = self.client(kind, service)
        self.until(client.service_is_ready, f"service {service}")
        return client.call_async(request)

    def call(self, kind: type, service: str, request: object, timeout_s: float = PATIENCE_S):
        deadline = time.monotonic() + timeout_s
        n_dropped, future = n_dropped_answers(), self.ask(kind, service, request)
        while not self._is_done_within(future, min(_LOOK_FOR_DROPPED_S, timeout_s)):
            if time.monotonic() > deadline:
                raise AssertionError(f"not within {timeout_s:g} s: answer of {service}\n{what_became_of_them()}")
            if (n := n_dropped_answers()) > n_dropped:
                n_dropped, future = n, self.ask(kind, service, request)
        return future.result()

    def _is_done_within(self, future: Future, duration_s: float) -> bool:
        end = time.monotonic() + duration_s
        self.until(lambda: future.done() or time.monotonic() >= end, "time", duration_s + PATIENCE_S)
        return future.done()

    def trigger(self, service: str, timeout_s: float = PATIENCE_S):
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

    def until_active(self, node: NodeUnderTest) -> None:
        """Wait for a compensator that starts by itself: what is sent before is lost."""
        deadline = time.monotonic() + PATIENCE_S
        while (state := self.state(node.name)) != "active":
            if time.monotonic() > deadline:
                raise AssertionError(f"not active within {PATIENCE_S:g} s but {state}\n{what_became_of_them()}")
            self.spin_for(0.02)

    def transition(self, node: str, label: str) -> bool:
        request = ChangeState.Request()
        request.transition.label = label
        # Where the first answer was dropped the second is a refusal: the node is there already.
        succeeded = self.call(ChangeState, f"{node}/change_state", request).success
        return succeeded or (n_dropped_answers() > 0 and self.state(node) == _LEADS_TO.get(label))

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
        began = due = time.perf_counter()
        while (now := time.perf_counter() - began) < duration_s:
            value = signal_m(now)
            if publisher.msg_type is JointState:
                message = JointState(name=[name], position=[value])
                message.header.stamp = self.node.get_clock().now().to_msg()
            else:
                message = Float64(data=value)
            if _is_taken(publisher, message):
                sent.append((time.perf_counter(), value))
            due = max(due + 1.0 / rate_hz, time.perf_counter())
            while (left_s := due - time.perf_counter()) > 0.0:
                self.take()
                time.sleep(min(_LONGEST_PERIOD_S, left_s))
        self.take()
        return sent

    def drive_until(self, publisher, target_m: float, condition: Callable[[], object], what: str) -> None:
        """Publish a target until something comes of it: what is sent to a node that is not active yet is lost."""
        deadline = time.monotonic() + PATIENCE_S
        while not condition():
            if time.monotonic() > deadline:
                raise AssertionError(f"not within {PATIENCE_S:g} s: {what}\n{what_became_of_them()}")
            self.drive(publisher, lambda _: target_m, 0.05)


def _is_taken(publisher, message) -> bool:
    """Publish; return whether the middleware took it: a machine that is held up may try its patience."""
    try:
        publisher.publish(message)
    except rclpy_implementation.RCLError:
        return False
    return True


def _message(name: str, value: object):
    if isinstance(value, Parameter):
        return value.to_parameter_msg()
    return Parameter(name, value=value).to_parameter_msg()


def journal_records(checkpoint: Path) -> np.ndarray:
    """Return the moves the compensator noted: wall time, step [s], followed [um], voltage [V], second axis."""
    rows = []
    for journal in sorted(checkpoint.parent.glob(checkpoint.name + ".journal.*"), key=lambda p: int(p.suffix[1:])):
        content = journal.read_bytes()
        rows += [struct.unpack_from("<ddddd", content, at) for at in range(0, len(content) - 43, 44)]
    # one with a step of zero tells what a sensor has added
    return np.array([row for row in rows if row[1] > 0.0])[:, [0, 1, 2, 4, 3]]


def in_ticks(records: np.ndarray) -> np.ndarray:
    """Return the same with the moves of each tick as one: a late tick notes first what was held, at the same time."""
    ends = np.flatnonzero(np.diff(records[:, 0], append=np.inf))
    ticks = records[ends].copy()
    ticks[:, 1] = np.diff(np.cumsum(records[:, 1])[ends], prepend=0.0)
    return ticks


def clean(output: str) -> list[str]:
    """Return the lines of a node's output that are not log lines of its own."""
    return [line for line in output.splitlines() if line.strip() and "[INFO]" not in line]

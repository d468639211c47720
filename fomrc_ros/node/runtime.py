"""Start, spin and stop a node: one clear line where it cannot start, a clean end on SIGINT and SIGTERM."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any, Protocol

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import (
    InvalidParameterException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
)
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from fomrc_core.errors import FomrcError

# spin_until_future_complete returns at once for much longer ones.
_FOREVER_S = 1e9
# Between two looks at whether a signal has come; the client library holds the interpreter meanwhile.
_LOOK_PERIOD_S = 0.05
EXIT_BAD_INPUT = 2
_USAGE = "--ros-args [--params-file FILE] [-p NAME:=VALUE] [-r NAME:=OTHER] ..."
_START_ERRORS = (
    FomrcError,
    InvalidParameterException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
)


class StoppableNode(Protocol):
    """A node that can be asked to stop and then ends in its own time."""

    stopped: Future

    def request_stop(self) -> None:
        """Begin to stop; ``stopped`` completes when that is done."""


def steady_clock() -> Clock:
    """Return a clock that neither simulation nor time setting moves."""
    return Clock(clock_type=ClockType.STEADY_TIME)


def make_executor(context: Any = None) -> Any:
    """Return the executor measured best for a fast loop: events, or single-threaded where there is none."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        from rclpy.executors import SingleThreadedExecutor

        return SingleThreadedExecutor(context=context)
    return EventsExecutor(context=context)


def run(make_node: Callable[[], Any], arguments: list[str] | None = None) -> int:
    """Run a node until it has stopped; return the exit status.

    Args:
        make_node: makes the node; a ``StoppableNode``.
        arguments: command line, ``sys.argv`` where not given.
    """
    words = sys.argv[1:] if arguments is None else arguments
    if any(word in ("-h", "--help") for word in words):
        print(f"usage: {_USAGE}")
        return 0
    signalled: list[int] = []

    def on_signal(number: int, frame: FrameType | None) -> None:
        signalled.append(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    try:
        # Own handlers, because a stopping node may have to ramp a voltage down before the context goes.
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        # The client library leaves alone what is not its own: a misspelt --ros-args would lose every parameter.
        unknown = remove_ros_args(args=words)
    except Exception as error:
        print(f"fomrc_ros: cannot start: {_first_line(error)}", file=sys.stderr)
        return EXIT_BAD_INPUT
    if unknown:
        rclpy.try_shutdown()
        print(f"fomrc_ros: cannot start: unknown argument {unknown[0]!r}; allowed: {_USAGE}", file=sys.stderr)
        return EXIT_BAD_INPUT
    status = 0
    node: Any = None
    try:
        node = make_node()
        executor = make_executor()
        executor.add_node(node)

        def look() -> None:
            if signalled:
                node.request_stop()

        node.create_timer(_LOOK_PERIOD_S, look, clock=steady_clock())
        try:
            executor.spin_until_future_complete(node.stopped, timeout_sec=_FOREVER_S)
        finally:
            executor.shutdown()
    except (ExternalShutdownException, KeyboardInterrupt):
        pass
    except _START_ERRORS as error:
        print(f"fomrc_ros: cannot start: {_first_line(error)}", file=sys.stderr)
        status = EXIT_BAD_INPUT
    finally:
        if node is not None:
            close = getattr(node, "close", None)
            if close is not None:
                close()
            _destroy(node)
        rclpy.try_shutdown()
    return status


def _destroy(node: Node) -> None:
    # A second signal during the teardown must not tear it in two.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    node.destroy_node()


def _first_line(error: BaseException) -> str:
    text = " ".join(str(error).split())
    return text if len(text) <= 400 else text[:397] + "..."

"""Processes and probes that end with the test."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS is not installed")

with warnings.catch_warnings():
    # A parser the message packages import uses a module that Python has deprecated.
    warnings.simplefilter("ignore", DeprecationWarning)
    import rosidl_generator_py  # noqa: F401

from harness import Probe
from node_server import REPOSITORY, ForkedProcess
from node_under_test import STARTED, NodeUnderTest, server


@pytest.fixture
def probe() -> Iterator[Probe]:
    made = Probe()
    yield made
    made.close()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., NodeUnderTest]]:
    """Start nodes; whatever still runs at the end of the test is ended."""
    nodes: list[NodeUnderTest] = []
    STARTED.clear()

    def make(kind: str, *files: Path, **parameters: object) -> NodeUnderTest:
        nodes.append(NodeUnderTest(kind, tmp_path, *files, **parameters))
        return nodes[-1]

    yield make
    for node in nodes:
        if node.process.poll() is None:
            node.process.kill()
            node.process.wait()


@pytest.fixture
def spoilt(tmp_path: Path) -> Iterator:
    """Start stages whose sensor is spoilt."""
    stages: list[ForkedProcess] = []

    def start(kind: str, *options: str) -> ForkedProcess:
        script = Path(__file__).with_name("spoilt_stage.py")
        output = tmp_path / f"spoilt_stage{len(stages)}.log"
        paths = (script.parent, REPOSITORY / "test" / "core")
        stages.append(server().fork(str(script), [kind, *options], tmp_path, output, *paths))
        return stages[-1]

    yield start
    for stage in stages:
        stage.kill()
        stage.wait()

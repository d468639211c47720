"""Processes and probes that end with the test."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS is not installed")

with warnings.catch_warnings():
    # A parser the message packages import uses a module that Python has deprecated.
    warnings.simplefilter("ignore", DeprecationWarning)
    import rosidl_generator_py  # noqa: F401

from harness import REPOSITORY, NodeUnderTest, Probe, die_with_the_test


@pytest.fixture
def probe() -> Iterator[Probe]:
    made = Probe()
    yield made
    made.close()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., NodeUnderTest]]:
    """Start nodes; whatever still runs at the end of the test is ended."""
    nodes: list[NodeUnderTest] = []

    def make(kind: str, *files: Path, **parameters: object) -> NodeUnderTest:
        nodes.append(NodeUnderTest(kind, tmp_path, *files, **parameters))
        return nodes[-1]

    yield make
    for node in nodes:
        if node.process.poll() is None:
            node.process.kill()
            node.process.wait()


@pytest.fixture
def spoilt() -> Iterator:
    """Start stages whose sensor is spoilt."""
    stages: list[subprocess.Popen] = []

    def start(kind: str, *options: str) -> None:
        paths = (REPOSITORY, REPOSITORY / "test" / "ros", REPOSITORY / "test" / "core")
        environment = dict(os.environ, PYTHONPATH=os.pathsep.join(map(str, paths)))
        command = [sys.executable, str(Path(__file__).with_name("spoilt_stage.py")), kind, *options]
        stages.append(subprocess.Popen(command, env=environment, preexec_fn=die_with_the_test))

    yield start
    for stage in stages:
        stage.kill()
        stage.wait()

"""Nodes as processes of their own, started and ended from Python, where there is no launch system."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

_END_WAIT_S = 10.0


def private_environment(domain_id: int) -> dict[str, str]:
    """Return the environment for nodes that meet only each other, on this machine."""
    environment = dict(os.environ)
    environment["ROS_DOMAIN_ID"] = str(domain_id)
    environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    # The project's own package must be found where it is not installed.
    here = str(Path(__file__).resolve().parents[2])
    environment["PYTHONPATH"] = os.pathsep.join([here, *filter(None, [environment.get("PYTHONPATH")])])
    return environment


class NodeProcess:
    """One node in a process.

    Args:
        module: module to run, e.g. ``fomrc_ros.compensator``, and its options.
        namespace: namespace of the node.
        parameter_files: parameter files.
        parameters: single parameters, which override the files.
        environment: environment of the process.
        log: file its output goes to.
    """

    def __init__(
        self,
        module: str,
        namespace: str,
        parameter_files: Sequence[Path],
        parameters: Mapping[str, Any],
        environment: Mapping[str, str],
        log: Path,
    ) -> None:
        self.log = log
        command = [sys.executable, "-m", *module.split(), "--ros-args", "-r", f"__ns:={namespace}"]
        for file in parameter_files:
            command += ["--params-file", str(file)]
        for name, value in parameters.items():
            shown = str(value).lower() if isinstance(value, bool) else str(value)
            command += ["-p", f"{name}:={shown}"]
        with log.open("wb") as output:
            # Its own group, so that Ctrl-C reaches the demo alone, which then ends its nodes in order.
            self._process = subprocess.Popen(
                command, env=dict(environment), stdout=output, stderr=output, start_new_session=True
            )

    @property
    def is_running(self) -> bool:
        """Whether the process runs."""
        return self._process.poll() is None

    @property
    def pid(self) -> int:
        """Process number."""
        return self._process.pid

    def stop(self) -> int:
        """End the process; return its exit status."""
        if self.is_running:
            self._process.send_signal(signal.SIGINT)
        try:
            return self._process.wait(_END_WAIT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()

    def output(self) -> str:
        """Return what the process has printed."""
        return self.log.read_text(errors="replace")

    def __enter__(self) -> NodeProcess:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

"""A node of a test as a process of its own, and what became of those of a test that failed."""

from __future__ import annotations

import contextlib
import functools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

from node_server import REPOSITORY, ForkedProcess, NodeServer, die_with_the_parent

MODULES = {
    "compensator": "fomrc_ros.compensator",
    "simulated_pea": "fomrc_ros.simulated_stage",
    "identification": "fomrc_ros.identification",
    "gap_command": "fomrc_ros.gap",
    "gap_monitor": "fomrc_ros.gap",
    "watch": "fomrc_ros.watch",
}
_DROPPED = "failed to send response"
# Waiting ends when what is waited for has come; this much later it never will, on however busy a machine.
PATIENCE_S = 120.0


@functools.cache
def server() -> NodeServer:
    """Return what forks the nodes of this test run."""
    return NodeServer()


STARTED: list[NodeUnderTest] = []
"""The nodes of the test that runs."""


def n_dropped_answers() -> int:
    """Return how many answers the nodes of this test have dropped."""
    return sum(node.output().count(_DROPPED) for node in STARTED)


def what_became_of_them() -> str:
    """Return how the nodes of a failing test are or have ended, those that run aborted to say where they are."""
    said = []
    for node in STARTED:
        status = node.process.poll()
        if status is None:
            node.process.send_signal(signal.SIGABRT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                node.process.wait(5.0)
        told = "running, aborted" if status is None else f"ended with {status}"
        lines = [line for line in node.output().splitlines() if not line.startswith("Extension modules")]
        said.append("\n".join((f"{node.name} {told}:", *lines[-60:])))
    return "\n".join(said)


class NodeUnderTest:
    """One node in a process of its own, as ``python -m`` starts it; forked with its imports made unless it is fresh."""

    def __init__(
        self,
        kind: str,
        folder: Path,
        *files: Path,
        namespace: str = "",
        remaps: Mapping[str, str] | None = None,
        is_fresh: bool = False,
        **parameters: object,
    ) -> None:
        self.kind, self.namespace = kind, namespace
        self.name = f"{namespace}/{kind}"
        self._output = folder / f"{kind}{time.monotonic_ns()}.log"
        arguments = [*(["--monitor"] if kind == "gap_monitor" else []), "--ros-args"]
        for file in files:
            arguments += ["--params-file", str(file)]
        if namespace:
            arguments += ["-r", f"__ns:={namespace}"]
        for name, other in (remaps or {}).items():
            arguments += ["-r", f"{name}:={other}"]
        for name, value in parameters.items():
            shown = str(value).lower() if isinstance(value, bool) else f'"{value}"' if value == "" else str(value)
            arguments += ["-p", f"{name}:={shown}"]
        self.process: subprocess.Popen | ForkedProcess
        if is_fresh:
            self.process = self._started(["-m", MODULES[kind], *arguments], folder)
        else:
            self.process = server().fork(MODULES[kind], arguments, folder, self._output)
        STARTED.append(self)

    def _started(self, arguments: list[str], folder: Path) -> subprocess.Popen:
        with self._output.open("wb") as output:
            return subprocess.Popen(
                [sys.executable, *arguments],
                cwd=folder,
                env=dict(os.environ, PYTHONPATH=str(REPOSITORY)),
                stdout=output,
                stderr=output,
                start_new_session=True,
                preexec_fn=die_with_the_parent,
            )

    def output(self) -> str:
        return self._output.read_text(errors="replace")

    def stop(self, number: int = signal.SIGINT, timeout_s: float = PATIENCE_S) -> int:
        """Send a signal and wait; return the exit status."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise AssertionError(f"{self.name} did not stop on signal {number}:\n{self.output()}") from None

    def wait_for_exit(self, timeout_s: float = PATIENCE_S) -> int:
        try:
            return self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"{self.name} did not exit:\n{self.output()}") from None

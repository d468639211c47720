"""A process that has imported what a node needs of the core and forks one whenever it is asked.

What it forks is ``python -m module arguments`` in all but that the imports of the core are made and its compiled code
is loaded, two seconds of the processor each time: its arguments, folder, output, session and environment are its own,
and it ends as an interpreter ends.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import importlib
import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

REPOSITORY = Path(__file__).resolve().parents[2]
# What takes long, and not ROS itself: its library of tracing starts threads when it is loaded and cancels them when the
# process ends, which crashes where a fork has no such threads.
PRELOADED = (
    "fomrc_core.control.actuator_drive",
    "fomrc_core.control.model_gate",
    "fomrc_core.control.stage_stream",
    "fomrc_core.diagnosis.watch.model_watch",
    "fomrc_core.plants.electromechanical",
    "fomrc_core.storage.axes_files",
)
_A_MODEL = {"kappa_um_per_v": [2.0, 1.0], "saturation_v": [1.0], "creep_order": 0.01}
_MESSAGE_BYTES = 1 << 18
_LIBC = ctypes.CDLL(None)


def die_with_the_parent() -> None:
    # PR_SET_PDEATHSIG: a test run that crashes must not leave nodes behind that publish into the next one.
    _LIBC.prctl(1, signal.SIGKILL)


class NodeServer:
    """The server as seen by the tests: forks, and knows how those forked have ended."""

    def __init__(self) -> None:
        self._channel, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._ended: dict[int, int] = {}
        command = [sys.executable, __file__, str(theirs.fileno())]
        self._process = subprocess.Popen(
            command,
            env=dict(os.environ, PYTHONPATH=str(REPOSITORY)),
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
            preexec_fn=die_with_the_parent,
        )
        theirs.close()

    def fork(self, target: str, arguments: list[str], folder: Path, output: Path, *paths: Path) -> ForkedProcess:
        """Return a new process.

        Args:
            target: module to be run as ``python -m`` does, or a script's path.
            arguments: of the command line.
            folder: its working folder.
            output: file for what it prints and complains of.
            paths: where it finds modules besides those of the package.
        """
        request = {
            "target": target,
            "arguments": arguments,
            "folder": str(folder),
            "output": str(output),
            "paths": list(map(str, paths)),
            "environment": dict(os.environ, PYTHONPATH=os.pathsep.join(map(str, (REPOSITORY, *paths)))),
        }
        output.touch()  # read before the process has come to it
        self._channel.send(json.dumps(request).encode())
        while (pid := self._take(None)) is None:
            pass
        self._ended.pop(pid, None)  # of one that had the same number
        return ForkedProcess(self, pid)

    def status(self, pid: int, timeout_s: float | None) -> int | None:
        """Return how a process has ended, waiting for it; None where it has not."""
        deadline_s = None if timeout_s is None else time.monotonic() + timeout_s
        while pid not in self._ended:
            left_s = None if deadline_s is None else max(0.0, deadline_s - time.monotonic())
            if not select.select([self._channel], [], [], left_s)[0]:
                return None
            self._take(left_s)
        return self._ended[pid]

    def _take(self, timeout_s: float | None) -> int | None:
        # The number of a process that has begun, None where it is another message.
        self._channel.settimeout(timeout_s)
        content = self._channel.recv(_MESSAGE_BYTES)
        assert content, "the server of nodes has died"
        said = json.loads(content)
        if "status" in said:
            self._ended[said["pid"]] = said["status"]
            return None
        return int(said["pid"])


class ForkedProcess:
    """What the tests use of ``subprocess.Popen``."""

    def __init__(self, server: NodeServer, pid: int) -> None:
        self.pid = pid
        self.returncode: int | None = None
        self._server = server

    def poll(self) -> int | None:
        if self.returncode is None:
            self.returncode = self._server.status(self.pid, 0.0)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        if self.returncode is None:
            self.returncode = self._server.status(self.pid, timeout)
        if self.returncode is None:
            raise subprocess.TimeoutExpired(str(self.pid), timeout or 0.0)
        return self.returncode

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


def _serve(channel: socket.socket) -> dict[str, Any] | None:
    # What this process, newly forked, is to become; None in the server, once nobody asks any more.
    awake, wake = os.pipe()
    os.set_blocking(wake, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wake)
    while True:
        ready = select.select([channel, awake], [], [])[0]
        if awake in ready:
            os.read(awake, 4096)
            with contextlib.suppress(ChildProcessError):
                while (ended := os.waitpid(-1, os.WNOHANG))[0]:
                    said = {"pid": ended[0], "status": os.waitstatus_to_exitcode(ended[1])}
                    channel.send(json.dumps(said).encode())
        if channel in ready:
            content = channel.recv(_MESSAGE_BYTES)
            if not content:
                return None
            pid = os.fork()
            if pid == 0:
                signal.set_wakeup_fd(-1)
                signal.signal(signal.SIGCHLD, signal.SIG_DFL)
                os.close(awake)
                os.close(wake)
                channel.close()
                return dict(json.loads(content))
            channel.send(json.dumps({"pid": pid}).encode())


def _become(target: str, arguments: list[str], folder: str, output: str, paths: list[str], environment: dict) -> None:
    os.setsid()
    die_with_the_parent()
    os.chdir(folder)
    written = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o644)
    os.dup2(written, 1)
    os.dup2(written, 2)
    os.close(written)
    faulthandler.enable()  # where it crashes, or hangs and is aborted, its output says where it was
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = [target, *arguments]
    sys.path[:1] = [folder, *paths]
    if target.endswith(".py"):
        runpy.run_path(target, run_name="__main__")
    else:
        runpy.run_module(target, run_name="__main__", alter_sys=True)


def _load() -> None:
    for module in PRELOADED:
        importlib.import_module(module)
    from fomrc_core import Compensator, PiezoModel
    from fomrc_core.model.causes import cause_classes

    cause_classes()
    model = PiezoModel.from_mapping(_A_MODEL)
    model.advance(model.initial_state(), 0.0, 1e-3)
    inverse = Compensator(model)
    inverse.advance(inverse.initial_state(), 0.0, 1e-3)


def _main() -> None:
    channel = socket.socket(fileno=int(sys.argv[1]))
    _load()
    request = _serve(channel)
    if request is not None:
        _become(**request)


if __name__ == "__main__":
    _main()

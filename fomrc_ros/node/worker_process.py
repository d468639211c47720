"""Long work in a process of its own, so that no loop stops; it tells its progress, then result or reason."""

from __future__ import annotations

import contextlib
import multiprocessing
from typing import Any

from rclpy.node import Node
from rclpy.task import Future

from fomrc_core.errors import FomrcError
from fomrc_ros.node.runtime import steady_clock
from fomrc_ros.node.work import Outcome, Progress, Work, do

_END_WAIT_S = 2.0
_POLL_PERIOD_S = 0.05


class WorkerProcess:
    """One piece of work in a spawned process.

    Spawned, not forked: a fork would carry the middleware's threads and locks along.

    Args:
        work: a function at module level, called with ``request`` and a progress callback.
        request: what to do; must pickle.
    """

    def __init__(self, work: Work, request: Any) -> None:
        context = multiprocessing.get_context("spawn")
        self._receiver, sender = context.Pipe(duplex=False)
        self._process = context.Process(target=do, args=(sender, work, request), daemon=True)
        self._process.start()
        sender.close()
        self.progress = Progress(0.0, "starting")
        self.outcome: Outcome | None = None

    def poll(self) -> Outcome | None:
        """Take in what the process has said; return how it ended, None while it runs."""
        try:
            while self.outcome is None and self._receiver.poll():
                message = self._receiver.recv()
                if isinstance(message, Progress):
                    self.progress = message
                else:
                    self.outcome = message
        except (EOFError, OSError):
            self._process.join(_END_WAIT_S)
            self.outcome = Outcome(reason=f"the process ended early (exit code {self._process.exitcode})")
        if self.outcome is not None:
            self._end()
        return self.outcome

    def cancel(self, reason: str = "cancelled") -> None:
        """End the work now."""
        if self.outcome is None:
            self.outcome = Outcome(reason=reason)
        self._end()

    def _end(self) -> None:
        if self._process.is_alive():
            self._process.join(0.05)
        if self._process.is_alive():
            self._process.terminate()
            self._process.join(_END_WAIT_S)
            if self._process.is_alive():
                self._process.kill()
        with contextlib.suppress(OSError):
            self._receiver.close()


class WorkerRunner:
    """Runs work for a node, one piece at a time, while the node goes on.

    Args:
        node: the node whose executor waits for the work.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._worker: WorkerProcess | None = None
        self._finished: Future | None = None
        node.create_timer(_POLL_PERIOD_S, self._poll, clock=steady_clock())

    @property
    def progress(self) -> Progress | None:
        """How far the work is, None where there is none."""
        return None if self._worker is None else self._worker.progress

    async def run(self, work: Work, request: Any) -> Any:
        """Return what the work returns.

        Args:
            work: a function at module level, called with ``request`` and a progress callback.
            request: what to do; must pickle.

        Raises:
            FomrcError: other work runs, or the reason why this has no result.
        """
        if self._worker is not None:
            raise FomrcError("busy: other work runs")
        self._finished = Future(executor=self._node.executor)
        self._worker = WorkerProcess(work, request)
        outcome: Outcome = await self._finished
        self._worker, self._finished = None, None
        if outcome.reason:
            raise FomrcError(outcome.reason)
        return outcome.result

    def cancel(self, reason: str) -> None:
        """End the work now; whoever waits for it is told the reason."""
        if self._worker is None:
            return
        self._worker.cancel(reason)
        if self._finished is not None and not self._finished.done():
            self._finished.set_result(self._worker.outcome)

    def _poll(self) -> None:
        if self._worker is None or self._finished is None or self._finished.done():
            return
        outcome = self._worker.poll()
        if outcome is not None:
            self._finished.set_result(outcome)

"""Work that takes a while, asked for by services: answered when it is done, or at once with a number."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable, Mapping

from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger

from fomrc_core.errors import FomrcError
from fomrc_ros.node.quality_of_service import LATCHED
from fomrc_ros.node.runtime import steady_clock
from fomrc_ros.node.sender import Sender
from fomrc_ros.node.work import Progress

_LOOK_PERIOD_S = 0.2

Job = Callable[[], Awaitable[str]]


class Jobs:
    """One job at a time: services ``~/NAME`` and ``~/start_NAME`` for each, and the latched topic ``~/status``.

    The status is JSON: ``job`` (a number, 0 before the first), ``activity``, ``state`` (idle, running, succeeded,
    failed), ``percent`` and ``text``.

    Args:
        node: where they are offered.
        jobs: what each does, by name; returns what to answer, raises FomrcError where it fails.
        progress: how far the one that runs is; None where that is not known.

    Attributes:
        activity: name of the job that runs, "" where none does.
        last: name and answer of the last one.
        is_last_good: whether it succeeded.
    """

    def __init__(self, node: Node, jobs: Mapping[str, Job], progress: Callable[[], Progress | None]) -> None:
        self._node, self._progress = node, progress
        self.activity, self.last, self.is_last_good = "", "nothing yet", True
        self._number = 0
        self._said = ""
        self._sender = Sender(node, String, "~/status", LATCHED)
        for name, job in jobs.items():
            node.create_service(Trigger, f"~/{name}", self._serving(name, job))
            node.create_service(Trigger, f"~/start_{name}", self._starting(name, job))
        node.create_timer(_LOOK_PERIOD_S, self._look, clock=steady_clock())
        self._say("", "idle", 0.0, "nothing yet")

    def _serving(
        self, name: str, job: Job
    ) -> Callable[[Trigger.Request, Trigger.Response], Awaitable[Trigger.Response]]:
        async def serve(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            if self.activity:
                response.success, response.message = False, f"busy: {self.activity} runs"
                return response
            response.success, response.message = await self._run(name, job)
            return response

        return serve

    def _starting(self, name: str, job: Job) -> Callable[[Trigger.Request, Trigger.Response], Trigger.Response]:
        def start(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            if self.activity:
                response.success, response.message = False, f"busy: {self.activity} runs"
                return response
            # Taken before the task begins, so that no other one comes between.
            self.activity = name
            self._node.executor.create_task(self._run(name, job))
            response.success, response.message = True, f"job {self._number + 1}"
            return response

        return start

    async def _run(self, name: str, job: Job) -> tuple[bool, str]:
        self.activity = name
        self._number += 1
        self._say(name, "running", 0.0, "begins")
        try:
            is_good, message = True, await job()
            self._node.get_logger().info(f"{name}: {message}")
        except FomrcError as error:
            is_good, message = False, str(error)
        except Exception as error:  # raised into the executor it would take the node down
            is_good, message = False, f"{type(error).__name__}: {error}"
        self.activity = ""
        self.last, self.is_last_good = f"{name}: {message}", is_good
        if not is_good:
            self._node.get_logger().error(self.last)
        self._say(name, "succeeded" if is_good else "failed", 100.0 if is_good else 0.0, message)
        return is_good, message

    def _look(self) -> None:
        progress = self._progress() if self.activity else None
        if progress is not None:
            self._say(self.activity, "running", float(round(100.0 * progress.fraction)), progress.message)

    def _say(self, activity: str, state: str, percent: float, text: str) -> None:
        said = json.dumps(
            {"job": self._number, "activity": activity, "state": state, "percent": percent, "text": text[:500]}
        )
        if said != self._said:
            self._said = said
            self._sender.send(String(data=said))

"""The compensator's services: reload parameters, relax, assume relaxed."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from fomrc_core.control.actuator_drive import ActuatorDrive
from fomrc_core.errors import FomrcError, ParameterError
from fomrc_core.records import excitation
from fomrc_ros.node.jobs import Jobs
from fomrc_ros.node.model_parameters import as_replacement
from fomrc_ros.node.parameter_files import confined_path, given_at_start, read_in_a_process
from fomrc_ros.node.parameters import NodeParameters
from fomrc_ros.node.work import Progress
from fomrc_ros.node.worker_process import WorkerRunner
from fomrc_ros.parameters.compensator import CompensatorSettings


class ReloadService:
    """``~/reload_parameters``: reads ``parameters_file`` and takes it over, all or nothing.

    Args:
        node: where the service is offered.
        parameters: what is changed.
        work: reads the file in a process of its own; large YAML takes seconds, and the voltage must not wait.
    """

    def __init__(self, node: Node, parameters: NodeParameters, work: WorkerRunner) -> None:
        self._node, self._parameters, self._work = node, parameters, work
        node.create_service(Trigger, "~/reload_parameters", self._on_reload)

    async def _on_reload(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        values = self._parameters.values
        try:
            path = confined_path(
                values["parameters_file"], values["allowed_folders"], "parameters_file", also=given_at_start()
            )
            found = await self._work.run(read_in_a_process, (path, self._node.get_fully_qualified_name()))
            self._parameters.set_all(as_replacement(found))
            response.success, response.message = True, f"parameters of {path} are in force"
        except FomrcError as error:
            response.success, response.message = False, str(error)
        except Exception as error:
            response.success, response.message = False, f"{type(error).__name__}: {error}"
        if not response.success:
            self._node.get_logger().error(f"reload refused: {response.message}")
        return response


class RelaxServices:
    """``~/relax``, ``~/start_relax``, ``~/status`` and ``~/assume_relaxed``.

    Args:
        node: where the services are offered.
        drive: what is relaxed.
        settings: gives the settings in force.
    """

    def __init__(self, node: Node, drive: ActuatorDrive, settings: Callable[[], CompensatorSettings]) -> None:
        self._node, self._drive, self._settings = node, drive, settings
        self._relaxing: list[Future] = []
        self._began_s = 0.0
        self._jobs = Jobs(node, {"relax": self._relax}, self._progress)
        node.create_service(Trigger, "~/assume_relaxed", self._on_assume_relaxed)

    async def _relax(self) -> str:
        loop = self._drive.loop
        if loop is None or not self._drive.is_active or self._drive.is_stopping:
            raise FomrcError("not active: activate first")
        if self._drive.is_lent or self._drive.is_ramping:
            raise FomrcError(f"not now: {self._drive.activity}")
        if loop.is_in_routine:
            raise FomrcError("a routine runs already")
        loop.start_routine(iter(self._relaxation()))
        self._began_s = time.monotonic()
        finished = Future(executor=self._node.executor)
        self._relaxing.append(finished)
        reason: str = await finished
        if reason:
            raise FomrcError(reason)
        return "relaxed"

    def _progress(self) -> Progress | None:
        if not self._relaxing:
            return None
        passed = (time.monotonic() - self._began_s) / self._settings().relax_duration_s
        return Progress(min(passed, 0.99), "relaxing")

    def _relaxation(self) -> list[float]:
        settings = self._settings()
        amplitude_v, limits = settings.relax_amplitude_v, settings.loop.limits
        if not limits.minimum_v <= -amplitude_v <= amplitude_v <= limits.maximum_v:
            # Clamped to one side it would leave the actuator anything but relaxed.
            raise ParameterError(
                "does not fit between the voltage limits",
                where="relax_amplitude_v",
                value=amplitude_v,
                allowed=f"{limits.minimum_v:g} to {limits.maximum_v:g} V both ways",
            )
        routine = excitation.relaxation(
            amplitude_v,
            duration_s=settings.relax_duration_s,
            frequency_hz=settings.relax_frequency_hz,
            rate_hz=1.0 / settings.loop.period_s,
        )
        voltages_v: list[float] = routine.voltage_v.tolist()
        return voltages_v

    def _on_assume_relaxed(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._drive.set_relaxed()
        response.success, response.message = True, "the actuator counts as relaxed from now on"
        return response

    def after_tick(self) -> None:
        """Answer whoever waits for a relaxation that has ended."""
        if not self._relaxing or (self._drive.loop is not None and self._drive.loop.is_in_routine):
            return
        self._answer("" if self._drive.loop is not None and not self._drive.is_stopping else "ended early")

    def end(self, reason: str) -> None:
        """Tell whoever waits for a relaxation why it does not go on."""
        if self._relaxing:
            self._answer(reason)

    def _answer(self, reason: str) -> None:
        if not reason:
            self._drive.problem = ""
        waiting, self._relaxing = self._relaxing, []
        for finished in waiting:
            finished.set_result(reason)

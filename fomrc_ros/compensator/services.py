"""The compensator's services: reload parameters, relax, assume relaxed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rclpy.task import Future
from std_srvs.srv import Trigger

from fomrc_core.errors import FomrcError, ParameterError
from fomrc_core.records import excitation
from fomrc_ros.node.parameter_files import confined_path, read_parameter_file

if TYPE_CHECKING:
    from fomrc_ros.compensator.node import CompensatorNode


class CompensatorServices:
    """Offers the services of a compensator.

    Args:
        node: the compensator.
    """

    def __init__(self, node: CompensatorNode) -> None:
        self._node = node
        self._relaxing: list[Future] = []
        node.create_service(Trigger, "~/reload_parameters", self._on_reload)
        node.create_service(Trigger, "~/relax", self._on_relax)
        node.create_service(Trigger, "~/assume_relaxed", self._on_assume_relaxed)

    def _on_reload(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        values = self._node.parameters.values
        try:
            path = confined_path(values["parameters_file"], values["allowed_folders"], "parameters_file")
            self._node.parameters.set_all(read_parameter_file(path, self._node.get_fully_qualified_name()))
            response.success, response.message = True, f"parameters of {path} are in force"
        except FomrcError as error:
            response.success, response.message = False, str(error)
        except Exception as error:
            response.success, response.message = False, f"{type(error).__name__}: {error}"
        if not response.success:
            self._node.get_logger().error(f"reload refused: {response.message}")
        return response

    async def _on_relax(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        loop = self._node.loop
        if loop is None or not self._node.is_active or self._node.is_stopping:
            response.success, response.message = False, "not active: activate first"
            return response
        if loop.is_in_routine:
            response.success, response.message = False, "a routine runs already"
            return response
        try:
            loop.start_routine(iter(self._relaxation()))
        except FomrcError as error:
            response.success, response.message = False, str(error)
            return response
        finished = Future(executor=self._node.executor)
        self._relaxing.append(finished)
        reason = await finished
        response.success = not reason
        response.message = reason or "relaxed"
        return response

    def _relaxation(self) -> list[float]:
        settings = self._node.settings
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
            rate_hz=1.0 / self._node.period_s,
        )
        voltages_v: list[float] = routine.voltage_v.tolist()
        return voltages_v

    def _on_assume_relaxed(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._node.loop is None:
            response.success, response.message = False, "not configured"
        else:
            self._node.loop.set_relaxed()
            self._node.problem = ""
            response.success, response.message = True, "the actuator counts as relaxed from now on"
        return response

    def finish_relaxing(self, reason: str) -> None:
        """Answer whoever waits for the relaxation: done, or the reason why not."""
        if not self._relaxing:
            return
        if not reason:
            self._node.problem = ""
        waiting, self._relaxing = self._relaxing, []
        for finished in waiting:
            finished.set_result(reason)

    def end_routine(self, reason: str) -> None:
        """Give a routine up; who waits for it is told the reason."""
        if self._node.loop is not None:
            self._node.loop.cancel_routine()
        if self._relaxing:
            self.finish_relaxing(reason)

"""What the identification asks of the compensator it calibrates: its services, with limits to every wait."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.task import Future
from std_srvs.srv import Trigger

from fomrc_core.errors import FomrcError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_ros.node.model_parameters import MODEL_SPECS, effect_spec, model_from_values, values_from_model
from fomrc_ros.node.runtime import steady_clock

_LOOK_PERIOD_S = 0.05
_TRIGGERS = ("borrow_voltage", "return_voltage", "assume_relaxed")
# Services there are when the node has just started and when the compensator has: either may be the later.
DEFAULT_TIMEOUT_S = 30.0
# What changes nothing the second time is asked again: where the machine is busy the compensator may not know yet where
# an answer goes, and then drops it.
_N_ASKED = 3


class CompensatorClient:
    """Asks a compensator; nothing waits forever.

    Args:
        node: the node that asks.
        name: name of the compensator, relative to the node's namespace.

    Attributes:
        timeout_s: how long a service may take to appear, and then to answer [s].
    """

    def __init__(self, node: Node, name: str) -> None:
        self._node = node
        self.timeout_s = DEFAULT_TIMEOUT_S
        self._triggers = {service: node.create_client(Trigger, f"{name}/{service}") for service in _TRIGGERS}
        self._list = node.create_client(ListParameters, f"{name}/list_parameters")
        self._get = node.create_client(GetParameters, f"{name}/get_parameters")
        self._set = node.create_client(SetParametersAtomically, f"{name}/set_parameters_atomically")
        self._waiting: list[_Wait] = []
        self._n_looks = 0
        node.create_timer(_LOOK_PERIOD_S, self._look, clock=steady_clock())

    async def trigger(self, service: str) -> str:
        """Call one of its services; return what it answered.

        Raises:
            FomrcError: there is none, no answer, or it refused.
        """
        response = await self._ask(self._triggers[service], Trigger.Request())
        if not response.success:
            raise FomrcError(f"the compensator refused {service}: {response.message}")
        return str(response.message)

    async def parameters(self) -> dict[str, Any]:
        """Return all parameters of the compensator; raises FomrcError where it does not answer."""
        names = (await self._ask(self._list, ListParameters.Request(), _N_ASKED)).result.names
        answer = await self._ask(self._get, GetParameters.Request(names=names), _N_ASKED)
        return {name: parameter_value_to_python(value) for name, value in zip(names, answer.values, strict=False)}

    @staticmethod
    def model(values: Mapping[str, Any]) -> PiezoModel | None:
        """Return the model the compensator's parameters describe, None where there is none."""
        given = {
            name: list(value) if hasattr(value, "tolist") else value
            for name, value in values.items()
            if name.startswith("model.") and value is not None
        }
        return model_from_values(given)

    async def set_model(self, model: PiezoModel, fit_rms_um: float) -> None:
        """Put a model in force; raises FomrcError where the compensator refuses it."""
        values = values_from_model(model) | {"model.fit_rms_um": fit_rms_um}
        kinds = {spec.name: spec.kind for spec in MODEL_SPECS}
        request = SetParametersAtomically.Request()
        for name, value in values.items():
            spec = effect_spec(name)
            kind = kinds.get(name, spec.kind if spec else None)
            request.parameters.append(Parameter(name, kind, value).to_parameter_msg())
        response = await self._ask(self._set, request, _N_ASKED)
        if not response.result.successful:
            raise FomrcError(f"the compensator refused the model: {response.result.reason}")

    async def _ask(self, client: Any, request: Any, n_times: int = 1) -> Any:
        is_there = await self._wait(client.service_is_ready, self.timeout_s)
        if not is_there:
            raise FomrcError(f"no service {client.srv_name} within {self.timeout_s:g} s: does the compensator run?")
        for _ in range(n_times):
            answer = client.call_async(request)
            if await self._wait(answer.done, self.timeout_s / n_times):
                return answer.result()
            client.remove_pending_request(answer)
        raise FomrcError(f"no answer from {client.srv_name} within {self.timeout_s:g} s")

    def _wait(self, condition: Any, timeout_s: float) -> Future:
        finished = Future(executor=self._node.executor)
        self._waiting.append(_Wait(condition, finished, self._n_looks + int(timeout_s / _LOOK_PERIOD_S)))
        return finished

    def _look(self) -> None:
        self._n_looks += 1
        for wait in list(self._waiting):
            holds = bool(wait.condition())
            if holds or self._n_looks >= wait.due:
                self._waiting.remove(wait)
                wait.finished.set_result(holds)


class _Wait:
    def __init__(self, condition: Any, finished: Future, due: int) -> None:
        self.condition, self.finished, self.due = condition, finished, due

"""Live calibration: relax the stage, drive it, fit what it does, and put the model in force."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_srvs.srv import Trigger

from fomrc_core.errors import FomrcError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records import excitation
from fomrc_ros.conversions import position_interface
from fomrc_ros.identification import fit_work
from fomrc_ros.identification.fit_work import FitAnswer, FitRequest
from fomrc_ros.identification.stage_drive import StageDrive
from fomrc_ros.identification.worker_process import Progress
from fomrc_ros.node.model_parameters import MODEL_SPECS, effect_spec, values_from_model
from fomrc_ros.node.runtime import steady_clock

_ANSWER_TIMEOUT_S = 10.0
_WATCH_PERIOD_S = 0.1
_N_PARTS = 7
# Real time without a tick of the node's clock, after which a simulated clock counts as dead.
_STANDSTILL_S = 5.0


class Calibration:
    """One calibration at a time, cancellable at any moment; any failure leaves the old model active.

    Args:
        node: the identification node.
        work: does work in a process; a coroutine function.
        tell: called where something new is being done.
    """

    def __init__(self, node: Node, work: Callable[..., Any], tell: Callable[[], None]) -> None:
        self._node, self._work, self._tell = node, work, tell
        self._reason = ""
        self._settings: Any = None
        self._part = 0
        self._doing = ""
        self.is_running = False
        values = node.parameters.values
        self._drive = StageDrive(node, position_interface(values["interface"], values["joint_name"]), values["rate_hz"])
        name = values["compensator"]
        self._change_state = node.create_client(ChangeState, f"{name}/change_state")
        self._get_state = node.create_client(GetState, f"{name}/get_state")
        self._set_parameters = node.create_client(SetParametersAtomically, f"{name}/set_parameters_atomically")
        self._assume_relaxed = node.create_client(Trigger, f"{name}/assume_relaxed")
        self._waiting: list[tuple[Future, Future, int]] = []
        self._n_looks = self._moved_at = self._n_done_before = 0
        node.create_timer(_WATCH_PERIOD_S, self._watch, clock=steady_clock())

    @property
    def is_driving(self) -> bool:
        """Whether the stage is being driven."""
        return self.is_running

    @property
    def progress(self) -> Progress:
        """How far the calibration is."""
        within = self._drive.n_done / self._drive.n_total if self._drive.is_driving else 0.0
        return Progress(min((self._part + within) / _N_PARTS, 1.0), self._doing)

    def cancel(self, reason: str) -> None:
        """Give up: the stage is brought to safety and the old model goes on."""
        if self.is_running and not self._reason:
            self._reason = reason
            self._drive.stop(reason)

    async def run(self, settings: Any, output_path: str) -> FitAnswer:
        """Calibrate; return the fit that is in force now.

        Args:
            settings: the node's settings.
            output_path: model file to write.

        Raises:
            FomrcError: why there is no new model; the old one is active again.
        """
        self.is_running, self._reason, self._settings = True, "", settings
        self._part = 0
        was_active = has_driven = False
        try:
            self._drive.listen()
            self._say(0, "asking the compensator")
            was_active = await self._is_active()
            if was_active:
                await self._transition(Transition.TRANSITION_DEACTIVATE)
            has_driven = True
            recording = await self._measure()
            self._say(5, "fitting")
            self._go_on()
            answer = await self._work(
                fit_work.fit,
                FitRequest((recording,), settings.values["n_elements"], settings.values["method"], output_path),
            )
            self._go_on()
            self._say(6, "putting the model in force")
            await self._apply(answer)
            return answer
        except FomrcError as error:
            raise FomrcError(f"{error}; the old model goes on") from None
        finally:
            try:
                await self._bring_back(was_active, has_driven)
            finally:
                self.is_running = False

    async def _measure(self) -> Any:
        values, limits = self._settings.values, self._settings.limits
        rate_hz = values["rate_hz"]
        amplitude, middle = values["calibrate_amplitude_v"], self._middle_v()
        self._say(1, "relaxing")
        await self._drive_all([middle], is_ramp=True)
        await self._drive_all(self._relaxation())
        triangle = excitation.triangle(amplitude, slope_v_per_s=values["calibrate_slope_v_per_s"], rate_hz=rate_hz)
        staircase = excitation.staircase(
            amplitude, step_v=values["calibrate_step_v"], dwell_s=values["calibrate_dwell_s"], rate_hz=rate_hz
        )
        self._say(2, "driving triangle and staircase")
        plan = middle + np.concatenate((triangle.voltage_v, staircase.voltage_v))
        reason = await self._drive.drive(
            plan.tolist(), limits, records=True, displacement_timeout_s=values["displacement_timeout_s"]
        )
        if reason:
            raise FomrcError(reason)
        return self._drive.recording("calibration")

    def _middle_v(self) -> float:
        limits = self._settings.limits
        amplitude = self._settings.values["calibrate_amplitude_v"]
        # Around zero where the limits allow, else as near to it as they do.
        low, high = limits.minimum_v + amplitude, limits.maximum_v - amplitude
        if low > high:
            raise FomrcError(
                f"calibrate_amplitude_v {amplitude:g} V does not fit between the voltage limits "
                f"{limits.minimum_v:g} and {limits.maximum_v:g} V"
            )
        return min(max(0.0, low), high)

    def _relaxation(self) -> list[float]:
        values = self._settings.values
        routine = excitation.relaxation(
            values["calibrate_amplitude_v"],
            duration_s=values["relax_duration_s"],
            frequency_hz=values["relax_frequency_hz"],
            rate_hz=values["rate_hz"],
        )
        voltages: list[float] = (self._middle_v() + routine.voltage_v).tolist()
        return voltages

    async def _drive_all(self, voltages_v: list[float], *, is_ramp: bool = False) -> None:
        self._go_on()
        limits = self._settings.limits
        if is_ramp:
            reason = await self._drive.drive_to(voltages_v[0], limits)
        else:
            reason = await self._drive.drive(voltages_v, limits)
        if reason:
            raise FomrcError(reason)

    async def _bring_back(self, was_active: bool, has_driven: bool) -> None:
        # Whatever has happened: the voltage to safety, the actuator relaxed, the compensator as it was.
        if has_driven:
            limits = self._settings.limits
            is_leaving = self._node.stopped.done() or self._reason.startswith("the node is shutting down")
            if not is_leaving:
                self._doing = "relaxing"
                await self._drive.drive_to(self._middle_v(), limits)
                await self._drive.drive(self._relaxation(), limits)
            self._doing = "bringing the voltage to safety"
            await self._drive.drive_to(limits.safe_v, limits)
            await self._ask(self._assume_relaxed, Trigger.Request())
        if was_active:
            await self._transition(Transition.TRANSITION_ACTIVATE)

    async def _apply(self, answer: FitAnswer) -> None:
        values = values_from_model(PiezoModel.from_mapping(answer.model_mapping))
        values["model.fit_rms_um"] = answer.rms_um
        kinds = {spec.name: spec.kind for spec in MODEL_SPECS}
        request = SetParametersAtomically.Request()
        for name, value in values.items():
            spec = effect_spec(name)
            kind = kinds.get(name, spec.kind if spec else None)
            request.parameters.append(Parameter(name, kind, value).to_parameter_msg())
        response = await self._ask(self._set_parameters, request)
        if not response.result.successful:
            raise FomrcError(f"the compensator refused the model: {response.result.reason}")

    async def _is_active(self) -> bool:
        response = await self._ask(self._get_state, GetState.Request())
        return bool(response.current_state.id == State.PRIMARY_STATE_ACTIVE)

    async def _transition(self, transition: int) -> None:
        request = ChangeState.Request()
        request.transition.id = transition
        response = await self._ask(self._change_state, request)
        if not response.success:
            raise FomrcError("the compensator did not change its state")

    async def _ask(self, client: Any, request: Any) -> Any:
        if not client.service_is_ready():
            raise FomrcError(f"no service {client.srv_name}: does the compensator run?")
        answer = client.call_async(request)
        finished = Future(executor=self._node.executor)
        self._waiting.append((answer, finished, self._n_looks + int(_ANSWER_TIMEOUT_S / _WATCH_PERIOD_S)))
        response = await finished
        if response is None:
            client.remove_pending_request(answer)
            raise FomrcError(f"no answer from {client.srv_name} within {_ANSWER_TIMEOUT_S:g} s")
        return response

    def _watch(self) -> None:
        self._n_looks += 1
        for entry in list(self._waiting):
            answer, finished, due = entry
            if answer.done() or self._n_looks >= due:
                self._waiting.remove(entry)
                finished.set_result(answer.result() if answer.done() else None)
        if self._drive.is_driving:
            if self._drive.n_done != self._n_done_before:
                self._n_done_before, self._moved_at = self._drive.n_done, self._n_looks
            elif self._n_looks - self._moved_at > _STANDSTILL_S / _WATCH_PERIOD_S:
                self._drive.stop(f"the clock stood still for {_STANDSTILL_S:g} s")
        else:
            self._moved_at = self._n_looks

    def _go_on(self) -> None:
        if self._reason:
            raise FomrcError(self._reason)

    def _say(self, part: int, doing: str) -> None:
        self._part, self._doing = part, doing
        self._tell()

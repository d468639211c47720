"""Live calibration: borrow the voltage, relax the stage, drive it, fit what it does, and put the model in force."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from rclpy.node import Node

from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.errors import FomrcError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records import excitation
from fomrc_core.records.recording import Recording
from fomrc_ros.conversions import position_interface
from fomrc_ros.identification import fit_work
from fomrc_ros.identification.compensator_client import CompensatorClient
from fomrc_ros.identification.fit_work import CalibrationRequest, FitAnswer
from fomrc_ros.identification.stage_drive import StageDrive
from fomrc_ros.identification.stage_recorder import StageRecorder
from fomrc_ros.node.runtime import steady_clock
from fomrc_ros.node.voltage_interface import voltage_interface
from fomrc_ros.node.work import Progress
from fomrc_ros.node.worker_process import WorkerRunner
from fomrc_ros.parameters.identification import IdentificationSettings

_WATCH_PERIOD_S = 0.1
_N_PARTS = 7
_PUTTING_IN_FORCE = 6
# Real time without a tick of the node's clock, after which a simulated clock counts as dead.
_STANDSTILL_S = 5.0


@dataclass(frozen=True)
class _Plan:
    """One calibration: settings, limits that keep to the compensator's, middle and rate of its voltage."""

    values: Mapping[str, Any]
    limits: VoltageLimits
    middle_v: float
    period_s: float
    in_force: PiezoModel | None
    output_path: str


class Calibration:
    """One calibration at a time, cancellable at any moment; any failure leaves the old model active.

    Args:
        node: the identification node.
        values: its parameters.
        work: does work in a process.
        tell: called where something new is being done.

    Attributes:
        is_running: whether a calibration runs.
        sender: publishes the voltages the stage is driven with.
    """

    def __init__(self, node: Node, values: Mapping[str, Any], work: WorkerRunner, tell: Callable[[], None]) -> None:
        self._node, self._work, self._tell = node, work, tell
        self._reason = ""
        self._is_leaving = False
        self._part = 0
        self._doing = ""
        self.is_running = False
        interface = position_interface(values["interface"], values["joint_name"])
        voltage = voltage_interface(values["voltage_interface"], values["joint_name"])
        recorder = StageRecorder(node, interface, voltage)
        self._drive = StageDrive(node, recorder, values["rate_hz"], values["compensator"])
        self.sender = self._drive.sender
        self._compensator = CompensatorClient(node, values["compensator"])
        self._standstill_looks = self._n_done_before = 0
        node.create_timer(_WATCH_PERIOD_S, self._watch, clock=steady_clock())

    @property
    def progress(self) -> Progress:
        """How far the calibration is."""
        within = self._drive.n_done / max(self._drive.n_total, 1) if self._drive.is_driving else 0.0
        return Progress(min((self._part + within) / _N_PARTS, 1.0), self._doing)

    def close(self) -> None:
        """Listen to the stage no more."""
        self._drive.close()

    def cancel(self, reason: str, *, is_leaving: bool = False) -> bool:
        """Give up: the stage is brought to safety and the old model goes on; return whether it is not too late.

        Args:
            reason: what whoever waits for the calibration is told.
            is_leaving: whether the node is about to end, so that nothing is driven but the way to safety.
        """
        if not self.is_running:
            return False
        self._is_leaving = self._is_leaving or is_leaving
        is_in_time = self._part < _PUTTING_IN_FORCE
        if is_in_time and not self._reason:
            self._reason = reason
        if is_in_time or is_leaving:
            self._drive.stop(reason)
        return is_in_time

    async def run(self, settings: IdentificationSettings, output_path: str) -> FitAnswer:
        """Calibrate; return the fit that is in force now.

        Args:
            settings: the node's settings.
            output_path: model file to write.

        Raises:
            FomrcError: why there is no new model; the old one is active again.
        """
        self.is_running, self._reason, self._is_leaving = True, "", False
        try:
            self._say(0, "asking the compensator")
            self._compensator.timeout_s = settings.values["service_timeout_s"]
            plan = await self._planned(settings, output_path)
            await self._compensator.trigger("borrow_voltage")
            self._drive.begin()
            try:
                return await self._with_borrowed_voltage(plan)
            finally:
                await self._bring_back(plan)
        except FomrcError as error:
            raise FomrcError(f"{error}; the old model goes on") from None
        finally:
            self._drive.end()
            self.is_running = False

    async def _planned(self, settings: IdentificationSettings, output_path: str) -> _Plan:
        """Return what is to be done; everything that can be refused is, before anything is driven."""
        fit_work.check_output(output_path)
        told = await self._compensator.parameters()
        limits = settings.limits.narrowed(VoltageLimits.from_values(told))
        amplitude_v = settings.values["calibrate_amplitude_v"]
        # Around zero where the limits allow, else as near to it as they do.
        low, high = limits.minimum_v + amplitude_v, limits.maximum_v - amplitude_v
        if low > high:
            raise FomrcError(
                f"calibrate_amplitude_v {amplitude_v:g} V does not fit between the voltage limits "
                f"{limits.minimum_v:g} and {limits.maximum_v:g} V, the narrower of the compensator's and this node's"
            )
        in_force = self._compensator.model(told)
        period_s = 1.0 / told["rate_hz"]
        return _Plan(settings.values, limits, min(max(0.0, low), high), period_s, in_force, output_path)

    async def _with_borrowed_voltage(self, plan: _Plan) -> FitAnswer:
        recording = await self._measure(plan)
        self._say(5, "fitting")
        self._go_on()
        values = plan.values
        answer: FitAnswer = await self._work.run(
            fit_work.calibrate,
            CalibrationRequest(recording, values["n_elements"], values["method"], plan.output_path, plan.in_force),
        )
        self._go_on()
        self._say(_PUTTING_IN_FORCE, "putting the model in force")
        await self._compensator.set_model(PiezoModel.from_mapping(answer.model_mapping), answer.rms_um)
        return answer

    async def _measure(self, plan: _Plan) -> Recording:
        values, rate_hz = plan.values, plan.values["rate_hz"]
        amplitude_v = values["calibrate_amplitude_v"]
        self._say(1, "relaxing")
        await self._drive_all([plan.middle_v], plan, is_ramp=True)
        await self._drive_all(self._relaxation(plan), plan)
        triangle = excitation.triangle(amplitude_v, slope_v_per_s=values["calibrate_slope_v_per_s"], rate_hz=rate_hz)
        staircase = excitation.staircase(
            amplitude_v, step_v=values["calibrate_step_v"], dwell_s=values["calibrate_dwell_s"], rate_hz=rate_hz
        )
        self._say(2, "driving triangle and staircase")
        voltages_v = plan.middle_v + np.concatenate((triangle.voltage_v, staircase.voltage_v))
        await self._drive_all(voltages_v.tolist(), plan, records=True)
        return self._drive.recording("calibration", plan.period_s)

    @staticmethod
    def _relaxation(plan: _Plan) -> list[float]:
        routine = excitation.relaxation(
            plan.values["calibrate_amplitude_v"],
            duration_s=plan.values["relax_duration_s"],
            frequency_hz=plan.values["relax_frequency_hz"],
            rate_hz=plan.values["rate_hz"],
        )
        voltages_v: list[float] = (plan.middle_v + routine.voltage_v).tolist()
        return voltages_v

    async def _drive_all(
        self, voltages_v: list[float], plan: _Plan, *, is_ramp: bool = False, records: bool = False
    ) -> None:
        self._go_on()
        if is_ramp:
            reason = await self._drive.drive_to(voltages_v[0], plan.limits)
        else:
            timeout_s = plan.values["displacement_timeout_s"] if records else 0.0
            reason = await self._drive.drive(voltages_v, plan.limits, records=records, timeout_s=timeout_s)
        if reason:
            raise FomrcError(reason)

    async def _bring_back(self, plan: _Plan) -> None:
        # Whatever has happened: the actuator relaxed where there is time, the voltage to safety, and returned.
        # Each is tried whatever became of the one before.
        is_relaxed = False
        if not self._is_leaving:
            self._doing = "relaxing"
            reasons = [
                await self._drive.drive_to(plan.middle_v, plan.limits),
                await self._drive.drive(self._relaxation(plan), plan.limits),
            ]
            is_relaxed = not any(reasons)
        self._doing = "bringing the voltage to safety"
        await self._drive.drive_to(plan.limits.safe_v, plan.limits)
        try:
            # Relaxed about another voltage than zero it is not what the model calls relaxed.
            if is_relaxed and plan.middle_v == 0.0:
                await self._compensator.trigger("assume_relaxed")
        finally:
            self._drive.end()
            try:
                await self._compensator.trigger("return_voltage")
            except FomrcError as error:
                # Taken back already, where this node was held up for longer than the lease: the compensator says so.
                self._node.get_logger().warning(str(error))

    def _watch(self) -> None:
        if not self._drive.is_driving or self._drive.n_done != self._n_done_before:
            self._n_done_before, self._standstill_looks = self._drive.n_done, 0
            return
        self._standstill_looks += 1
        if self._standstill_looks > _STANDSTILL_S / _WATCH_PERIOD_S:
            self._drive.stop(f"the clock stood still for {_STANDSTILL_S:g} s")

    def _go_on(self) -> None:
        if self._reason:
            raise FomrcError(self._reason)

    def _say(self, part: int, doing: str) -> None:
        self._part, self._doing = part, doing
        self._tell()

"""The watch: the model in force beside the stage, on ``voltage`` and ``displacement``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from fomrc_core.control.heard_stage import best_lag_s
from fomrc_core.control.stage_stream import StageStream
from fomrc_core.diagnosis.watch.alarm import Alarm, Case
from fomrc_core.diagnosis.watch.model_watch import ModelWatch, WatchState
from fomrc_core.errors import FomrcError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.storage import make_directory
from fomrc_ros.conversions import position_interface
from fomrc_ros.identification.compensator_client import CompensatorClient
from fomrc_ros.identification.stage_recorder import StageRecorder
from fomrc_ros.node.diagnostics import WARN, DiagnosticsPublisher, Report
from fomrc_ros.node.parameter_files import confined_path
from fomrc_ros.node.parameters import NodeParameters
from fomrc_ros.node.quality_of_service import LATCHED
from fomrc_ros.node.runtime import run, steady_clock
from fomrc_ros.node.sender import Sender
from fomrc_ros.node.voltage_interface import voltage_interface
from fomrc_ros.node.worker_process import WorkerRunner
from fomrc_ros.parameters.names import WITH_EFFECTS
from fomrc_ros.parameters.watch import WatchNodeSettings, build_settings, watch_specs
from fomrc_ros.watch.change_log import ChangeLog
from fomrc_ros.watch.change_work import ChangeAnswer, ChangeRequest, look_into

_TAKE_PERIOD_S = 0.1
_MODEL_PERIOD_S = 5.0
# The lag between voltage and displacement is found from so much, once the voltage moves in it.
_LAG_S, _LEAST_MOTION_V = 5.0, 0.05
_LONGEST_WAIT_S = 30.0
_N_KEPT = 20


class WatchNode(Node):
    """Says on ``~/changes`` and /diagnostics when the stage is no longer the model, and what has changed."""

    def __init__(self) -> None:
        super().__init__("watch", allow_undeclared_parameters=True)
        self.stopped = Future()
        self.parameters = NodeParameters(self, watch_specs(), build_settings, self._apply, WITH_EFFECTS)
        values = self.parameters.values
        self._folder = confined_path(values["output_folder"], values["allowed_folders"], "output_folder")
        self._log: ChangeLog | None = None
        interface = position_interface(values["interface"], values["joint_name"])
        voltage = voltage_interface(values["voltage_interface"], values["joint_name"])
        self._recorder = StageRecorder(self, interface, voltage)
        self._recorder.begin()
        self._compensator = CompensatorClient(self, values["compensator"]) if values["compensator"] else None
        self._model: PiezoModel | None = None
        self._fit_rms_um = 0.0
        self._watch: ModelWatch | None = None
        self._stream: StageStream | None = None
        self._waiting: tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]] = (np.zeros((0, 2)), np.zeros((0, 2)))
        self._began_s = 0.0
        self._changes: list[dict[str, Any]] = []
        self._n_changes = 0
        self._standing = ""
        self._problem = "waiting for the model"
        self._is_asking = False
        self._cases: list[Case] = []
        self._work = WorkerRunner(self)
        self._sender = Sender(self, String, "~/changes", LATCHED)
        self.create_service(Trigger, "~/acknowledge", self._on_acknowledge)
        self.parameters.watch()
        self._apply(self.parameters.settings)
        self.create_timer(_TAKE_PERIOD_S, self._take, clock=steady_clock())
        self.create_timer(_MODEL_PERIOD_S, self._ask_for_model, clock=steady_clock())
        self._diagnostics = DiagnosticsPublisher(self, values["joint_name"], self._describe, (self._sender,))
        self._publish()

    def request_stop(self) -> None:
        """Stop at once; a diagnosis that runs is given up."""
        if not self.stopped.done():
            self._work.cancel("the node is shutting down")
            self.stopped.set_result(None)

    def close(self) -> None:
        """Listen no more."""
        self._recorder.close()
        if self._log is not None:
            self._log.close()

    # the model in force

    def _apply(self, settings: WatchNodeSettings) -> None:
        if not settings.values["compensator"]:
            if settings.model is None:
                self._problem = "no model: give one in model.*, or name a compensator"
            else:
                self._put_in_force(settings.model, settings.values.get("model.fit_rms_um", 0.0))

    def _ask_for_model(self) -> None:
        if self._compensator is not None and not self._is_asking:
            self._is_asking = True
            self.executor.create_task(self._follow_model())

    async def _follow_model(self) -> None:
        assert self._compensator is not None
        try:
            self._compensator.timeout_s = self.parameters.values["service_timeout_s"]
            told = await self._compensator.parameters()
            model = self._compensator.model(told)
            if model is None:
                self._problem = "the compensator has no model"
            else:
                self._put_in_force(model, float(told.get("model.fit_rms_um") or 0.0))
        except FomrcError as error:
            self._problem = str(error)
        finally:
            self._is_asking = False

    def _put_in_force(self, model: PiezoModel, fit_rms_um: float) -> None:
        self._problem = ""
        if self._model is not None and model.to_mapping() == self._model.to_mapping():
            return
        if self._model is not None:
            self.get_logger().info("another model is in force: what is normal is learnt anew")
        self._model, self._fit_rms_um, self._watch = model, fit_rms_um, None

    # watching

    def _take(self) -> None:
        self._recorder.take()
        sent, seen = self._recorder.drain()
        if self._model is None:
            return
        now_s = 1e-9 * self.get_clock().now().nanoseconds
        if self._stream is None:
            self._find_lag(sent, seen)
            return
        try:
            for samples in self._stream.add(sent, seen, now_s):
                if self._watch is None:
                    self._begin(samples.time_s)
                elif samples.begins_anew:
                    self._watch.begin_record()
                if self._watch is not None:
                    alarms = self._watch.take(samples.steps_s, samples.voltage_v, samples.displacement_um)
                    for alarm in alarms:
                        self._on_alarm(alarm)
        except FomrcError as error:
            self._problem = str(error)
            self._watch = None
        if self._watch is not None and (case := self._watch.next_case()) is not None:
            self._cases.append(case)
        if self._cases and self._work.progress is None:
            self.executor.create_task(self._look_into(self._cases.pop(0)))

    def _find_lag(self, sent: Any, seen: Any) -> None:
        sent, seen = (np.concatenate(pair) for pair in zip(self._waiting, (sent, seen), strict=True))
        if seen.size:
            oldest_s = seen[-1, 0] - _LONGEST_WAIT_S
            sent, seen = sent[sent[:, 0] >= oldest_s], seen[seen[:, 0] >= oldest_s]
        self._waiting = sent, seen
        if len(sent) < 2 or len(seen) < 2 or np.ptp(sent[:, 1]) < _LEAST_MOTION_V or np.ptp(seen[:, 0]) < _LAG_S:
            return
        period_s, sample_period_s = (float(np.median(np.diff(heard[:, 0]))) for heard in (sent, seen))
        self._stream = StageStream(best_lag_s(sent, seen, period_s), period_s, sample_period_s)
        self._stream.add(sent, seen, float(seen[-1, 0]))
        self._waiting = np.zeros((0, 2)), np.zeros((0, 2))

    def _begin(self, time_s: Any) -> None:
        if self._model is None or time_s.size < 8:
            return
        self._began_s = float(time_s[0])
        period_s = float(np.median(np.diff(time_s)))
        self._watch = ModelWatch(self._model, period_s, self.parameters.settings.watch, self._fit_rms_um)

    def _on_alarm(self, alarm: Alarm) -> None:
        self._standing = f"no longer the model: {alarm}"
        self.get_logger().warning(self._standing)
        self._diagnostics.publish()

    async def _look_into(self, case: Case) -> None:
        self._n_changes += 1
        folder = self._folder / f"change_{self._n_changes}"
        began_s = self._began_s
        try:
            answer: ChangeAnswer = await self._work.run(look_into, ChangeRequest(case, folder))
        except FomrcError as error:
            self._note(f"{case.alarm}; what has changed could not be found out: {error}")
            return
        applied = await self._applied(answer)
        stamps = {f"{name}_stamp_s": began_s + answer.results[f"{name}_s"] for name in ("noticed", "since")}
        self._changes = [*self._changes, answer.results | stamps | {"applied": applied, "page": str(folder)}][-_N_KEPT:]
        self._standing = f"changed: {answer.line}"
        self._note(f"{answer.line}; {applied}; page in {folder}")
        self._publish()
        self._diagnostics.publish()

    async def _applied(self, answer: ChangeAnswer) -> str:
        if not self.parameters.values["auto_apply"]:
            return "not applied: auto_apply is off"
        if answer.model is None or answer.refusal or self._compensator is None:
            return f"not applied: {answer.refusal or 'there is no compensator'}"
        try:
            await self._compensator.set_model(answer.model, answer.fit_rms_um)
        except FomrcError as error:
            return f"not applied: {error}"
        return "applied: the compensator has the extended model"

    def _note(self, line: str) -> None:
        self.get_logger().warning(line)
        try:
            if self._log is None:
                self._log = ChangeLog(make_directory(Path(self._folder), where="output_folder"))
            self._log.write(line)
        except (FomrcError, OSError) as error:
            self.get_logger().error(f"the log cannot be written: {error}")

    # telling

    def _on_acknowledge(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = bool(self._standing), self._standing or "nothing stands"
        self._standing = ""
        return response

    def _publish(self) -> None:
        self._sender.send(String(data=json.dumps({"changes": self._changes}, allow_nan=False)))

    def _describe(self) -> Report:
        state = self._watch.state.value if self._watch is not None else WatchState.STARTING.value
        report = Report(message=state, values={"state": state, "changes": self._n_changes})
        if self._watch is not None:
            report.values["watched_s"] = self._watch.time_s
            report.values["evidence_percent"] = 100.0 * self._watch.share_of_threshold
        if self._work.progress is not None:
            report.values["doing"] = self._work.progress.message
        if self._changes:
            report.values["cause"] = self._changes[-1]["cause"]
        if self._standing:
            report.worsen(WARN, self._standing)
        elif self._problem:
            report.worsen(WARN, self._problem)
        return report


def main(arguments: list[str] | None = None) -> int:
    """Run the node; the entry point of ``ros2 run fomrc_ros watch``."""
    return run(WatchNode, arguments)

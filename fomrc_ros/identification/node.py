"""The identification: recordings in files, or a live calibration of the stage, to a model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.errors import FomrcError, InputError
from fomrc_ros.identification import fit_work
from fomrc_ros.identification.calibration import Calibration
from fomrc_ros.identification.fit_work import DiagnosisRequest, FitAnswer, FitRequest, RecordingFiles
from fomrc_ros.identification.parameters import identification_specs
from fomrc_ros.identification.worker_process import Outcome, WorkerProcess
from fomrc_ros.node.diagnostics import OK, WARN, DiagnosticsPublisher, Report
from fomrc_ros.node.parameter_files import confined_path
from fomrc_ros.node.parameters import NodeParameters
from fomrc_ros.node.quality_of_service import LATCHED, overridable
from fomrc_ros.node.runtime import run, steady_clock

_POLL_PERIOD_S = 0.05
_CANCELLED = "cancelled"


@dataclass(frozen=True)
class IdentificationSettings:
    """The parameter values, checked as a whole."""

    values: Mapping[str, Any]
    limits: VoltageLimits


def build_settings(values: Mapping[str, Any]) -> IdentificationSettings:
    """Return the settings; raises ParameterError where values do not fit together."""
    return IdentificationSettings(dict(values), VoltageLimits.from_values(values))


class IdentificationNode(Node):
    """Services ``~/identify``, ``~/diagnose``, ``~/calibrate`` and ``~/cancel``; publishes ``~/model``."""

    def __init__(self) -> None:
        super().__init__("identification", allow_undeclared_parameters=True)
        self.stopped = Future()
        self.parameters = NodeParameters(self, identification_specs(), build_settings, lambda settings: None)
        self.parameters.watch()
        self._activity = ""
        self._last = "nothing yet"
        self._last_fit: FitAnswer | None = None
        self._is_last_good = True
        self._worker: WorkerProcess | None = None
        self._finished: Future | None = None
        self._calibration = Calibration(self, self._work, lambda: self._diagnostics.publish())
        self._publisher = self.create_publisher(String, "~/model", LATCHED, qos_overriding_options=overridable())
        for name, job in (
            ("identify", self._identify),
            ("diagnose", self._diagnose),
            ("calibrate", self._calibrate),
        ):
            self.create_service(Trigger, f"~/{name}", self._serving(name, job))
        self.create_service(Trigger, "~/cancel", self._on_cancel)
        self.create_timer(_POLL_PERIOD_S, self._poll, clock=steady_clock())
        self._diagnostics = DiagnosticsPublisher(self, self.parameters.values["joint_name"], self._describe)

    def request_stop(self) -> None:
        """End what runs, bring a stage that is being driven to safety, then end."""
        if self.stopped.done():
            return
        self._cancel("the node is shutting down")
        if not self._calibration.is_driving:
            self.stopped.set_result(None)

    # work

    def _serving(self, name: str, job: Callable[[], Any]) -> Callable[..., Any]:
        async def serve(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            if self._activity:
                response.success, response.message = False, f"busy: {self._activity} runs"
                return response
            self._activity = name
            try:
                response.message = await job()
                response.success = True
                self.get_logger().info(f"{name}: {response.message}")
            except FomrcError as error:
                response.success, response.message = False, str(error)
            except Exception as error:
                response.success, response.message = False, f"{type(error).__name__}: {error}"
            finally:
                self._activity = ""
            self._last, self._is_last_good = f"{name}: {response.message}", response.success
            if not response.success:
                self.get_logger().error(self._last)
            return response

        return serve

    async def _identify(self) -> str:
        values = self.parameters.values
        answer = await self._work(
            fit_work.fit,
            FitRequest(self._files(), values["n_elements"], values["method"], self._path("output_file")),
        )
        self.publish_model(answer)
        return self.summary(answer, self._path("output_file"))

    async def _diagnose(self) -> str:
        values = self.parameters.values
        model_path = self._path("model_file") if values["model_file"] else ""
        folder = self._path("output_folder")
        found = await self._work(fit_work.diagnose, DiagnosisRequest(self._files(), model_path, folder))
        return f"found {found}; written to {folder}"

    async def _calibrate(self) -> str:
        answer = await self._calibration.run(self.parameters.settings, self._path("output_file"))
        self.publish_model(answer)
        return self.summary(answer, self._path("output_file")) + "; in force"

    async def _work(self, work: Callable[..., Any], request: Any) -> Any:
        """Do the work in a process; raises FomrcError with the reason where it has no result."""
        self._finished = Future(executor=self.executor)
        self._worker = WorkerProcess(work, request)
        outcome: Outcome = await self._finished
        self._worker, self._finished = None, None
        if outcome.reason:
            raise FomrcError(outcome.reason)
        return outcome.result

    def _poll(self) -> None:
        if self._worker is not None and self._finished is not None and not self._finished.done():
            outcome = self._worker.poll()
            if outcome is not None:
                self._finished.set_result(outcome)

    def _cancel(self, reason: str) -> None:
        self._calibration.cancel(reason)
        if self._worker is not None:
            self._worker.cancel(reason)
            if self._finished is not None and not self._finished.done():
                self._finished.set_result(self._worker.outcome)

    def _on_cancel(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = bool(self._activity)
        response.message = f"cancelling {self._activity}" if self._activity else "nothing runs"
        self._cancel(_CANCELLED)
        return response

    # results

    def publish_model(self, answer: FitAnswer) -> None:
        """Publish a model for everyone, late joiners too."""
        self._last_fit = answer
        self._publisher.publish(String(data=answer.model_text))

    @staticmethod
    def summary(answer: FitAnswer, path: str) -> str:
        """Return what a fit came to, in one line."""
        error = f"rms {1e3 * answer.rms_um:.2f} nm, nrmse {answer.nrmse_percent:.3f} %"
        return f"{answer.outcome}: {answer.reason}; {error}; written to {path}"

    def _files(self) -> RecordingFiles:
        values = self.parameters.values
        if not values["recordings"]:
            raise InputError("no recording named", where="recordings", allowed="one or more files")
        folders = values["allowed_folders"]
        paths = tuple(str(confined_path(path, folders, "recordings")) for path in values["recordings"])
        test_path = values["test_recording"]
        if test_path:
            test_path = str(confined_path(test_path, folders, "test_recording"))
        return RecordingFiles(paths, test_path, values["columns"], values["record_rate_hz"], values["topics"])

    def _path(self, name: str) -> str:
        values = self.parameters.values
        return str(confined_path(values[name], values["allowed_folders"], name))

    def _describe(self) -> Report:
        report = Report(message=self._activity or "idle", values={"last": self._last})
        if self._activity:
            report.values["activity"] = self._activity
        progress = self._calibration.progress if self._calibration.is_running else None
        if progress is None and self._worker is not None:
            progress = self._worker.progress
        if progress is not None:
            report.values["progress_percent"] = 100.0 * progress.fraction
            report.values["doing"] = progress.message
            report.message = f"{self._activity}: {progress.message} ({100.0 * progress.fraction:.0f} %)"
        if self._last_fit is not None:
            report.values["fit_rms_nm"] = 1e3 * self._last_fit.rms_um
            report.values["fit_nrmse_percent"] = self._last_fit.nrmse_percent
        if not self._is_last_good and report.level == OK:
            report.worsen(WARN, self._last)
        return report


def main(arguments: list[str] | None = None) -> int:
    """Run the node; the entry point of ``ros2 run fomrc_ros identification``."""
    return run(IdentificationNode, arguments)

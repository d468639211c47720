"""The identification: recordings in files, or a live calibration of the stage, to a model."""

from __future__ import annotations

from pathlib import Path

from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from fomrc_core.errors import InputError
from fomrc_ros.identification import fit_work
from fomrc_ros.identification.calibration import Calibration
from fomrc_ros.identification.fit_work import DiagnosisRequest, FitAnswer, FitRequest, RecordingFiles
from fomrc_ros.node.diagnostics import WARN, DiagnosticsPublisher, Report
from fomrc_ros.node.jobs import Jobs
from fomrc_ros.node.parameter_files import check_kind, check_no_input, confined_path
from fomrc_ros.node.parameters import NodeParameters
from fomrc_ros.node.quality_of_service import LATCHED
from fomrc_ros.node.runtime import run
from fomrc_ros.node.sender import Sender
from fomrc_ros.node.work import Progress
from fomrc_ros.node.worker_process import WorkerRunner
from fomrc_ros.parameters.identification import build_settings, identification_specs
from fomrc_ros.parameters.names import WITHOUT_EFFECTS

_CANCELLED = "cancelled"


class IdentificationNode(Node):
    """Jobs ``identify``, ``diagnose`` and ``calibrate``, and ``~/cancel``; publishes ``~/model`` and ``~/status``."""

    def __init__(self) -> None:
        super().__init__("identification", allow_undeclared_parameters=True)
        self.stopped = Future()
        self.parameters = NodeParameters(
            self, identification_specs(), build_settings, lambda settings: None, WITHOUT_EFFECTS
        )
        self.parameters.watch()
        self._last_fit: FitAnswer | None = None
        self._work = WorkerRunner(self)
        self._calibration = Calibration(self, self.parameters.values, self._work, lambda: self._diagnostics.publish())
        self._sender = Sender(self, String, "~/model", LATCHED)
        work = {"identify": self._identify, "diagnose": self._diagnose, "calibrate": self._calibrate}
        self._jobs = Jobs(self, work, self._progress)
        self.create_service(Trigger, "~/cancel", self._on_cancel)
        self._diagnostics = DiagnosticsPublisher(
            self, self.parameters.values["joint_name"], self._describe, (self._sender, self._calibration.sender)
        )

    def request_stop(self) -> None:
        """End what runs, bring a stage that is being driven to safety, then end."""
        if self.stopped.done():
            return
        self._cancel("the node is shutting down", is_leaving=True)
        if not self._calibration.is_running:
            self.stopped.set_result(None)

    def close(self) -> None:
        """End what lies beside the node."""
        self._calibration.close()

    # work

    async def _identify(self) -> str:
        values = self.parameters.values
        files, output = self._files(), self._path("output_file")
        check_no_input(Path(output), files.all_paths, "output_file")
        answer = await self._work.run(fit_work.fit, FitRequest(files, values["n_elements"], values["method"], output))
        self.publish_model(answer)
        return self.summary(answer, self._path("output_file"))

    async def _diagnose(self) -> str:
        values = self.parameters.values
        model_path = self._path("model_file") if values["model_file"] else ""
        folder, files = self._path("output_folder"), self._files()
        inputs = (*files.all_paths, model_path) if model_path else files.all_paths
        for name in fit_work.DIAGNOSIS_FILES:
            check_no_input(Path(folder, name), inputs, "output_folder")
        found = await self._work.run(fit_work.diagnose, DiagnosisRequest(files, model_path, folder))
        return f"found {found}; written to {folder}"

    async def _calibrate(self) -> str:
        answer = await self._calibration.run(self.parameters.settings, self._path("output_file"))
        self.publish_model(answer)
        return self.summary(answer, self._path("output_file")) + "; in force"

    def _cancel(self, reason: str, *, is_leaving: bool = False) -> bool:
        is_in_time = self._calibration.cancel(reason, is_leaving=is_leaving) or not self._calibration.is_running
        if is_in_time or is_leaving:
            self._work.cancel(reason)
        return is_in_time

    def _on_cancel(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not self._jobs.activity:
            response.success, response.message = False, "nothing runs"
        elif self._cancel(_CANCELLED):
            response.success, response.message = True, f"cancelling {self._jobs.activity}"
        else:
            response.success, response.message = (
                False,
                f"too late: the model of this {self._jobs.activity} goes in force",
            )
        return response

    # results

    def publish_model(self, answer: FitAnswer) -> None:
        """Publish a model for everyone, late joiners too."""
        self._last_fit = answer
        self._sender.send(String(data=answer.model_text))

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
        for path in (*paths, test_path) if test_path else paths:
            check_kind(Path(path), "recordings")
        return RecordingFiles(paths, test_path, values["columns"], values["record_rate_hz"], values["topics"])

    def _path(self, name: str) -> str:
        values = self.parameters.values
        return str(confined_path(values[name], values["allowed_folders"], name))

    def _progress(self) -> Progress | None:
        return self._calibration.progress if self._calibration.is_running else self._work.progress

    def _describe(self) -> Report:
        report = Report(message=self._jobs.activity or "idle", values={"last": self._jobs.last})
        if self._jobs.activity:
            report.values["activity"] = self._jobs.activity
        progress = self._progress()
        if progress is not None:
            report.values["progress_percent"] = 100.0 * progress.fraction
            report.values["doing"] = progress.message
            report.message = f"{self._jobs.activity}: {progress.message} ({100.0 * progress.fraction:.0f} %)"
        if self._last_fit is not None:
            report.values["fit_rms_nm"] = 1e3 * self._last_fit.rms_um
            report.values["fit_nrmse_percent"] = self._last_fit.nrmse_percent
        if not self._jobs.is_last_good and not self._jobs.activity:
            report.worsen(WARN, self._jobs.last)
        return report


def main(arguments: list[str] | None = None) -> int:
    """Run the node; the entry point of ``ros2 run fomrc_ros identification``."""
    return run(IdentificationNode, arguments)

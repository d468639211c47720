"""What the identification node has done in a process of its own: fit and diagnosis of recordings in files."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fomrc_core.errors import FomrcError, StorageError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.recording import Recording

if TYPE_CHECKING:  # the fits take seconds to import, and only the process that does the work needs them
    from fomrc_core.identification.fit import Fit
    from fomrc_core.report.provenance import Provenance

# What a diagnosis writes into its folder.
DIAGNOSIS_FILES = ("diagnosis.json", "extended_model.yaml", "report.html")
Tell = Callable[[float, str], None]


@dataclass(frozen=True)
class RecordingFiles:
    """Recordings to work on.

    Args:
        paths: files, one or more.
        test_path: a file the result is tried on, "" for none.
        columns: which column is what, for files without a header: "" or e.g. "voltage=0,displacement=4".
        rate_hz: sampling rate of files without a time column [Hz], 0 where they have one.
        topics: which topic of a rosbag2 folder is what: "" or e.g. "voltage=/axis1/voltage".
    """

    paths: tuple[str, ...]
    test_path: str = ""
    columns: str = ""
    rate_hz: float = 0.0
    topics: str = ""

    @property
    def all_paths(self) -> tuple[str, ...]:
        """Every file that is read."""
        return (*self.paths, self.test_path) if self.test_path else self.paths


@dataclass(frozen=True)
class FitRequest:
    """A fit to make.

    Args:
        recordings: files, or the recordings themselves.
        n_elements: number of elements, 0 for as many as the data support.
        method: convex or paper.
        output_path: model file to write.
    """

    recordings: RecordingFiles | tuple[Recording, ...]
    n_elements: int
    method: str
    output_path: str


@dataclass(frozen=True)
class CalibrationRequest:
    """A fit to a stage just driven, to be put in force if it passes the gate.

    Args:
        recording: what was driven and measured.
        n_elements: number of elements, 0 for as many as the data support.
        method: convex or paper.
        output_path: model file to write.
        in_force: the model it is to take the place of, None where there is none.
    """

    recording: Recording
    n_elements: int
    method: str
    output_path: str
    in_force: PiezoModel | None


@dataclass(frozen=True)
class FitAnswer:
    """What came of a fit: the model file's text and how good the fit is."""

    model_text: str
    model_mapping: dict[str, Any]
    nrmse_percent: float
    rms_um: float
    outcome: str
    reason: str


@dataclass(frozen=True)
class DiagnosisRequest:
    """A diagnosis to make.

    Args:
        recordings: files.
        model_path: model to begin with, "" to fit one first.
        output_folder: where diagnosis.json, extended_model.yaml and report.html go.
    """

    recordings: RecordingFiles
    model_path: str
    output_folder: str


def read_files(files: RecordingFiles) -> tuple[list[Recording], Recording | None]:
    """Return the recordings, and the one to test on where there is one."""
    from fomrc_core.storage import read_recording
    from fomrc_core.storage.told_columns import column_numbers, named_once

    options: dict[str, Any] = {}
    if files.columns:
        options["columns"] = column_numbers(files.columns, "columns")
    if files.rate_hz > 0.0:
        options["rate_hz"] = files.rate_hz
    if files.topics:
        options["topics"] = named_once(files.topics, "topics")
    recordings = [read_recording(Path(path), **options) for path in files.paths]
    test = read_recording(Path(files.test_path), **options) if files.test_path else None
    return recordings, test


def fit(request: FitRequest, tell: Tell) -> FitAnswer:
    """Fit the recordings, write the model file and return what came of it."""
    from fomrc_core.identification.convex import identify
    from fomrc_core.storage import write_model

    if isinstance(request.recordings, RecordingFiles):
        tell(0.0, "reading")
        recordings, test = read_files(request.recordings)
    else:
        recordings, test = list(request.recordings), None
    found = identify(
        recordings, n_elements=request.n_elements or "auto", method=request.method, test=test, progress=tell
    )
    path = Path(request.output_path)
    write_model(found.model, path, found.rms_um)
    return _answer(found, path)


def calibrate(request: CalibrationRequest, tell: Tell) -> FitAnswer:
    """Fit the recording of a calibration; write the model file where the model passes the gate.

    Raises:
        FomrcError: the record teaches nothing, or the model does not pass; the record is kept beside the model file.
    """
    from fomrc_core.control.model_gate import fewer_elements, why_refused
    from fomrc_core.identification.convex import identify
    from fomrc_core.storage import write_model, write_recording

    path = Path(request.output_path)
    kept = path.with_name(f"{path.stem}.refused_record.csv")
    try:
        found = identify(
            [request.recording], n_elements=request.n_elements or "auto", method=request.method, progress=tell
        )
        while found.undetermined_elements and found.model.n_elements > 1:
            # More elements than the drive tells apart: those it does are a model of the same stage.
            n_elements = fewer_elements(found.model.n_elements, found.undetermined_elements)
            found = identify([request.recording], n_elements=n_elements, method=request.method, progress=tell)
        if found.undetermined_elements:
            reason = f"undetermined: {found.reason}"
        else:
            reason = why_refused(found.model, request.recording, in_force=request.in_force)
    except FomrcError as error:
        reason = str(error)
    if reason:
        write_recording(request.recording, kept)
        raise FomrcError(f"the calibrated model was refused: {reason}; its record is kept in {kept}")
    write_model(found.model, path, found.rms_um)
    return _answer(found, path)


def check_output(path: str) -> None:
    """Raise StorageError where a model file could not be written, before anything is driven for it."""
    folder = Path(path).parent
    if Path(path).is_dir():
        raise StorageError("is a folder", where="output_file", value=path, allowed="a file name")
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        raise StorageError("cannot be written", where="output_file", value=path, allowed="a folder that is there")


def _answer(found: Fit, path: Path) -> FitAnswer:
    return FitAnswer(
        path.read_text(encoding="utf-8"),
        found.model.to_mapping(),
        float(found.nrmse_percent),
        float(found.rms_um),
        str(getattr(found.outcome, "value", found.outcome)),
        str(found.reason),
    )


def diagnose(request: DiagnosisRequest, tell: Tell) -> str:
    """Diagnose the recordings, write report and extended model, and return the summary in one line."""
    from fomrc_core.diagnosis.diagnosis import diagnose as find_causes
    from fomrc_core.report.diagnosis_files import write_report
    from fomrc_core.storage import make_directory, read_model

    folder = make_directory(Path(request.output_folder), where="output_folder")
    tell(0.0, "reading")
    recordings, test = read_files(request.recordings)
    model = read_model(Path(request.model_path)) if request.model_path else None
    found = find_causes(recordings, test=test, model=model, progress=tell)
    write_report(found, folder, _origin(request))
    return " ".join(str(found.summary()).split())


def _origin(request: DiagnosisRequest) -> Provenance:
    """Return where a diagnosis comes from: the files, and the command line that makes the same."""
    from fomrc_core.report.provenance import Provenance

    files = request.recordings
    rate_hz = str(files.rate_hz) if files.rate_hz > 0.0 else ""
    roles = [("recording", path) for path in files.paths]
    roles += [(role, path) for role, path in (("test", files.test_path), ("model", request.model_path)) if path]
    options = {"--test": files.test_path, "--model": request.model_path, "--columns": files.columns, "--rate": rate_hz}
    options |= {"--topics": files.topics, "--output": request.output_folder}
    words = [word for option, value in options.items() if value for word in (option, value)]
    return Provenance.of(("fomrc", "diagnose", *files.paths, *words), roles)

"""What the watch has done in a process of its own: saying what an alarm was about, and writing its page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fomrc_core.diagnosis.watch.alarm import Case
from fomrc_core.model.piezo_model import PiezoModel

if TYPE_CHECKING:
    from pathlib import Path

Tell = Callable[[float, str], None]


@dataclass(frozen=True, eq=False)
class ChangeRequest:
    """An alarm to look into.

    Args:
        case: the alarm with what was measured.
        folder: where its page goes; made where it is not there.
    """

    case: Case
    folder: Path


@dataclass(frozen=True, eq=False)
class ChangeAnswer:
    """What an alarm was about.

    Attributes:
        line: in one line.
        results: as plain numbers and strings.
        model: the extended model, where one is better on the data after.
        fit_rms_um: what it left there [um].
        refusal: why that model must not be put in force, "" where it may.
    """

    line: str
    results: dict[str, Any]
    model: PiezoModel | None
    fit_rms_um: float
    refusal: str


def look_into(request: ChangeRequest, tell: Tell) -> ChangeAnswer:
    """Name the change, write its page, and ask the gate about the extended model."""
    from fomrc_core.control.model_gate import why_refused
    from fomrc_core.diagnosis.watch.naming import name_case
    from fomrc_core.records.recording import Recording
    from fomrc_core.report.change_files import change_line, change_results, write_change
    from fomrc_core.storage import make_directory

    case = request.case
    found = name_case(case, tell)
    tell(0.97, "writing its page")
    write_change(case, found, make_directory(request.folder, where="output_folder"))
    refusal = "no model can follow it, or none is better"
    if found.model is not None:
        # Asked of what was measured since the alarm: surely after the change, before which another model was true.
        after = case.recording.time_s >= case.alarm.time_s - case.began_s
        record = Recording(
            case.recording.time_s[after] - case.recording.time_s[after][0],
            case.recording.voltage_v[after],
            case.recording.measured_um[after],
            name="since the alarm",
        )
        refusal = why_refused(found.model, record, in_force=case.model)
    results = change_results(case.alarm, found, case.began_s)
    line = change_line(case.alarm, found, case.began_s)
    return ChangeAnswer(line, results, found.model, 1e-3 * found.after_nm, refusal)

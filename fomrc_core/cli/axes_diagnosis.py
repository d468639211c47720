"""``fomrc diagnose`` on recordings of several axes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from fomrc_core.cli.options import COMMAND
from fomrc_core.cli.progress import progress_shown, say, worker_threads
from fomrc_core.errors import ParameterError


def diagnose_several_axes(
    recordings: Sequence[Path], output: Path, test: Path | None, model: Path | None, periods: int | None
) -> None:
    """Diagnose recordings of several axes against their model, and write what was found.

    Args:
        recordings: files with numbered columns.
        output: folder to write to.
        test: held-out recording; blocks of the others are held out without it.
        model: model file with a block axes.
        periods: in each file; a column period tells them where not given.

    Raises:
        ParameterError: no model to question.
    """
    from fomrc_core.diagnosis.axes import AxesRecord, diagnose_axes
    from fomrc_core.report.axes_diagnosis_files import write_axes_report
    from fomrc_core.report.diagnosis_names import FILE_NAMES
    from fomrc_core.report.provenance import Provenance
    from fomrc_core.storage import check_outputs, files_in, make_directory
    from fomrc_core.storage.axes_files import read_axes_fit_error, read_axes_model, read_axes_recording

    if model is None:
        raise ParameterError(
            "recordings of several axes are diagnosed against their model, and none is given",
            where="--model",
            value="nothing",
            allowed="a file of fomrc identify-axes",
        )
    inputs = [*recordings, model, *([test] if test else [])]
    check_outputs(files_in(output, FILE_NAMES), inputs)
    base, error = read_axes_model(model), read_axes_fit_error(model)
    role = "train" if test else "both"
    records = []
    for path, use in [*((path, role) for path in recordings), *([(test, "test")] if test else [])]:
        found = read_axes_recording(path, periods)
        records.append(AxesRecord.of(found.name, found.rate_hz, found.voltage_v, found.displacement_um, role=use))
    read = [("recording", path) for path in recordings] + [("model", model)] + ([("test", test)] if test else [])
    provenance = Provenance.of(COMMAND.get(), read)
    folder = make_directory(output)
    with progress_shown("diagnose") as progress, worker_threads() as executor:
        diagnosis = diagnose_axes(records, base, model_error=error, progress=progress, executor=executor)
        progress(1.0, "report")
        write_axes_report(diagnosis, folder, provenance)
    print(diagnosis)
    say(f"{folder / 'report.html'}")

"""Write a model as C or as one Python file, for a controller that knows nothing of this package."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from fomrc_core.errors import StorageError
from fomrc_core.export import c_files
from fomrc_core.export.golden import GoldenData, golden_data
from fomrc_core.export.options import ExportOptions, Language
from fomrc_core.export.parts import LeftOut
from fomrc_core.export.plan import ExportPlan, make_plan
from fomrc_core.export.python_file import python_file
from fomrc_core.export.readme import readme
from fomrc_core.export.self_test_files import golden_header, self_test_source
from fomrc_core.export.start import with_start
from fomrc_core.export.template import read_template, render
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.storage import make_directory, write_text


@dataclass(frozen=True)
class Export:
    """What was written.

    Attributes:
        files: the files, in the order they were written.
        checksum: of the model, SHA-256 in hexadecimal digits.
        left_out: causes that are not exported, or not inverted.
        n_forward_bytes: size of a forward state in memory [bytes], 0 where there is none.
        n_inverse_bytes: size of an inverse state in memory [bytes], 0 where there is none.
    """

    files: tuple[Path, ...]
    checksum: str
    left_out: tuple[LeftOut, ...]
    n_forward_bytes: int
    n_inverse_bytes: int

    def __str__(self) -> str:
        lines = [f"model {self.checksum[:16]}: {', '.join(path.name for path in self.files)}"]
        sizes = (("forward", self.n_forward_bytes), ("inverse", self.n_inverse_bytes))
        lines += [f"{direction} state of {size} bytes" for direction, size in sizes if size]
        return "\n".join(lines + [f"left out: {cause}" for cause in self.left_out])


def export_model(model: PiezoModel, folder: str | os.PathLike[str], options: ExportOptions) -> Export:
    """Write a model into a folder; the same model and options give the same bytes.

    Source and header are the same on every machine. Golden data are answers of the compiled Python model, whose
    last digit may differ between kinds of processors.

    Args:
        model: what to export.
        folder: made where it is missing; may hold the files of a former export of this name, and nothing else.
        options: how to export it.

    Raises:
        ParameterError: an effect that cannot be exported.
        StorageError: a folder that holds other files, or cannot be written to.
    """
    plan = with_start(make_plan(model, options))
    texts = _c_texts(plan) if options.language is Language.C else _python_texts(plan)
    path = Path(folder)
    _check_folder(path, set(texts))
    make_directory(path)
    for file_name, text in texts.items():
        write_text(text, path / file_name)
    return Export(
        files=tuple(path / file_name for file_name in texts),
        checksum=plan.checksum,
        left_out=plan.left_out,
        n_forward_bytes=c_files.n_state_bytes(plan, False) if options.is_forward else 0,
        n_inverse_bytes=c_files.n_state_bytes(plan, True) if options.is_inverse else 0,
    )


def _golden(plan: ExportPlan) -> dict[str, GoldenData]:
    ways = (("forward", False, plan.options.is_forward), ("inverse", True, plan.options.is_inverse))
    return {direction: golden_data(plan, is_inverse) for direction, is_inverse, is_there in ways if is_there}


def _c_texts(plan: ExportPlan) -> dict[str, str]:
    name = plan.options.name
    return {
        f"{name}.h": c_files.header(plan),
        f"{name}.c": c_files.source(plan),
        f"{name}_golden.h": golden_header(plan, _golden(plan)),
        "self_test.c": self_test_source(plan),
        "CMakeLists.txt": render(read_template("CMakeLists.txt"), name, (), {}),
        "README.md": readme(plan),
    }


def _python_texts(plan: ExportPlan) -> dict[str, str]:
    return {f"{plan.options.name}.py": python_file(plan, _golden(plan))}


def _check_folder(folder: Path, own: set[str]) -> None:
    if not folder.exists():
        return
    if not folder.is_dir():
        raise StorageError("is no folder", where=str(folder), allowed="a new or empty folder")
    others = sorted(entry.name for entry in folder.iterdir() if entry.name not in own)
    if others:
        raise StorageError(
            "folder holds other files", where=str(folder), value=others[0], allowed="a new or empty folder"
        )

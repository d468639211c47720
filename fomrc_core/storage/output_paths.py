"""Where results may be written: told before the work, and never onto what they are made from."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from fomrc_core.errors import StorageError
from fomrc_core.storage.atomic import is_pipe_or_device, target_of


def check_outputs(outputs: Mapping[str, str | os.PathLike[str]], inputs: Iterable[str | os.PathLike[str]] = ()) -> None:
    """Refuse files that cannot be written, that would replace an input, or that would replace each other.

    To be asked before a work begins, so that a fit of minutes does not end in a missing folder. Pipes and devices
    such as /dev/stdout may be written to by all.

    Args:
        outputs: files to be written, by the option or field that names them.
        inputs: files and folders that are read.

    Raises:
        StorageError: the first that is wrong, naming option and file.
    """
    read = [Path(path) for path in inputs]
    checked: list[tuple[str, Path]] = []
    for option, given in outputs.items():
        if is_pipe_or_device(given):
            continue
        path = target_of(given)
        for source in read:
            if _is_same(path, source):
                raise StorageError("is an input too", where=option, value=str(given), allowed="another file")
            if _is_inside(path, source):
                raise StorageError("lies in a recording", where=option, value=str(given), allowed="another folder")
        for other, other_path in checked:
            if _is_same(path, other_path):
                raise StorageError(
                    f"is the file of {other} too", where=option, value=str(given), allowed="another file"
                )
        checked.append((option, path))


def files_in(folder: str | os.PathLike[str], names: Iterable[str], option: str = "--output") -> dict[str, Path]:
    """Return the files a command writes into its folder, to be checked; those of folders yet to be made are new."""
    if not os.path.isdir(folder):
        return {}
    return {f"{option} ({name})": Path(folder) / name for name in names}


def _is_same(path: Path, other: Path) -> bool:
    # By what they are, not by how they are spelt: links, hard links and ways round about count.
    if path.exists() and other.exists():
        return os.path.samefile(path, other)
    return os.path.realpath(path) == os.path.realpath(other)


def _is_inside(path: Path, folder: Path) -> bool:
    """Tell whether a file lies in a folder that is read as a whole, as a rosbag2 recording is."""
    return folder.is_dir() and Path(os.path.realpath(folder)) in Path(os.path.realpath(path)).parents

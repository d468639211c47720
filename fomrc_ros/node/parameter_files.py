"""Parameter files and other files a node touches: confined to folders, bounded in size, safe YAML only."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from fomrc_core.errors import StorageError
from fomrc_core.storage.atomic import read_text
from fomrc_core.storage.plain_yaml import load_yaml

LARGEST_PARAMETER_FILE_BYTES = 1_000_000
_DEEPEST = 12


def default_folders() -> list[str]:
    """Return the folders files may be in unless told otherwise: the working directory and ~/.ros."""
    return [os.getcwd(), str(Path.home() / ".ros")]


def confined_path(path: str, folders: Sequence[str], where: str, *, also: Sequence[Path] = ()) -> Path:
    """Return the path, links resolved, where it lies in one of the folders.

    Args:
        path: absolute, or relative to the first folder.
        folders: folders that may be used.
        where: parameter that named the path, for the message.
        also: files that may be used wherever they lie.

    Raises:
        StorageError: empty path, or outside of the folders.
    """
    if not path or "\0" in path:
        raise StorageError("no file named", where=where, allowed="a file in " + ", ".join(folders))
    roots = [Path(folder).expanduser().resolve() for folder in folders]
    if not roots:
        raise StorageError("no folder is allowed", where="allowed_folders", allowed="one or more folders")
    try:
        resolved = (roots[0] / Path(path).expanduser()).resolve()
    except (OSError, RuntimeError) as error:
        raise StorageError(f"path cannot be used: {error}", where=where, value=path) from None
    if resolved not in also and not any(resolved.is_relative_to(root) for root in roots):
        raise StorageError(
            "file lies outside of the allowed folders",
            where=where,
            value=str(resolved),
            allowed=", ".join(str(root) for root in roots),
        )
    return resolved


def check_no_input(output: Path, inputs: Sequence[str], where: str) -> None:
    """Raise StorageError where an output is one of the inputs: a recording written over is lost for good.

    Args:
        output: file to be written.
        inputs: files to be read.
        where: parameter that named the output, for the message.
    """
    for name in inputs:
        other = Path(name)
        # Two names may be one file, by a link.
        is_same = output == other or (output.exists() and other.exists() and output.samefile(other))
        if is_same:
            raise StorageError("is one of the inputs", where=where, value=str(output), allowed="another file")


def check_kind(path: Path, where: str) -> None:
    """Raise StorageError for a pipe or a device: reading one may never end."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise StorageError("is a pipe or a device", where=where, value=str(path), allowed="a file, or a bag's folder")


def read_parameter_file(path: Path, node_name: str) -> dict[str, Any]:
    """Return the parameters a YAML file holds for a node, as flat names.

    Entries for all nodes (``/**``) come first, then other patterns, then those for the node itself.

    Args:
        path: the file.
        node_name: fully qualified name of the node, e.g. ``/axis1/compensator``.

    Raises:
        StorageError: not there, too large, no safe YAML, no parameters for this node.
    """
    where = str(path)
    if path.exists() and not path.is_file():
        raise StorageError("not a file", where=where)
    content = load_yaml(read_text(path, n_bytes_max=LARGEST_PARAMETER_FILE_BYTES), where)
    if not isinstance(content, dict):
        raise StorageError("no parameters in it", where=where, value=content, allowed="/**: {ros__parameters: {...}}")
    found: dict[str, Any] = {}
    is_for_us = False
    for key in sorted(content, key=_how_special):
        if not _names_node(str(key), node_name):
            continue
        block = content[key]
        if not isinstance(block, dict) or not isinstance(block.get("ros__parameters"), dict):
            raise StorageError(
                "ros__parameters is missing", where=f"{where}: {key}", allowed="a mapping ros__parameters"
            )
        is_for_us = True
        _flatten(block["ros__parameters"], "", found, f"{where}: {key}", 0)
    if not is_for_us or not found:
        raise StorageError(
            "no parameters for this node",
            where=where,
            value=sorted(map(str, content))[:5],
            allowed=f"/** or {node_name}",
        )
    return found


def read_in_a_process(request: tuple[Path, str], tell: Callable[[float, str], None]) -> dict[str, Any]:
    """Return the parameters of a file, request being its path and the node's name; work for a process."""
    return read_parameter_file(*request)


def given_at_start() -> list[Path]:
    """Return the parameter files this process was started with, links resolved: who started it has allowed them."""
    following = zip(sys.argv, sys.argv[1:], strict=False)
    return [Path(file).resolve() for option, file in following if option == "--params-file"]


def started_with() -> str:
    """Return the first parameter file this process was started with, "" where there was none."""
    files = given_at_start()
    return str(files[0]) if files else ""


def _names_node(key: str, node_name: str) -> bool:
    # As the client library does: * is any one name, ** any number of them.
    pattern = re.escape(key if key.startswith("/") else f"/{key}")
    pattern = pattern.replace(re.escape("/**"), "(/[^/]+)*").replace(re.escape("*"), "[^/]+")
    return re.fullmatch(pattern, node_name) is not None


def _how_special(key: object) -> int:
    return 0 if key == "/**" else 1 if "*" in str(key) else 2


def _flatten(block: Mapping[Any, Any], prefix: str, found: dict[str, Any], where: str, depth: int) -> None:
    if depth > _DEEPEST:
        raise StorageError("nested too deeply", where=where, allowed=f"{_DEEPEST} levels")
    for key, value in block.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            _flatten(value, f"{name}.", found, where, depth + 1)
        elif value is None:
            raise StorageError("no value", where=f"{where}.{name}")
        else:
            found[name] = value

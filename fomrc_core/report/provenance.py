"""Where a result comes from: the command, the versions, the date and the checksums of what was read and written."""

from __future__ import annotations

import hashlib
import os
import platform
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

_PACKAGES = ("fomrc_ros", "numpy", "scipy", "numba", "matplotlib", "bokeh")
_N_BYTES_EACH = 1 << 20


@dataclass(frozen=True)
class FileSum:
    """A file and its checksum; of a folder those of all its files in the order of their names.

    Attributes:
        role: what it was to the work: recording, test, report, model, extended model.
        path: as it was given.
        n_bytes: size.
        sha256: checksum as hexadecimal digits; None of what is neither file nor folder.
    """

    role: str
    path: str
    n_bytes: int
    sha256: str | None

    @classmethod
    def of(cls, role: str, path: str | os.PathLike[str]) -> FileSum:
        """Return the checksum of what lies there now."""
        given = Path(path)
        files = sorted(p for p in given.rglob("*") if p.is_file()) if given.is_dir() else [given]
        if not all(file.is_file() for file in files):
            return cls(role, os.fspath(path), 0, None)
        digest, n_bytes = hashlib.sha256(), 0
        for file in files:
            with open(file, "rb") as content:
                while part := content.read(_N_BYTES_EACH):
                    digest.update(part)
                    n_bytes += len(part)
        return cls(role, os.fspath(path), n_bytes, digest.hexdigest())


@dataclass(frozen=True)
class Provenance:
    """Where a result comes from.

    Attributes:
        command: the command line that makes it again; empty where none does.
        made_at: date and time, UTC, ISO 8601.
        versions: of Python and of the packages the result depends on.
        files: what was read and what was written, with checksums.
    """

    command: str
    made_at: str
    versions: Mapping[str, str]
    files: tuple[FileSum, ...]

    @classmethod
    def of(cls, command: Sequence[str], files: Iterable[tuple[str, str | os.PathLike[str]]] = ()) -> Provenance:
        """Return the provenance of a result that is made now.

        Args:
            command: the command line as words; none where no command makes it.
            files: role and path of what was read.
        """
        told = os.environ.get("SOURCE_DATE_EPOCH", "")
        now = datetime.fromtimestamp(int(told), timezone.utc) if told.isdigit() else datetime.now(timezone.utc)
        sums = tuple(FileSum.of(role, path) for role, path in files)
        return cls(shlex.join(command), now.strftime("%Y-%m-%dT%H:%M:%SZ"), _versions(), sums)

    def with_file(self, role: str, path: str | os.PathLike[str]) -> Provenance:
        """Return the same with a further file, of which the name alone is told: it lies beside the page."""
        found = FileSum.of(role, path)
        return replace(self, files=(*self.files, replace(found, path=Path(path).name)))

    def results(self) -> dict[str, Any]:
        """Return the same as plain strings, numbers and lists."""
        return {
            "command": self.command,
            "made_at": self.made_at,
            "versions": dict(self.versions),
            "files": [
                {"role": file.role, "path": file.path, "n_bytes": file.n_bytes, "sha256": file.sha256}
                for file in self.files
            ],
        }


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found

"""A long work kept in a file as it proceeds, so that one cut short goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterable
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from fomrc_core.storage.atomic import make_directory, write_text


class KeptWork:
    """The parts of one work in a file, whole or not at all; those of another work are not taken.

    Args:
        path: the file; None keeps nothing.
        fingerprint: of everything the work depends on, see ``fingerprint_of``.
        pause_s: parts are written together where less time has passed since the last were: no more than this is lost
            by a kill [s].
    """

    def __init__(self, path: Path | None, fingerprint: str, pause_s: float = 0.0) -> None:
        self.path = path
        self._fingerprint, self._pause_s = fingerprint, pause_s
        self._parts = self._read()
        self._written_s = time.monotonic()
        self._is_written = True

    def __len__(self) -> int:
        return len(self._parts)

    def get(self, name: str) -> Any:
        """Return a part as it was kept, None where there is none."""
        return self._parts.get(name)

    def keep(self, name: str, part: Any) -> None:
        """Keep a part, of plain numbers, strings, lists and mappings.

        Raises:
            StorageError: the file cannot be written.
        """
        if self.path is None:
            return
        self._parts[name] = part
        self._is_written = False
        if time.monotonic() - self._written_s >= self._pause_s:
            self.write()

    def write(self) -> None:
        """Write what is not yet written.

        Raises:
            StorageError: the file cannot be written.
        """
        if self.path is None or self._is_written:
            return
        make_directory(self.path.parent)
        content = {"fingerprint": self._fingerprint, "parts": self._parts}
        write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", self.path)
        self._written_s, self._is_written = time.monotonic(), True

    def remove(self) -> None:
        """Remove the file: the work is done."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)

    def _read(self) -> dict[str, Any]:
        if self.path is None:
            return {}
        try:
            content = json.loads(self.path.read_text(encoding="utf-8"))
            return dict(content["parts"]) if content["fingerprint"] == self._fingerprint else {}
        except (OSError, ValueError, KeyError, TypeError):
            return {}  # none, cut short or not ours: all is done anew


def fingerprint_of(contents: Iterable[bytes]) -> str:
    """Return the fingerprint of a work by all it depends on and by the release that does it, hexadecimal."""
    digest = hashlib.sha256()
    with suppress(PackageNotFoundError):  # done by another release it comes to something else
        digest.update(version("fomrc_ros").encode())
    for content in contents:
        digest.update(len(content).to_bytes(8, "little"))
        digest.update(content)
    return digest.hexdigest()[:32]

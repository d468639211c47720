"""Rows of a comparison kept as each is done, so that one cut short goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from fomrc_core.comparison.baselines.rival import TrainingRecord
from fomrc_core.comparison.result import Row
from fomrc_core.storage import make_directory
from fomrc_core.storage.atomic import write_text

ROWS_NAME = "comparison_rows.json"


class KeptRows:
    """The rows of one comparison in a folder; those of other data, settings or releases are not taken.

    Args:
        directory: of the comparison; None keeps nothing.
        records: all records it fits and scores.
    """

    def __init__(self, directory: Path | None, records: Sequence[TrainingRecord]) -> None:
        self._path = None if directory is None else directory / ROWS_NAME
        self._fingerprint = _fingerprint(records)
        self._rows = self._read()

    def get(self, name: str) -> Row | None:
        """Return the row of an entrant, None where there is none."""
        return self._rows.get(name)

    def keep(self, name: str, row: Row) -> None:
        """Write the row of an entrant."""
        if self._path is None:
            return
        self._rows[name] = row
        make_directory(self._path.parent)
        rows = {entrant: kept.to_mapping() for entrant, kept in self._rows.items()}
        content = {"fingerprint": self._fingerprint, "rows": rows}
        write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", self._path)

    def _read(self) -> dict[str, Row]:
        if self._path is None:
            return {}
        try:
            content = json.loads(self._path.read_text(encoding="utf-8"))
            if content["fingerprint"] != self._fingerprint:
                return {}
            return {entrant: Row.from_mapping(kept) for entrant, kept in content["rows"].items()}
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return {}  # none, cut short or not ours: all are fitted anew


def _fingerprint(records: Sequence[TrainingRecord]) -> str:
    digest = hashlib.sha256()
    with suppress(PackageNotFoundError):  # fitted by another release a model is another one
        digest.update(version("fomrc_ros").encode())
    for record in records:
        for values in (record.steps_s, record.voltage_v, record.displacement_um, record.is_scored):
            digest.update(values.tobytes())
        digest.update(str(record.n_before).encode())
    return digest.hexdigest()[:16]

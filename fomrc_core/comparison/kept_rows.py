"""Rows of a comparison kept as each is done, so that one cut short goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from fomrc_core.comparison.baselines.rival import TrainingRecord
from fomrc_core.comparison.result import InverseQuality, Row
from fomrc_core.storage import make_directory
from fomrc_core.storage.atomic import write_text

ROWS_NAME = "comparison_rows.json"


class KeptRows:
    """The rows of one comparison in a folder; those of other data or settings are not taken.

    Args:
        directory: of the comparison; None keeps nothing.
        records: all records it fits and scores.
    """

    def __init__(self, directory: Path | None, records: Sequence[TrainingRecord]) -> None:
        self._path = None if directory is None else directory / ROWS_NAME
        self._fingerprint = _fingerprint(records)
        self._rows: dict[str, dict[str, Any]] = self._read()

    def __len__(self) -> int:
        return len(self._rows)

    def get(self, name: str) -> Row | None:
        """Return the row of an entrant, None where there is none."""
        kept = self._rows.get(name)
        return None if kept is None else _row(kept)

    def keep(self, name: str, row: Row) -> None:
        """Write the row of an entrant."""
        if self._path is None:
            return
        self._rows[name] = _finite(asdict(row))
        make_directory(self._path.parent)
        content = {"fingerprint": self._fingerprint, "rows": self._rows}
        write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", self._path)

    def _read(self) -> dict[str, dict[str, Any]]:
        if self._path is None:
            return {}
        try:
            content = json.loads(self._path.read_text(encoding="utf-8"))
            rows = content["rows"] if content["fingerprint"] == self._fingerprint else {}
            for kept in rows.values():
                _row(kept)
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return {}  # none, cut short or not ours: all are fitted anew
        return dict(rows)


def _row(kept: Mapping[str, Any]) -> Row:
    inverse = None if kept["inverse"] is None else InverseQuality(**_with_nan(kept["inverse"]))
    numbers = _with_nan({f.name: kept[f.name] for f in fields(Row) if f.name != "inverse"})
    return Row(**numbers, inverse=inverse)


def _with_nan(kept: Mapping[str, Any]) -> dict[str, Any]:
    return {name: math.nan if value is None else value for name, value in kept.items()}


def _finite(value: Any) -> Any:
    """Return the same without numbers that JSON has no word for."""
    if isinstance(value, Mapping):
        return {name: _finite(inner) for name, inner in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _fingerprint(records: Sequence[TrainingRecord]) -> str:
    digest = hashlib.sha256()
    for record in records:
        for values in (record.steps_s, record.voltage_v, record.displacement_um, record.is_scored):
            digest.update(values.tobytes())
        digest.update(str(record.n_before).encode())
    return digest.hexdigest()[:16]

"""Rows of a comparison kept as each is done, so that one cut short goes on where it stopped."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from fomrc_core.comparison.baselines.rival import TrainingRecord
from fomrc_core.comparison.result import Row
from fomrc_core.storage.kept_work import KeptWork, fingerprint_of

ROWS_NAME = "comparison_rows.json"


class KeptRows:
    """The rows of one comparison in a folder; those of other data, settings or releases are not taken.

    Args:
        directory: of the comparison; None keeps nothing.
        records: all records it fits and scores.
    """

    def __init__(self, directory: Path | None, records: Sequence[TrainingRecord]) -> None:
        path = None if directory is None else directory / ROWS_NAME
        self._work = KeptWork(path, fingerprint_of(_contents(records)))

    def get(self, name: str) -> Row | None:
        """Return the row of an entrant, None where there is none."""
        try:
            return Row.from_mapping(self._work.get(name))
        except (ValueError, KeyError, TypeError, AttributeError):
            return None  # none, or not ours: it is fitted anew

    def keep(self, name: str, row: Row) -> None:
        """Write the row of an entrant."""
        self._work.keep(name, row.to_mapping())


def _contents(records: Sequence[TrainingRecord]) -> Iterator[bytes]:
    for record in records:
        for values in (record.steps_s, record.voltage_v, record.displacement_um, record.is_scored):
            yield values.tobytes()
        yield str(record.n_before).encode()

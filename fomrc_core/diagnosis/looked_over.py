"""The records of a diagnosis with their bad samples left out, and what was wrong with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fomrc_core.compute.arrays import Array
from fomrc_core.records.quality import DataQuality, Examined, Slip, examine, examine_residual, without_slips
from fomrc_core.records.recording import Recording


@dataclass(frozen=True, eq=False)
class LookedOver:
    """Records that were looked over before anything is fitted to them.

    Attributes:
        train: records a fit learns from.
        test: held-out record, where there is one.
        report: third record, where there is one.
        quality: what is wrong with each, in this order.
    """

    train: tuple[Recording, ...]
    test: Recording | None
    report: Recording | None
    quality: tuple[DataQuality, ...]

    @classmethod
    def of(cls, train: Sequence[Recording], test: Recording | None, report: Recording | None) -> LookedOver:
        """Return the records with what is wrong with them alone masked.

        Raises:
            RecordingError: a record of which too much is wrong, or without displacement.
        """
        given = [*train, *(r for r in (test, report) if r is not None)]
        return cls._joined(len(train), test is not None, [examine(record) for record in given])

    @classmethod
    def taken(
        cls, train: Sequence[Recording], test: Recording | None = None, report: Recording | None = None
    ) -> LookedOver:
        """Return records whose readings were looked over before; their ``is_valid`` says which count."""
        given = [*train, *(r for r in (test, report) if r is not None)]
        quality = tuple(DataQuality(r.name, r.n_samples, (), r.valid_samples) for r in given)
        return cls(tuple(train), test, report, quality)

    @property
    def records(self) -> list[Recording]:
        """All records, in the order of ``quality``."""
        return [*self.train, *(r for r in (self.test, self.report) if r is not None)]

    def again(self, residuals_um: Sequence[Array]) -> LookedOver:
        """Return the records with what stands out of residuals masked too; the same object where nothing does.

        Args:
            residuals_um: what a model leaves of each record [um], in the order of ``records``.
        """
        seen = [examine_residual(r, v) for r, v in zip(self.records, residuals_um, strict=True)]
        if not any(e.quality.faults for e in seen):
            return self
        seen = [Examined(e.recording, q.joined(e.quality)) for q, e in zip(self.quality, seen, strict=True)]
        return self._joined(len(self.train), self.test is not None, seen)

    def without_slips(self, slips: Sequence[Sequence[Slip]]) -> LookedOver:
        """Return the records with readings that slipped by whole samples where they belong.

        Args:
            slips: of each record, in the order of ``records``.
        """
        seen = []
        for record, found, quality in zip(self.records, slips, self.quality, strict=True):
            moved = without_slips(record, found) if found else Examined(record, quality)
            faults = (*quality.faults, *moved.quality.faults) if found else quality.faults
            seen.append(Examined(moved.recording, replace(moved.quality, faults=faults)))
        return self._joined(len(self.train), self.test is not None, seen)

    def reading(self, displacements_um: Sequence[Array]) -> LookedOver:
        """Return the records with other displacements [um], in the order of ``records``."""
        pairs = zip(self.records, displacements_um, self.quality, strict=True)
        seen = [Examined(replace(r, displacement_um=x), quality) for r, x, quality in pairs]
        return self._joined(len(self.train), self.test is not None, seen)

    @classmethod
    def _joined(cls, n_train: int, has_test: bool, seen: Sequence[Examined]) -> LookedOver:
        records = [e.recording for e in seen]
        others = records[n_train:]
        test = others.pop(0) if has_test else None
        return cls(tuple(records[:n_train]), test, others[0] if others else None, tuple(e.quality for e in seen))

"""Causes in records too long to be searched whole: a stretch at their own rate first, then all of them, thinned.

What acts faster than a thinned sample can only be told apart at the full rate: it is searched about turns and jumps of
the drive in the first record, and believed where it leaves less of all that lies within the bins of the thinned
records, beyond what was searched. What was found there acts in the model with which the thinned records are then
searched, and about which they are thinned.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.findings import Finding
from fomrc_core.diagnosis.looked_over import LookedOver
from fomrc_core.effects import Effect, Stage
from fomrc_core.fitting.bend_windows import BendWindows, bend_windows
from fomrc_core.fitting.joint_fit import fit_until_still
from fomrc_core.fitting.long_records import LongRecords, Tell, Thinning
from fomrc_core.fitting.memory_plan import DIAGNOSING
from fomrc_core.fitting.structure_within import is_calmer
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.recording import Recording

_FEW_BENT = 4  # bins: where as few less count nothing is seen that was not


@dataclass(frozen=True, eq=False)
class LongSearch:
    """Long records under a search.

    Attributes:
        records: the records thinned, training first, then test and report.
        n_train: number of training records.
        has_test: whether there is a held-out record.
        known: findings of the stretch at the full rate that hold for all records.
        effects: their effects.
        looked_at: what was searched at the full rate; None where nothing was.
    """

    records: LongRecords
    n_train: int
    has_test: bool
    known: tuple[Finding, ...] = ()
    effects: tuple[Effect, ...] = ()
    looked_at: BendWindows | None = None

    @classmethod
    def of(
        cls,
        train: Sequence[Recording],
        test: Recording | None,
        report: Recording | None,
        max_memory_gb: float,
        tell: Tell,
    ) -> LongSearch | None:
        """Return the records thinned for a search; None where they are searched as they are."""
        given = [*train, *(r for r in (test, report) if r is not None)]
        records = LongRecords.of(given, DIAGNOSING, max_memory_gb, tell)
        return None if records is None else cls(records, len(train), test is not None)

    @property
    def is_thinned(self) -> bool:
        """Whether anything was averaged."""
        return self.records.thinned[0].outline.n_in_bin > 1

    def looked_over(self) -> LookedOver:
        """Return the thinned records for a search."""
        recordings = list(self.records.recordings)
        others = recordings[self.n_train :]
        test = others.pop(0) if self.has_test else None
        return LookedOver.taken(recordings[: self.n_train], test, others[0] if others else None)

    def windows(self) -> BendWindows | None:
        """Return the first record at its own rate where its drive turns and jumps; None where there is nothing."""
        return bend_windows(self.records.thinned[0], DIAGNOSING.n_kept // 2) if self.is_thinned else None

    def with_found(
        self, windows: BendWindows, findings: Sequence[Finding], ambiguous: Sequence[str], model: PiezoModel
    ) -> LongSearch:
        """Return the search with what was found at the full rate, as far as it holds in all records.

        Args:
            windows: what was searched.
            findings: what was found in it.
            ambiguous: causes that cannot be told from the last of them there.
            model: the model of it.
        """
        told = list(findings[:-1] if ambiguous else findings)
        acting = {effect.name: effect for effect in model.effects}
        found: list[Finding] = []
        effects: list[Effect] = []
        records = self.records
        for finding in told:
            effect = acting.get(finding.cause)
            if effect is None or not _can_be_known(effect):
                continue
            about = records.about((*effects, effect))
            if is_calmer(records.thinned, about.thinned, windows.n_span):
                records, found, effects = about, [*found, finding], [*effects, effect]
        return LongSearch(records, self.n_train, self.has_test, tuple(found), tuple(effects), windows)

    def unless_as_good(self, simpler: LongSearch, windows: BendWindows) -> LongSearch:
        """Return the simpler search where this one leaves nothing less within the bins, else this one."""
        is_worth_it = is_calmer(simpler.records.thinned, self.records.thinned, windows.n_span)
        return self if is_worth_it or not simpler.known else simpler

    def sharpened(self, model: PiezoModel) -> LongSearch | None:
        """Return the search about a model that was found; None where it bends as much as before within the bins."""
        about = self.records.about(tuple(effect for effect in model.effects if _acts_thinned(effect)))
        n_before, n_after = (sum(t.n_bent for t in r.thinned) for r in (self.records, about))
        if not (n_after < 0.5 * n_before - _FEW_BENT or is_calmer(self.records.thinned, about.thinned, 0)):
            return None
        return LongSearch(about, self.n_train, self.has_test, self.known, self.effects, self.looked_at)

    def thinning(self, model: PiezoModel, left_um: Sequence[Array]) -> Thinning:
        """Return how the records were thinned, and what is left of them at their own rate.

        Args:
            model: what was found.
            left_um: what it leaves of each thinned record [um], in their order.
        """
        bound = tuple(effect for effect in model.effects if _acts_thinned(effect))
        thinning = self.records.about(bound).thinning(left_um)
        names = tuple(finding.cause for finding in self.known)
        thinning = replace(thinning, found_at_whole_rate=names, not_looked_for=self.not_looked_for)
        if self.looked_at is None:
            return thinning
        time_s = self.looked_at.recording.time_s
        return replace(thinning, looked_at_s=(float(time_s[0]), float(time_s[-1])), n_windows=self.looked_at.n_windows)

    @property
    def not_looked_for(self) -> tuple[str, ...]:
        """Causes that live in single samples, of which thinned ones say nothing."""
        return tuple(name for name in cause_classes() if _in_single_samples(name)) if self.is_thinned else ()

    @property
    def told_as_tones(self) -> tuple[str, ...]:
        """Causes that are tones: these are taken out of records that are thinned, so that none is searched for."""
        return tuple(name for name in cause_classes() if _is_steady_tone(name)) if self.is_thinned else ()

    def start(self, base: TrialModel, split: DataSplit, executor: Executor | None) -> TrialModel:
        """Return where a search begins: the base with what is known to act."""
        if not self.effects:
            return base
        for effect in self.effects:
            base = base.with_cause(effect)
        return fit_until_still(base, split.train, executor).model


def _acts_thinned(effect: Effect) -> bool:
    return effect.stage is not Stage.SAMPLED_DRIVE and not effect.owns_columns


def _can_be_known(effect: Effect) -> bool:
    return _acts_thinned(effect) and not effect.belongs_to_record()


def _in_single_samples(name: str) -> bool:
    """Return whether a cause acts on the samples of a drive one by one, so that thinned ones say nothing of it."""
    kind = cause_classes()[name]
    return issubclass(kind, Effect) and kind.stage is Stage.SAMPLED_DRIVE


def _is_steady_tone(name: str) -> bool:
    kind = cause_classes()[name]
    return issubclass(kind, Effect) and kind.is_steady_tone

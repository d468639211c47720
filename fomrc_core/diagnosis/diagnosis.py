"""What the simulation gets wrong, why, and what mending it gains.

    diagnose(recordings, test=..., report=...) -> Diagnosis

The base is hysteresis and creep on a grid of thresholds fine enough that it is not what is wrong (or the given
model, in which case too few elements are a cause of their own); the search for causes is in search.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.blas_threads import with_one_algebra_thread
from fomrc_core.compute.notebook import CurvePanel, curves_figure, shown_as_html
from fomrc_core.diagnosis.asked import Asked
from fomrc_core.diagnosis.belief import probability_of_unknown, sureness_of, with_probabilities
from fomrc_core.diagnosis.clock_or_slips import moved_by_clock
from fomrc_core.diagnosis.constancy import constancy, unless_inconstant
from fomrc_core.diagnosis.data_split import DataSplit, quoted_residuals
from fomrc_core.diagnosis.extended_model import as_written, never_worse
from fomrc_core.diagnosis.findings import Finding, as_in_model, findings_of, smallest_detectable
from fomrc_core.diagnosis.finer_grid import on_same_grid
from fomrc_core.diagnosis.followed_rest import may_be_followed, unless_followed
from fomrc_core.diagnosis.judged_rest import JudgedRest, rms_learned
from fomrc_core.diagnosis.judgement import LEAST_BELIEVED, Judgement, Status
from fomrc_core.diagnosis.leverage import expected_excess
from fomrc_core.diagnosis.long_search import LongSearch
from fomrc_core.diagnosis.looked_over import LookedOver
from fomrc_core.diagnosis.missing_elements import coarse_model, missing_step, n_elements_needed
from fomrc_core.diagnosis.next_experiment import propose
from fomrc_core.diagnosis.prepared import Prepared
from fomrc_core.diagnosis.present_model import residual_inflation
from fomrc_core.diagnosis.record_view import RecordView, record_views
from fomrc_core.diagnosis.search import SearchResult, search
from fomrc_core.diagnosis.slips_beside import searched_beside
from fomrc_core.diagnosis.step import Step
from fomrc_core.diagnosis.training_tells import unless_training_tells
from fomrc_core.diagnosis.unnamed_extension import UnnamedExtension, unnamed_extension
from fomrc_core.diagnosis.untaught import BeyondLearned
from fomrc_core.diagnosis.weights_of_all import unless_of_weights
from fomrc_core.diagnosis.work_budget import cut_short, unless_uncompared
from fomrc_core.fitting.long_records import Thinning
from fomrc_core.fitting.memory_plan import MAX_MEMORY_GB
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.noise import NoiseFloor
from fomrc_core.records.quality import DataQuality
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import normalised_percent, rms
from fomrc_core.records.usability import check_usable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What the simulation gets wrong, why, and what mending it gains.

    Attributes:
        status: of the whole.
        judgement: whether what is left is noise, and the tests that say so.
        probability_of_unknown: that something acts that is not in the library [1].
        noise: noise floor by either way [um].
        noise_floor_um: the floor errors are compared with [um].
        baseline_train_percent: NRMSE of the base model on the training data [%].
        baseline_test_percent: the same on held-out data [%].
        final_test_percent: NRMSE of the extended model on held-out data [%].
        findings: causes in order of acceptance.
        ambiguous_with: causes the last finding could not be told from.
        unexplained_percent: share of the base model's excess power over the floor that is left [%].
        smallest_detectable: per cause, the size of its main parameter this data would have revealed.
        next_experiment: what to measure next, and why.
        extended_model: the model with what was found.
        records: every record before and after.
        quoted_on: which record before and after are quoted on.
        unnamed: terms that follow what no cause explains, in the extended model with the causes; None where none do.
        data_quality: what is wrong with the samples of each record, and which of them were left out.
        thinning: how long records were thinned for the search, and what that loses; None where they were not.
        beyond_learned: held-out records whose drive goes beyond that of the training records: no model is judged by
            what hysteresis does there alone, and the errors told hold it.
        stand_ins: accepted forms that another cause surely beats, or whose parameters are no larger than their errors,
            and that are no names for it: in the extended model for what they gain, for something that is not known.
        left_out: what of the search was too much work, in words: what was not asked may act.
        further_terms: accepted effects that are one more term of a finding, and no names of their own.
    """

    status: Status
    judgement: Judgement
    probability_of_unknown: float
    noise: NoiseFloor
    noise_floor_um: float
    baseline_train_percent: float
    baseline_test_percent: float
    final_test_percent: float
    findings: tuple[Finding, ...]
    ambiguous_with: tuple[str, ...]
    unexplained_percent: float
    smallest_detectable: Mapping[str, Mapping[str, float]]
    next_experiment: str
    extended_model: PiezoModel
    records: tuple[RecordView, ...]
    quoted_on: str
    unnamed: UnnamedExtension | None = None
    data_quality: tuple[DataQuality, ...] = ()
    thinning: Thinning | None = None
    stand_ins: tuple[Finding, ...] = ()
    beyond_learned: tuple[BeyondLearned, ...] = ()
    left_out: tuple[str, ...] = ()
    further_terms: tuple[Finding, ...] = ()

    @property
    def accepted(self) -> tuple[Finding, ...]:
        """The findings and what is one more term of one."""
        return (*self.findings, *self.further_terms)

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why what was named does not explain what the base model missed, in words; empty where it does."""
        probabilities, asked = sureness_of(self.findings)
        told = self.judgement.doubts(probabilities, bool(self.stand_ins), asked)
        is_open = self.status not in (Status.EXPLAINED, Status.NOTHING_FOUND)
        return (*told, *cut_short(self.left_out)) if is_open else told

    def __str__(self) -> str:
        return self.summary()

    def _repr_html_(self) -> str:
        return shown_as_html("Diagnosis", str(self))

    def plot(self) -> Figure:
        """Return a figure of the record before and after are quoted on: measured, simulated, and what is left."""
        view = next((v for v in reversed(self.records) if v.name == self.quoted_on), self.records[-1])
        before_um, after_um = view.residual_before_um, view.residual_after_um
        moved = {"measured": view.measured_um, "base model": view.measured_um - before_um}
        left = {"base model": 1e3 * before_um, "with what was found": 1e3 * after_um}
        return curves_figure(
            (
                CurvePanel(view.name, "time [s]", "displacement [µm]", view.time_s, moved),
                CurvePanel("what is left", "time [s]", "residual [nm]", view.time_s, left),
            )
        )

    def summary(self) -> str:
        """Return the diagnosis in a few lines."""
        lines = [f"status: {self.status.value}; noise floor {1e3 * self.noise_floor_um:.3g} nm rms"]
        lines += [f"data quality: {quality}" for quality in self.data_quality if quality.faults]
        lines += [f"beyond what was learned: {beyond}" for beyond in self.beyond_learned]
        lines += self.thinning.sentences() if self.thinning is not None else ()
        lines += [finding.sentence() for finding in self.findings]
        lines += [term.sentence_of_term(term.wider_of(self.findings)) for term in self.further_terms]
        lines += [finding.sentence_of_stand_in() for finding in self.stand_ins]
        if self.ambiguous_with:
            lines.append(f"cannot be told from: {', '.join(self.ambiguous_with)}")
        lines.append(
            f"held-out error ({self.quoted_on}): {self.baseline_test_percent:.4g} % -> {self.final_test_percent:.4g} %"
            f" of the range; unexplained {self.unexplained_percent:.3g} %"
        )
        lines += self.doubts
        lines += [f"what is left is taken for noise, but: {words}" for words in self.judgement.rests_on]
        lines += [words for words in cut_short(self.left_out) if words not in self.doubts]
        if self.unnamed is not None:
            lines.append(str(self.unnamed))
        lines.append(f"next: {self.next_experiment}")
        return "\n".join(lines)


@with_one_algebra_thread
def diagnose(
    recordings: Recording | Sequence[Recording],
    *,
    test: Recording | None = None,
    report: Recording | None = None,
    model: PiezoModel | None = None,
    excluded_causes: Sequence[str] = (),
    progress: Progress | None = None,
    executor: ThreadPoolExecutor | None = None,
    max_memory_gb: float = MAX_MEMORY_GB,
    thorough: bool = False,
) -> Diagnosis:
    """Return what a simulation of the recordings gets wrong.

    Records of more than 100 000 samples together are thinned for the search, see ``Diagnosis.thinning``.

    Args:
        recordings: training records.
        test: held-out record on which causes are accepted; without it blocks of the training records are held out.
        report: third record on which before and after are quoted; no cause is chosen by it, but what surely does
            worse there than the base is not kept.
        model: base model whose structure (its elements) is questioned; by default a fine grid of elements.
        excluded_causes: causes not to try.
        progress: called with the share done and what is being done.
        executor: screens, simulates and refits side by side.
        max_memory_gb: bound of memory [GB], the program and the recordings with it.
        thorough: go on where a search would be cut short, see ``Diagnosis.left_out``: minutes in the place of one.

    Raises:
        RecordingError: a record nothing can be learnt from.
        ParameterError: an unknown cause, or too little memory.
    """
    # Many arguments: the choices of one diagnosis, each with its usual value and given by name.
    tell = progress or (lambda _share, _text: None)
    given = (recordings,) if isinstance(recordings, Recording) else tuple(recordings)
    asked = Asked(tuple(excluded_causes), model, executor, thorough)
    long = LongSearch.of(given, test, report, max_memory_gb, tell)
    if long is not None:
        asked.check()
        return _of_long(long, asked, tell)
    looked = LookedOver.of(given, test, report)
    check_usable(looked.records)
    asked.check()
    return _searched(looked, asked, tell)


def _searched(looked: LookedOver, asked: Asked, tell: Progress, known: LongSearch | None = None) -> Diagnosis:
    """Return the diagnosis of records as they are.

    Args:
        looked: records.
        asked: what was asked.
        tell: progress.
        known: causes that act whatever is found, where the records were thinned.
    """
    wanted = {name: kind for name, kind in cause_classes().items() if name not in asked.excluded_causes}
    causes = tuple(name for name, kind in wanted.items() if kind.is_named and not kind.adds_elements)
    tell(0.02, "noise floor and base model")
    prepared = given = Prepared.of(looked)
    tell(0.05, "what the base model leaves")
    if known is None:
        prepared = given.looked_again()
        by_clock = moved_by_clock(prepared, given, given.base, prepared.base, asked.executor)
        if by_clock:
            prepared = given.looked_again(by_clock)
    found = _causes_of(prepared, causes, asked, tell, known)
    as_read = prepared.explained_moves(given, found.model, found.model)
    if as_read:
        # what was found in other records explains what looked like lost or doubled samples in these
        prepared = given.looked_again(as_read)
        found = _causes_of(prepared, causes, asked, tell, known)
    if known is None:
        prepared, found = searched_beside(
            given,
            prepared,
            found,
            lambda moved: _causes_of(moved, causes, asked, tell, known, is_once_more=True),
            asked.executor,
        )
    looked, noise, split, base = prepared.looked, prepared.noise, prepared.split, prepared.base
    elements = next((name for name, kind in wanted.items() if kind.adds_elements), None)
    coarse = coarse_model(asked.model, split) if asked.model is not None else None
    first: Step | None = None
    tell(0.96, "number of elements")
    if coarse is not None and elements is not None:
        first = missing_step(elements, coarse, base, found.model, split, len(cause_classes()))
    before = base if first is None else coarse or base
    result = _result(split, noise, before, found, first, tell, () if known is None else known.known)
    return replace(result, data_quality=looked.quality)


def _causes_of(
    prepared: Prepared,
    causes: tuple[str, ...],
    asked: Asked,
    tell: Progress,
    known: LongSearch | None,
    *,
    is_once_more: bool = False,
) -> SearchResult:
    """Return what a search of prepared records comes to, from causes that act whatever is found, where there are."""
    split, base = prepared.split, prepared.base
    start = base if known is None else known.start(base, split, asked.executor)
    return search(start, split, causes, tell, asked.executor, asked.is_thorough, is_once_more)


def _of_long(long: LongSearch, asked: Asked, tell: Progress) -> Diagnosis:
    """Return the diagnosis of long records: their beginning at the full rate, then all of them, thinned."""

    def part(begin: float, end: float, what: str) -> Progress:
        return lambda share, text: tell(begin + (end - begin) * share, f"{what}: {text}")

    long.records.check_usable()
    asked = asked.without(long.told_as_tones)
    windows = long.windows()
    if windows is not None:
        looked = LookedOver.taken((windows.recording,))
        found = _searched(looked, asked, part(0.05, 0.25, "at the full rate"), long)
        begun, long = long, long.with_found(windows, found.accepted, found.ambiguous_with, found.extended_model)
        general = [f.cause for f in long.known if cause_classes()[f.cause].generalizes]
        if general:
            found = _searched(looked, asked.without(general), part(0.25, 0.3, "at the full rate, simpler"), begun)
            other = begun.with_found(windows, found.accepted, found.ambiguous_with, found.extended_model)
            long = long.unless_as_good(other, windows)
    asked = asked.without((*long.not_looked_for, *(effect.name for effect in long.effects)))
    result = _searched(long.looked_over(), asked, part(0.3, 0.7, "thinned"), long)
    sharper = long.sharpened(result.extended_model)
    if sharper is not None:
        long = sharper
        result = _searched(long.looked_over(), asked, part(0.7, 0.98, "thinned about what was found"), long)
    thinning = long.thinning(result.extended_model, [view.residual_after_um for view in result.records])
    doubted = tuple(f.cause for f in result.findings if f.probability < LEAST_BELIEVED)
    thinning = replace(thinning, doubted=doubted)
    judgement = result.judgement
    if thinning.unnamed:
        judgement = replace(judgement, is_noise=False, reasons=(*judgement.reasons, *thinning.unnamed))
    told, least = sureness_of(result.findings)
    status = judgement.status(told, bool(result.ambiguous_with), bool(result.stand_ins), least)
    status = unless_uncompared(status, result.left_out)
    return replace(result, status=status, judgement=judgement, thinning=thinning, data_quality=long.records.quality)


def _result(
    split: DataSplit,
    noise: NoiseFloor,
    base: TrialModel,
    found: SearchResult,
    first: Step | None,
    tell: Progress,
    known: tuple[Finding, ...],
) -> Diagnosis:
    # Many arguments: what each stage of a diagnosis came to; no two are ever handed on together.
    base = on_same_grid(base, found.model, split)
    found, extension = never_worse(found, base, split, has_elements=first is not None)
    steps = (first, *found.steps) if first is not None and not extension.is_base else found.steps
    if extension.is_base:
        base = extension.trial  # what is told of it is told of what is written: weights as elements can have them
    tell(0.97, "what remains")
    quoted_um = [h.record.measured_um[h.record.is_used] for h in split.report]
    inflation = residual_inflation(found.final.residual, split.train)
    learning = max(expected_excess(extension.trial, split.train, part, inflation) for part in split.report)
    rest = JudgedRest.of(extension.trial, base, split, noise, learning)
    records, floor = rest.records, rest.floor_um
    findings = findings_of(steps, extension.trial, found.final, split, floor, n_elements_needed(extension.model))
    findings = (*as_in_model(known, extension.trial, found.final, split), *findings)
    judgement = unless_of_weights(rest, extension.trial, base, split, noise)
    judgement = unless_training_tells(judgement, found.runner_up, split)
    constant = constancy(found.model, found.final, split)
    judgement = unless_inconstant(judgement, constant)
    findings = tuple(replace(finding, twice=constant.of_cause(finding.cause)) for finding in findings)
    tell(0.98, "what no cause explains")
    unnamed = None
    if not judgement.is_noise or may_be_followed(rest.after_um, floor):
        unnamed = unnamed_extension(extension.trial, split, floor)
    judgement = unless_followed(judgement, unnamed[1] if unnamed is not None else None)
    everything = with_probabilities(findings, judgement)
    unnamed_forms = {step.accepted.cause for step in steps if step.is_beaten}
    unnamed_forms |= {finding.cause for finding in everything if finding.is_undetermined}
    findings = tuple(finding for finding in everything if finding.cause not in unnamed_forms)
    terms = tuple(finding for finding in findings if finding.wider_of(findings))
    findings = tuple(finding for finding in findings if finding not in terms)
    # what else a form could be that is no name is nobody's question
    named = {finding.cause for finding in findings}
    tied = next((s.tied for s in reversed(steps) if s.tied and s.accepted.cause in named), ())
    probabilities, least = sureness_of(findings)
    status = judgement.status(probabilities, bool(tied), bool(unnamed_forms), least)
    status = unless_uncompared(status, found.left_out)
    # judged is what the causes leave; what is written follows the rest as well, and is scored as it is written
    written, described = extension.model, None
    trial = extension.trial
    if unnamed is not None and not judgement.is_noise:
        trial, described = unnamed
        written = as_written(trial, split)
        records, _, _ = record_views(split, base, trial, noise)
    told = [rms(np.concatenate(quoted_residuals(each, split.report))) for each in (base, trial)]
    return Diagnosis(
        status=status,
        judgement=judgement,
        probability_of_unknown=probability_of_unknown(judgement, tuple(f for f in everything if f not in terms)),
        noise=noise,
        noise_floor_um=floor,
        baseline_train_percent=normalised_percent(rms_learned(base, split), [r.measured_um for r in split.train]),
        baseline_test_percent=normalised_percent(told[0], quoted_um),
        final_test_percent=normalised_percent(told[1], quoted_um),
        findings=findings,
        ambiguous_with=tuple(tied),
        unexplained_percent=100.0 * judgement.unexplained_share,
        smallest_detectable=smallest_detectable(found.screened, split),
        next_experiment=propose(status.value, steps, found.runner_up, extension.model, split, floor),
        extended_model=written,
        records=records,
        quoted_on=split.report[0].record.recording.name,
        unnamed=described,
        stand_ins=tuple(finding for finding in everything if finding.cause in unnamed_forms),
        further_terms=terms,
        beyond_learned=split.beyond_learned,
        left_out=found.left_out,
    )

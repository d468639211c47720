"""Pairs of causes that a joint screening holds for likely, fitted together: which of them leaves least."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.fit_starts import clear_error, fit_starts, scanned
from fomrc_core.diagnosis.joint_screening import LikelyPair, likely_pairs
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.record_effects import sought_again
from fomrc_core.diagnosis.screening import Screened, sketch_of
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.joint_fit import Refit, fit_until_still, refit
from fomrc_core.fitting.linear_part import tangent
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.prehistory import Prehistory

_MOST_PAIRS = 4  # begun: a few iterations each
_MOST_BESIDE = 2  # of those with what was chosen already
_MOST_ALIKE = 5  # begun of those like the best
_MOST_FORMS = 4  # begun of the best in other forms
_MOST_FOLLOWED = 3  # to their rest
_FIRST_ITERATIONS = 4


@dataclass(frozen=True, eq=False)
class FittedPair:
    """Two causes fitted together beside a model.

    Attributes:
        pair: the two.
        fitted: their joint refit.
    """

    pair: LikelyPair
    fitted: Refit


def fitted_pairs(
    present: PresentModel,
    split: DataSplit,
    screened: tuple[Screened, ...],
    executor: Executor | None,
    beside: str | None = None,
    given_up: frozenset[str] = frozenset(),
) -> list[FittedPair]:
    """Return the likeliest pairs after their joint refits, that which leaves least first.

    Args:
        present: the model they are fitted beside.
        split: records.
        screened: the screening of that model.
        executor: runs refits side by side where given.
        beside: a cause with which as well some pairs are fitted, where given.
        given_up: causes that were no findings alone; no two of them are asked for.
    """
    clear_um = sketch_of(v[r.is_used] for v, r in zip(present.clear_um, present.records, strict=True))
    pairs = list(likely_pairs(screened, clear_um, _MOST_PAIRS, given_up=given_up))
    if beside is not None:
        known = {pair.names for pair in pairs}
        own = likely_pairs(screened, clear_um, _MOST_BESIDE, with_cause=beside, given_up=given_up)
        pairs += [pair for pair in own if pair.names not in known]
    begun = _all_begun(present, split, pairs, executor)
    if begun:
        known = {found.pair.names for found in begun}
        alike = [pair for pair in begun[0].pair.alike if pair.names not in known][:_MOST_ALIKE]
        alike += begun[0].pair.other_forms[:_MOST_FORMS]
        begun = sorted((*begun, *_all_begun(present, split, alike, executor)), key=_left)
        # whichever of those alike is ahead is asked in its other forms as well
        if begun[0].pair in alike:
            further = begun[0].pair.other_forms[:_MOST_FORMS]
            begun = sorted((*begun, *_all_begun(present, split, list(further), executor)), key=_left)
    followed = begun[:_MOST_FOLLOWED]
    if not any(beside in found.pair.names for found in followed):
        followed += [found for found in begun if beside in found.pair.names][:1]
    run = map if executor is None else executor.map
    return sorted(run(_followed, [(split, f) for f in followed]), key=_left)


def _all_begun(
    present: PresentModel, split: DataSplit, pairs: list[LikelyPair], executor: Executor | None
) -> list[FittedPair]:
    run = map if executor is None else executor.map
    begun = [found for found in run(_begun, [(present, split, pair) for pair in pairs]) if found is not None]
    return sorted(begun, key=_left)


def _left(found: FittedPair) -> float:
    return found.fitted.squared_error


def _begun(task: tuple[PresentModel, DataSplit, LikelyPair]) -> FittedPair | None:
    present, split, pair = task
    try:
        model = _with(_with(present.model, pair.one, split), pair.other, split)
        fitted = refit(model, split.train, n_iterations=_FIRST_ITERATIONS)
    except ParameterError:
        return None
    return FittedPair(pair, fitted) if fitted.squared_error < present.squared_error else None


def _with(model: TrialModel, trials: tuple[Screened, ...], split: DataSplit) -> TrialModel:
    """Return the model with a cause at the size its trials give, of several ways to begin that which leaves least."""
    directions = tangent(model, split.train)
    starts = fit_starts(model, list(trials), trials[0].index is not None, split, directions)
    if trials[0].cause.is_scanned:
        return scanned(starts[0], split, directions, trials[0])
    return min(starts, key=lambda start: clear_error(start, split, directions)) if len(starts) > 1 else starts[0]


def _followed(task: tuple[DataSplit, FittedPair]) -> FittedPair:
    split, found = task
    still = fit_until_still(found.fitted.model, split.train)
    best = min(still, found.fitted, key=lambda fitted: fitted.squared_error)
    for first in (found.pair.one[0], found.pair.other[0]):
        if isinstance(first.cause, Prehistory) or first.cause.has_own_times():
            # told while the other was hidden: neither a past nor a time comes to the right one by a fit
            best = sought_again(best, split, first.name, None)
    return FittedPair(found.pair, best)

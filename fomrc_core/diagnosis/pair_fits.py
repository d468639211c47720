"""Pairs of causes that a joint screening holds for likely, fitted together: which of them leaves least."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property

from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.fit_starts import clear_error, fit_starts, scanned
from fomrc_core.diagnosis.joint_screening import LikelyPair, likely_pairs
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import Screened, sketch_of
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.joint_fit import Refit, fit_until_still, refit
from fomrc_core.fitting.linear_part import tangent
from fomrc_core.fitting.trial_model import TrialModel

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


@dataclass(frozen=True, eq=False)
class LikelyPairs:
    """Pairs of causes that may act beside a model.

    Attributes:
        present: the model.
        split: records.
        screened: the screening of that model.
        executor: runs refits side by side where given.
        given_up: causes that were no findings alone; no two of them are asked for.
    """

    present: PresentModel
    split: DataSplit
    screened: tuple[Screened, ...]
    executor: Executor | None
    given_up: frozenset[str]

    @cached_property
    def fitted(self) -> list[FittedPair]:
        """The likeliest after their joint refits, that which leaves least first."""
        begun = self._begun(self._told(_MOST_PAIRS))
        if not begun:
            return []
        known = {found.pair.names for found in begun}
        alike = [pair for pair in begun[0].pair.alike if pair.names not in known][:_MOST_ALIKE]
        alike += begun[0].pair.other_forms[:_MOST_FORMS]
        begun = sorted((*begun, *self._begun(alike)), key=_left)
        # whichever of those alike is ahead is asked in its other forms as well
        if begun[0].pair in alike:
            begun = sorted((*begun, *self._begun(begun[0].pair.other_forms[:_MOST_FORMS])), key=_left)
        return self._followed(begun[:_MOST_FOLLOWED])

    def beside(self, cause: str) -> list[FittedPair]:
        """Return those with one cause, that which leaves least first: some more are fitted where there are none."""
        own = [found for found in self.fitted if cause in found.pair.names]
        return own or self._followed(self._begun(self._told(_MOST_BESIDE, cause))[:1])

    def _told(self, n_most: int, with_cause: str | None = None) -> tuple[LikelyPair, ...]:
        used = zip(self.present.clear_um, self.present.records, strict=True)
        clear_um = sketch_of(left[record.is_used] for left, record in used)
        return likely_pairs(self.screened, clear_um, n_most, with_cause, self.given_up)

    def _begun(self, pairs: Sequence[LikelyPair]) -> list[FittedPair]:
        run = map if self.executor is None else self.executor.map
        begun = run(_begun, [(self.present, self.split, pair) for pair in pairs])
        return sorted((found for found in begun if found is not None), key=_left)

    def _followed(self, begun: list[FittedPair]) -> list[FittedPair]:
        run = map if self.executor is None else self.executor.map
        return sorted(run(_followed, [(self.split, found) for found in begun]), key=_left)


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
    return FittedPair(found.pair, min(still, found.fitted, key=lambda fitted: fitted.squared_error))

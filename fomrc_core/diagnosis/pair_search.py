"""Two causes at once, where no one alone does or neither is the whole."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, replace

from fomrc_core.diagnosis.candidate import Candidate, candidates_for, held_view
from fomrc_core.diagnosis.data_split import DataSplit, held_residuals
from fomrc_core.diagnosis.decision import is_accepted, is_no_wander, likelier
from fomrc_core.diagnosis.held_out_score import WORTHWHILE_LOG_GAIN, held_out_score
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import screen
from fomrc_core.diagnosis.search_state import SearchState
from fomrc_core.diagnosis.step import Step

_SPEAKS_UP = 0.3  # in the logarithm of the mean squared error: a third more of it explained than by what was chosen
_MOST_FIRSTS = 2  # tried with a second beside them: each costs a round


@dataclass(frozen=True, eq=False)
class Round:
    """What a pair is sought among in one round of a search.

    Attributes:
        state: how far the search has come.
        candidates: of this round, the best first.
        split: records.
        wanted: names that a second may have.
        n_causes: number of causes the search tries.
        executor: runs refits side by side where given.
    """

    state: SearchState
    candidates: list[Candidate]
    split: DataSplit
    wanted: tuple[str, ...]
    n_causes: int
    executor: Executor | None


def any_pair(asked: Round) -> tuple[SearchState, Candidate] | None:
    """Return a second candidate to accept, and the state with a first, where no one alone does.

    The first is the likeliest, or one that explains much of the training data: where two causes act, one of them alone
    may do worse than none on held-out data, that show more of the other.
    """
    candidates = asked.candidates
    told = [c for c in candidates[1:] if c.is_plausible and not c.is_bound and not c.brings_plays]
    told = [c for c in told if c.train_log_gain > _SPEAKS_UP]
    told = sorted(told, key=lambda candidate: -candidate.train_log_gain)[:_MOST_FIRSTS]
    for first in (*(c for c in candidates[:1] if c.score.log_gain >= -WORTHWHILE_LOG_GAIN), *told):
        pair = _with_pair(asked, first)
        if pair is not None:
            return pair
    return None


def or_pair(chosen: tuple[SearchState, Candidate], asked: Round) -> tuple[SearchState, Candidate]:
    """Return what was chosen, or a pair that does better in training and on held-out data.

    Where training data surely speak for another cause than held-out data do neither is the whole: each may stand in
    there for what the other record shows of two.
    """
    accepted = chosen[1]
    told = [c for c in asked.candidates if not c.is_bound and c.is_plausible]
    told = [c for c in told if c.train_log_gain > accepted.train_log_gain + _SPEAKS_UP]
    # beside one that does, one that does worse than none held out has nothing to say
    told = [c for c in told if c.score.log_gain >= -WORTHWHILE_LOG_GAIN]
    for first in sorted(told, key=lambda candidate: -candidate.train_log_gain)[:_MOST_FIRSTS]:
        pair = _with_pair(asked, first)
        if pair is None or pair[1].score.log_gain < accepted.score.log_gain:
            continue
        # two explain more than one whichever they are: what was chosen gets a second as well
        own = _with_pair(asked, accepted)
        errors = [accepted.fitted.squared_error, *([] if own is None else [own[1].fitted.squared_error])]
        if pair[1].fitted.squared_error < min(errors):
            return pair
    return chosen


def best_beside(
    first: Candidate, split: DataSplit, causes: tuple[str, ...], executor: Executor | None
) -> Candidate | None:
    """Return the candidate that gains most beside a first one, of those its model has not."""
    present = PresentModel.of(first.fitted.model, split)
    wanted = tuple(name for name in causes if name != first.cause and not present.model.has(name))
    screened = screen(present, wanted, held_view(present.model, split), executor)
    return next(iter(candidates_for(present, split, screened, executor)), None)


def _with_pair(asked: Round, first: Candidate) -> tuple[SearchState, Candidate] | None:
    """Return a second candidate to accept, and the state with the first of the pair, where one alone does not do."""
    state, split = asked.state, asked.split
    second = _second_of_pair(asked, first)
    if second is None or not is_accepted(second, asked.n_causes) or not is_no_wander(second, split):
        return None
    steps = (*state.steps, Step(state.model, replace(first, score=second.score), (), ()))
    state = replace(state, model=first.fitted.model, steps=steps, tried=state.tried | {first.cause})
    return state, likelier(second, asked.candidates, split, asked.n_causes)


def _second_of_pair(asked: Round, first: Candidate) -> Candidate | None:
    """Return a second candidate that gains together with a first on held-out data, where one alone does not."""
    if first.train_log_gain < WORTHWHILE_LOG_GAIN:
        return None
    second = best_beside(first, asked.split, asked.wanted, asked.executor)
    if second is None:
        return None
    before = held_residuals(asked.state.model, asked.split.held)
    after = held_residuals(second.fitted.model, asked.split.held)
    return replace(second, score=held_out_score(before, after))

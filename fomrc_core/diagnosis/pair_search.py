"""Two causes at once, where no one alone does or neither is the whole."""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

from fomrc_core.diagnosis.beside_slow import found_beside_slow
from fomrc_core.diagnosis.candidate import (
    Candidate,
    candidate_of,
    candidates_for,
    held_view,
    is_confirmed,
)
from fomrc_core.diagnosis.candidate_fits import Begun
from fomrc_core.diagnosis.data_split import DataSplit, held_residuals
from fomrc_core.diagnosis.decision import NEARLY, is_accepted, is_finding, is_no_wander, likelier, simplest, sure_gain
from fomrc_core.diagnosis.held_out_score import SURE, WORTHWHILE_LOG_GAIN, HeldOutScore, held_out_score
from fomrc_core.diagnosis.kin import with_kin
from fomrc_core.diagnosis.nothing_left import nothing_is_left
from fomrc_core.diagnosis.pair_fits import LikelyPairs
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.record_effects import follow_held
from fomrc_core.diagnosis.screening import Screened, screen
from fomrc_core.diagnosis.search_state import SearchState
from fomrc_core.diagnosis.step import Step
from fomrc_core.diagnosis.work_budget import CAUSES, PAIRS, WorkBudget
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.joint_fit import Refit, refit
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes
from fomrc_core.records.drive import held_out_blocks

MUCH_LEFT = 4.0  # times the noise's power
_ALONE = 4  # iterations of the first of a pair without the second
SPEAKS_UP = 0.3  # in the logarithm of the mean squared error: a third more of it explained than by what was chosen
_MOST_BESIDE = 2  # findings beside which a pair is sought where no one cause gains
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
        budget: of the search: beyond it no pair is sought.
        pairs: of causes that may act beside the state's model, what was given up alone among them; None where no pair
            is to be told from signatures.
    """

    state: SearchState
    candidates: list[Candidate]
    split: DataSplit
    wanted: tuple[str, ...]
    n_causes: int
    executor: Executor | None
    budget: WorkBudget = field(default_factory=WorkBudget.unlimited)
    pairs: LikelyPairs | None = None


def any_pair(asked: Round) -> tuple[SearchState, Candidate] | None:
    """Return a second candidate to accept, and the state with a first, where no one alone does.

    The first is the likeliest, or one that explains much of the training data: where two causes act, one of them alone
    may do worse than none on held-out data, that show more of the other. What would be found but for noise that might
    wander as much comes before them: what another leaves beside it, a load that comes and goes, wanders as well. Where
    no test finds anything left that follows the drive, two have nothing to explain either. Beside as many as a pair
    already, only what was refused is asked: two more of any kind would be told from a record that tells no one more.
    """
    candidates = asked.candidates
    if not candidates or nothing_is_left(asked.state.model, asked.split):
        return None
    told_pair = _told_by_signatures(asked, None)
    if told_pair is not None:
        return told_pair
    likeliest = [c for c in candidates[:1] if c.score.log_gain >= -WORTHWHILE_LOG_GAIN]
    told = [c for c in candidates if c.is_plausible and not c.is_bound and not c.brings_plays and c not in likeliest]
    told = [c for c in told if c.train_log_gain > SPEAKS_UP]
    told = sorted(told, key=lambda candidate: -candidate.train_log_gain)[:_MOST_FIRSTS]
    # whoever is accepted by its score here was refused as wander, by a record or by the likelihood of what is left
    refused = [c for c in candidates if _is_accepted_but_for_wander(c, asked.n_causes)][:_MOST_FIRSTS]
    firsts = [*likeliest, *(c for c in refused if c not in likeliest), *(c for c in told if c not in refused)]
    for first in firsts if len(asked.state.steps) < _MOST_BESIDE else refused:
        if not asked.budget.allows(PAIRS, has_found=bool(asked.state.steps)):
            break
        pair = _with_pair(asked, first)
        if pair is not None:
            return pair
    return None


def or_pair(chosen: tuple[SearchState, Candidate], asked: Round) -> tuple[SearchState, Candidate]:
    """Return what was chosen, or a pair that does better in training and on held-out data.

    Where training data surely speak for another cause than held-out data do neither is the whole: each may stand in
    there for what the other record shows of two.
    """
    accepted, best = chosen[1], None
    if asked.pairs is not None and accepted.fitted.squared_error > MUCH_LEFT * asked.split.noise_um2:
        return _told_by_signatures(asked, accepted) or chosen
    # what would have been chosen but for noise that might wander as much, others still hidden, wanders less beside them
    louder = [c for c in asked.candidates if c.is_unconfirmed and c.total_gain > accepted.total_gain]
    refused = [c for c in louder if _is_accepted_but_for_wander(c, asked.n_causes)][:1]
    for first in [*_firsts_beside(accepted, asked.candidates, asked.split), *refused]:
        if not asked.budget.allows(PAIRS):
            break
        pair = _with_pair(asked, first)
        if pair is None or pair[1].score.log_gain < accepted.score.log_gain:
            continue
        if best is None or sure_gain(best[1].fitted, pair[1].fitted, asked.split) > SURE:
            best = pair
    if best is None:
        return chosen
    # two explain more than one whichever they are: what was chosen gets a second as well
    own = _with_pair(asked, accepted)
    errors = [accepted.fitted.squared_error, *([] if own is None else [own[1].fitted.squared_error])]
    return best if best[1].fitted.squared_error < min(errors) else chosen


def pair_ahead(asked: Round, begun: list[Begun]) -> tuple[SearchState, Candidate] | None:
    """Return a second candidate, and the state with a first, of a pair that is far ahead of any one cause.

    Asked before one cause is followed to its rest: where several act none alone is the whole.

    Args:
        asked: what is asked among.
        begun: the first iterations of the causes, one at a time.
    """
    if asked.pairs is None or not begun:
        return None
    first = min(begun, key=lambda each: each.fits[0][0].squared_error)
    fitted = first.fits[0][0]
    if fitted.squared_error < MUCH_LEFT * asked.split.noise_um2:
        return None
    try:
        leading = candidate_of(asked.pairs.present, asked.split, first.cause, fitted, first.is_bound)
    except ParameterError:
        return None
    return _told_by_signatures(asked, leading)


def _told_by_signatures(asked: Round, leading: Candidate | None) -> tuple[SearchState, Candidate] | None:
    """Return a second candidate, and the state with a first, of the pair that leaves least of all that look likely.

    It must surely leave less than half of what the leading one alone leaves, which no parameter takes by itself; one
    with that one comes first where another does not surely leave less. Held-out data may speak against it by less than
    training speaks for it: how well a base carries over to them while much is hidden differs from fit to fit.
    """
    split, pairs = asked.split, asked.pairs
    if pairs is None or not asked.budget.allows(CAUSES) or pairs.present.squared_error < MUCH_LEFT * split.noise_um2:
        return None
    found = pairs.fitted[:1]
    if leading is not None and found:
        own = pairs.beside(leading.cause)[:1]
        is_behind = all(sure_gain(each.fitted, found[0].fitted, split) > SURE for each in own)
        found = [*found, *own] if is_behind else [*own, *found]
    for each in found:
        learnt = math.inf
        if leading is not None:
            learnt = math.log(leading.fitted.squared_error / each.fitted.squared_error)
            if learnt < NEARLY or sure_gain(leading.fitted, each.fitted, split) < SURE:
                continue
        ordered = sorted((each.pair.one, each.pair.other), key=_accepted_first)
        for first, second in (ordered, ordered[::-1]):
            pair = _in_order(asked, each.fitted, first[0], second[0])
            if pair is not None and (leading is None or leading.held_gain - pair[1].score.log_gain <= learnt):
                return pair
    return None


def _accepted_first(trials: tuple[Screened, ...]) -> tuple[bool, float]:
    # what bends to much else is believed by what it mends, which shows beside the other
    return cause_classes()[trials[0].name].bends_to_much, -sum(trial.explained for trial in trials)


def _in_order(asked: Round, fitted: Refit, first: Screened, second: Screened) -> tuple[SearchState, Candidate] | None:
    """Return a fitted pair as one accepted after the other, and the state between; None where it is no finding."""
    assert asked.pairs is not None
    state, split, present = asked.state, asked.split, asked.pairs.present
    lesser = refit(fitted.model.as_before(present.model, second.name), split.train, n_iterations=_ALONE)
    try:
        alone = candidate_of(present, split, first.name, lesser, first.index is not None)
        between = PresentModel.of(alone.fitted.model, split)
        both = candidate_of(between, split, second.name, fitted, second.index is not None)
    except ParameterError:
        return None
    if not alone.is_bound:
        both = replace(both, score=_score_of_pair(present.model, fitted.model, split))
    elif not is_confirmed(fitted, split, first.name):
        return None
    if not is_no_wander(both, split, first.name):
        return None
    if not is_finding(both, split, asked.n_causes):
        # what nobody has found yet may hide in held-out data what is quick: it is told by what that does not foresee
        held_before = tuple(held_residuals(present.model, split.held))
        ways = both, replace(both, held_before=held_before)
        if both.is_bound or alone.is_bound or not all(found_beside_slow([w], split, asked.n_causes) for w in ways):
            return None
    steps = (*state.steps, Step(state.model, replace(alone, score=both.score), (), ()))
    return replace(state, model=lesser.model, steps=steps, tried=state.tried | {first.name}), both


def _firsts_beside(accepted: Candidate, candidates: list[Candidate], split: DataSplit) -> list[Candidate]:
    """Return the candidates to try a second beside, plays of their own last: they bend to much that is another cause.

    Where only such a one speaks up in training, those without are asked too that explain more there than what was
    accepted.
    """
    # beside one that does, one that does worse than none held out has nothing to say
    told = [c for c in candidates if not c.is_bound and c.is_plausible and c.score.log_gain >= -WORTHWHILE_LOG_GAIN]
    told = sorted(told, key=lambda candidate: -candidate.train_log_gain)
    loud = [c for c in told if c.train_log_gain > accepted.train_log_gain + SPEAKS_UP]
    rich = [c for c in loud if c.brings_plays][:1]
    plain = [c for c in (told if rich else loud) if not c.brings_plays]
    plain = [c for c in plain if c is not accepted and c.train_log_gain > accepted.train_log_gain]
    plain = [c for c in plain if not _is_general_for_nothing(c, plain, split)]
    return [*plain[:_MOST_FIRSTS], *rich]


def _is_accepted_but_for_wander(candidate: Candidate, n_causes: int) -> bool:
    """Return whether nothing speaks against it but that noise might wander as much while others are hidden."""
    return is_accepted(replace(candidate, is_plausible=candidate.is_plausible or candidate.is_unconfirmed), n_causes)


def _is_general_for_nothing(candidate: Candidate, others: list[Candidate], split: DataSplit) -> bool:
    """Return whether a special case of it does as well."""
    special = next((c for c in others if c.cause == cause_classes()[candidate.cause].generalizes), None)
    return special is not None and sure_gain(special.fitted, candidate.fitted, split) <= SURE


def best_beside(
    first: Candidate, split: DataSplit, causes: tuple[str, ...], executor: Executor | None
) -> Candidate | None:
    """Return the candidate that gains most beside a first one, of those its model has not."""
    # what belongs to single records would hide all else in the held-out one if it were not followed there
    model = follow_held(first.fitted.model, split) if first.is_bound else first.fitted.model
    present = PresentModel.of(model, split)
    wanted = tuple(name for name in causes if name != first.cause and not present.model.has(name))
    screened = screen(present, wanted, held_view(present.model, split), executor)
    candidates = candidates_for(present, split, screened, executor)
    if not candidates:
        return None
    # beside a first, too, what holds another as a special case must predict better than that
    candidates = with_kin(candidates[0], candidates, present, split, wanted)
    return simplest(candidates[0], candidates, split, len(causes))


def _with_pair(asked: Round, first: Candidate) -> tuple[SearchState, Candidate] | None:
    """Return a second candidate to accept, and the state with the first of the pair, where one alone does not do."""
    state, split = asked.state, asked.split
    second = _second_of_pair(asked, first)
    if second is None or not is_finding(second, split, asked.n_causes):
        return None
    steps = (*state.steps, Step(state.model, replace(first, score=second.score), (), ()))
    state = replace(state, model=first.fitted.model, steps=steps, tried=state.tried | {first.cause})
    return state, likelier(second, asked.candidates, split, asked.n_causes)


def _second_of_pair(asked: Round, first: Candidate) -> Candidate | None:
    """Return a second candidate that gains together with a first on held-out data, where one alone does not.

    What belongs to single records may be told from a sensor that wanders only beside the second: the first must be
    told there, and the second gain beside it.
    """
    if first.train_log_gain < WORTHWHILE_LOG_GAIN:
        return None
    second = best_beside(first, asked.split, asked.wanted, asked.executor)
    if second is None:
        return None
    if not first.is_bound:
        if is_accepted(first, asked.n_causes) and not is_no_wander(second, asked.split, first.cause):
            return None
        return replace(second, score=_score_of_pair(asked.state.model, second.fitted.model, asked.split))
    is_told = is_confirmed(second.fitted, asked.split, first.cause)
    return second if is_told and is_no_wander(second, asked.split, first.cause) else None


def _score_of_pair(before: TrialModel, pair: TrialModel, split: DataSplit) -> HeldOutScore:
    """Return how a pair does on held-out data beside the model before it.

    What belongs to single records acts in the held-out one in its own way: it is fitted to some blocks there, and the
    others are scored. Left out it would hide there whatever the other of the two explains.
    """
    kinds = {cause.name for at, cause in pair.found() if at is not None}
    if kinds <= {cause.name for at, cause in before.found() if at is not None} or not split.is_apart:
        return held_out_score(held_residuals(before, split.held), held_residuals(pair, split.held))
    scored = tuple(
        replace(part, record=part.record.using(part.record.is_used & held_out_blocks(part.record.time_s.size)))
        for part in split.held
    )
    followed = follow_held(pair, replace(split, report=()))
    return held_out_score(held_residuals(before, scored), held_residuals(followed, scored))

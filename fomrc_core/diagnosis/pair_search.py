"""Two causes at once, where no one alone does or neither is the whole."""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

from fomrc_core.diagnosis.acceptance import NEARLY, is_accepted, is_finding, is_no_wander
from fomrc_core.diagnosis.candidate import Candidate, candidate_of, candidates_for, implausible_in, is_confirmed
from fomrc_core.diagnosis.data_split import MUCH_LEFT, DataSplit, held_residuals
from fomrc_core.diagnosis.decision import likelier, simplest, sure_gain
from fomrc_core.diagnosis.held_out_score import SURE, WORTHWHILE_LOG_GAIN, HeldOutScore, held_out_score
from fomrc_core.diagnosis.kin import with_kin
from fomrc_core.diagnosis.nothing_left import nothing_is_left
from fomrc_core.diagnosis.pair_fits import fitted_pairs
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.record_effects import follow_held
from fomrc_core.diagnosis.screening import Screened, held_view, screen
from fomrc_core.diagnosis.search_state import SearchState
from fomrc_core.diagnosis.step import Step
from fomrc_core.diagnosis.work_budget import CAUSES, PAIRS, WorkBudget
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.joint_fit import Refit, refit
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes
from fomrc_core.records.drive import held_out_blocks

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
        present: the model of the state on the training records; None where no pair is to be told from signatures.
        screened: the screening of that model, what was given up alone among it.
    """

    state: SearchState
    candidates: list[Candidate]
    split: DataSplit
    wanted: tuple[str, ...]
    n_causes: int
    executor: Executor | None
    budget: WorkBudget = field(default_factory=WorkBudget.unlimited)
    present: PresentModel | None = None
    screened: tuple[Screened, ...] = ()


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
    if asked.present is not None and accepted.fitted.squared_error > MUCH_LEFT * asked.split.noise_um2:
        told = _told_by_signatures(asked, accepted)
        return chosen if told is None or _does_better_with_a_second(accepted, told, asked) else told
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


def _does_better_with_a_second(accepted: Candidate, told: tuple[SearchState, Candidate], asked: Round) -> bool:
    """Return whether what was accepted leaves surely less than a pair of others once it has a second as well.

    Signatures are slopes: what a large effect leaves at its full size they do not foresee, nor who explains that.
    """
    state, second = told
    is_of_pair = accepted.cause in (state.steps[-1].accepted.cause, second.cause)
    leaves_little = second.fitted.squared_error < MUCH_LEFT * asked.split.noise_um2
    if is_of_pair or leaves_little or accepted.is_bound or not asked.budget.allows(PAIRS):
        return False
    own = best_beside(accepted, asked.split, asked.wanted, asked.executor)
    return own is not None and sure_gain(second.fitted, own.fitted, asked.split) > SURE


def _told_by_signatures(asked: Round, accepted: Candidate | None) -> tuple[SearchState, Candidate] | None:
    """Return a second candidate, and the state with a first, of the pair that leaves least of all that are findings.

    It must surely leave less than half of what was accepted leaves, which no parameter takes by itself, and less than
    a pair with that. Held-out data may speak against it by less than training speaks for it: how well a base carries
    over to them while much is hidden differs from fit to fit.
    """
    split, present = asked.split, asked.present
    if present is None or not asked.budget.allows(CAUSES) or present.squared_error < MUCH_LEFT * split.noise_um2:
        return None
    if accepted is not None and accepted.is_bound and cause_classes()[accepted.cause].has_own_times():
        return None  # it is at rest only once its times are moved: what it leaves before is nobody's
    beside = None if accepted is None else accepted.cause
    pairs = fitted_pairs(present, split, asked.screened, asked.executor, beside, asked.state.tried)
    # a lag that no sample shows as what it is called leaves least beside anything, and is no finding
    pairs = [found for found in pairs if not implausible_in(found.fitted.model, split)]
    if not pairs:
        return None
    own = next((found for found in pairs if beside in found.pair.names), pairs[0])
    if sure_gain(own.fitted, pairs[0].fitted, split) <= SURE:
        pairs = [own, *(found for found in pairs if found is not own)]
    for found in pairs:
        learnt = math.inf
        if accepted is not None:
            learnt = math.log(accepted.fitted.squared_error / found.fitted.squared_error)
            if learnt < NEARLY or sure_gain(accepted.fitted, found.fitted, split) < SURE:
                continue
        ordered = sorted((found.pair.one, found.pair.other), key=_accepted_first)
        for first, second in (ordered, ordered[::-1]):
            pair = _in_order(asked, found.fitted, first[0], second[0])
            if pair is None or (accepted is not None and accepted.held_gain - pair[1].score.log_gain > learnt):
                continue
            return pair
    return None


def _accepted_first(trials: tuple[Screened, ...]) -> tuple[bool, float]:
    # what bends to much else is believed by what it mends, which shows beside the other
    return cause_classes()[trials[0].name].bends_to_much, -sum(trial.explained for trial in trials)


def _in_order(asked: Round, fitted: Refit, first: Screened, second: Screened) -> tuple[SearchState, Candidate] | None:
    """Return a fitted pair as one accepted after the other, and the state between; None where it is no finding."""
    assert asked.present is not None
    state, split, present = asked.state, asked.split, asked.present
    lesser = refit(fitted.model.as_before(present.model, second.name), split.train, n_iterations=_ALONE)
    try:
        alone = candidate_of(present, split, first.name, lesser, first.index is not None)
        between = PresentModel.of(alone.fitted.model, split)
        both = candidate_of(between, split, second.name, fitted, second.index is not None)
    except ParameterError:
        return None
    if not alone.is_bound:
        both = replace(both, score=score_of_pair(present.model, fitted.model, split))
    elif not is_confirmed(fitted, split, first.name):
        return None
    if not is_finding(both, split, asked.n_causes) or not is_no_wander(both, split, first.name):
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
        return replace(second, score=score_of_pair(asked.state.model, second.fitted.model, asked.split))
    is_told = is_confirmed(second.fitted, asked.split, first.cause)
    return second if is_told and is_no_wander(second, asked.split, first.cause) else None


def score_of_pair(before: TrialModel, pair: TrialModel, split: DataSplit) -> HeldOutScore:
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

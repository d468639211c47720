"""The search for causes: screen, refit, accept on held-out data, re-test, stop."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

from fomrc_core.diagnosis.acceptance import is_accepted, is_finding
from fomrc_core.diagnosis.beside_slow import found_beside_slow
from fomrc_core.diagnosis.better_rival import with_better_rival
from fomrc_core.diagnosis.candidate import Candidate, refitted
from fomrc_core.diagnosis.data_split import MUCH_LEFT, DataSplit, held_residuals
from fomrc_core.diagnosis.decision import likelier, simplest, sure_gain
from fomrc_core.diagnosis.events_or_plays import events_in_place_of_plays
from fomrc_core.diagnosis.finer_grid import on_finer_grid
from fomrc_core.diagnosis.held_out_score import SURE, held_out_score
from fomrc_core.diagnosis.kin import with_kin
from fomrc_core.diagnosis.last_look import LastLook, looked_at_last
from fomrc_core.diagnosis.noise_beside import with_noise_beside
from fomrc_core.diagnosis.pair_search import Round, any_pair, or_pair
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import Screened, held_view, screen
from fomrc_core.diagnosis.search_state import AS_NOISE, SearchState, with_rival, without_finding, without_wander
from fomrc_core.diagnosis.step import Step
from fomrc_core.diagnosis.unseated import with_unseating
from fomrc_core.diagnosis.with_finding import with_finding
from fomrc_core.diagnosis.work_budget import CAUSES, COMPARED, WorkBudget
from fomrc_core.diagnosis.worth_a_refit import worth_a_refit
from fomrc_core.fitting.joint_fit import Refit, refit
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes

MAX_FINDINGS = 5  # beside hysteresis and creep; each costs a round
_MAX_ROUNDS = 2 * MAX_FINDINGS  # as many in which a cause takes another's place
_MAX_TIERS = 2  # of a round: each costs its refits


@dataclass(frozen=True, eq=False)
class SearchResult:
    """What the search came to.

    Attributes:
        model: the final model.
        steps: acceptances that still stand, in order.
        final: the last joint refit.
        screened: the last screening, for the smallest detectable sizes.
        runner_up: best candidate that was not accepted in the last round, if any.
        left_out: what was not done for it would have been too much work, in words.
    """

    model: TrialModel
    steps: tuple[Step, ...]
    final: Refit
    screened: tuple[Screened, ...]
    runner_up: Candidate | None
    left_out: tuple[str, ...] = ()


Tell = Callable[[float, str], None]


def search(
    start: TrialModel,
    split: DataSplit,
    causes: tuple[str, ...],
    tell: Tell,
    executor: Executor | None = None,
    is_thorough: bool = False,
    is_once_more: bool = False,
) -> SearchResult:
    """Return the causes the data carry, from a model without effects.

    Args:
        start: fitted base.
        split: records.
        causes: names to try.
        tell: progress.
        executor: runs refits side by side where given.
        is_thorough: whether ten times the work is allowed.
        is_once_more: whether the records were searched before, readings of theirs not where they belong.
    """
    # Long: one loop of rounds, each question of a round in its order. Many arguments: what a diagnosis was asked.
    budget = WorkBudget.of(split, is_thorough, is_once_more=is_once_more)
    final = refit(start, split.train, n_iterations=2)
    state = SearchState(final.model, (), final, frozenset())
    for number in range(_MAX_ROUNDS):
        share = 0.15 + 0.8 * number / _MAX_ROUNDS
        tell(share, f"screening, {len(state.steps)} causes so far")
        split = with_noise_beside(split, state.final.residual)
        state, look = _refined(state, split, executor), None
        if state.steps and state.final.squared_error < AS_NOISE * split.noise_um2:
            # hardly more is to be found: a name that is sure is worth more, and is compared before the work is used up
            tell(share, "other causes in the place of those found")
            state, look = _looked_at(state, split, causes, executor, budget)
            if look is None:
                continue
        present, wanted, all_screened = _screened(state, split, causes, executor)
        screened = tuple(trial for trial in all_screened if trial.name in wanted)
        candidates: list[Candidate] = []
        chosen = None
        has_room = len(state.steps) < MAX_FINDINGS and budget.allows(CAUSES)
        if has_room:
            tell(share + 0.05, "refit of the likely causes")
            candidates, chosen = _asked(state, present, split, screened, causes, executor, budget)
            anew = _to_ask_anew(state, candidates, chosen, split, len(causes), executor)
            if anew is not None and number < _MAX_ROUNDS - 1:
                state = anew
                continue
        among = Round(state, candidates, split, wanted, len(causes), executor, budget, present, all_screened)
        if chosen is not None:
            chosen = or_pair(chosen, among)
        if chosen is None:
            if look is None:
                tell(share + 0.07, "other causes in the place of those found")
                state, look = _looked_at(state, split, causes, executor, budget)
            if look is None:
                continue
            # what is told beside a wrong name says little of pairs: it is put right first
            if has_room:
                chosen = any_pair(among)
            if chosen is None:
                runner_up = candidates[0] if candidates else None
                return SearchResult(state.model, look.steps, state.final, screened, runner_up, tuple(budget.left_out))
        n_before = len(state.steps)
        state, accepted = chosen
        tell(share + 0.1, f"found {accepted.cause}, joint refit")
        is_second = len(state.steps) > n_before
        state = with_finding(state, accepted, candidates, split, causes, executor, is_second)
        state = with_better_rival(state, split, causes, executor, budget, partial(tell, share + 0.12))
    state = without_wander(state, split, executor)
    look = _last_look(state, split, causes, executor, budget)
    return SearchResult(state.model, look.steps, state.final, screened, None, tuple(budget.left_out))


def _screened(
    state: SearchState, split: DataSplit, causes: tuple[str, ...], executor: Executor | None
) -> tuple[PresentModel, tuple[str, ...], tuple[Screened, ...]]:
    """Return the present model, the names that are asked for alone, and the screening of all that are absent."""
    present = PresentModel.of(state.model, split)
    wanted = tuple(name for name in causes if name not in state.tried)
    # what was given up alone may act together with another
    absent = tuple(name for name in causes if not state.model.has(name))
    return present, wanted, screen(present, absent, held_view(state.model, split), executor)


def _refined(state: SearchState, split: DataSplit, executor: Executor | None) -> SearchState:
    if state.final.squared_error < MUCH_LEFT * split.noise_um2:
        # where more is left other causes are hidden, to whose shapes plays of any threshold would bend
        return on_finer_grid(state, split, executor)
    return state


def _looked_at(
    state: SearchState, split: DataSplit, causes: tuple[str, ...], executor: Executor | None, budget: WorkBudget
) -> tuple[SearchState, LastLook | None]:
    """Return the state and how its causes compare, or one in which a cause has given way to another, and None."""
    state = without_wander(state, split, executor)
    look = _last_look(state, split, causes, executor, budget)
    if look.unshown is not None:
        return without_finding(state, state.steps[look.unshown], split, executor), None
    if look.better is None:
        return state, look
    at, rival = look.better
    # it was found beside all the others
    beside = (state.steps[:at], state.steps[at + 1 :])
    changed = with_rival(state, at, rival, beside, split, executor)
    if not _ends_worse(changed, state, split):
        return changed, None
    # the look ended at what is not to be exchanged, and compared no other
    return state, replace(look, steps=tuple(step.uncompared() for step in look.steps))


def _last_look(
    state: SearchState, split: DataSplit, causes: tuple[str, ...], executor: Executor | None, budget: WorkBudget
) -> LastLook:
    # In a loop that only repeats whatever did nearly as well is tied already.
    if not split.is_telling:
        return LastLook(state.steps, None)
    may_ask = partial(budget.allows, COMPARED)
    # what belongs to single records is followed in the held-out ones, too: else it would hide all else there
    final = replace(state.final, model=state.model)
    return looked_at_last(state.steps, final, split, causes, executor, may_ask=may_ask)


def _ends_worse(changed: SearchState, state: SearchState, split: DataSplit) -> bool:
    """Return whether an exchange, all that followed from it done, leaves surely more in training and more held out.

    What was found beside the one may go beside the other, and with it more than the exchange had gained.
    """
    if sure_gain(changed.final, state.final, split) <= SURE:
        return False
    held = held_out_score(held_residuals(state.model, split.held), held_residuals(changed.model, split.held))
    return held.log_gain < 0.0


def _asked(
    state: SearchState,
    present: PresentModel,
    split: DataSplit,
    screened: tuple[Screened, ...],
    causes: tuple[str, ...],
    executor: Executor | None,
    budget: WorkBudget,
) -> tuple[list[Candidate], tuple[SearchState, Candidate] | None]:
    """Return the candidates, and the one to accept with the state before it, None where there is none.

    What looks less likely beside the likeliest is asked where of those none is a finding, and at last, however unlikely
    it looks, what takes the place of creep: a law that leaves nothing of what the power law gets wrong may begin on a
    slope that mends none of it. What is quick is found beside something slow that nobody has found yet.
    """
    # Many arguments: one move of a search.
    candidates: list[Candidate] = []
    for tier_number in range(_MAX_TIERS + 1):
        is_last = tier_number == _MAX_TIERS
        by_cause = _in_place_of_creep(screened) if is_last else worth_a_refit(present, split, screened)
        tier = refitted(present, split, by_cause, executor)
        candidates = sorted((*candidates, *tier), key=lambda candidate: -candidate.total_gain)
        surest = sorted(tier, key=lambda candidate: not is_accepted(candidate, len(causes)))
        accepted = next((candidate for candidate in surest if is_finding(candidate, split, len(causes))), None)
        if accepted is not None:
            likeliest = likelier(accepted, candidates, split, len(causes))
            candidates = with_kin(likeliest, candidates, present, split, causes)
            # of two lags much alike the one that began far off may be the right one
            likeliest = likelier(likeliest, candidates, split, len(causes))
            chosen = simplest(likeliest, candidates, split, len(causes))
            chosen = events_in_place_of_plays(chosen, candidates, present, split, len(causes), executor)
            return candidates, (state, chosen)
        quick = found_beside_slow(tier, split, len(causes))
        if quick is not None:
            candidates = with_kin(quick, candidates, present, split, causes)
            return candidates, (state, found_beside_slow(candidates, split, len(causes)) or quick)
        asked = {trials[0].name for trials in by_cause}
        screened = tuple(trial for trial in screened if trial.name not in asked)
        if state.final.squared_error < MUCH_LEFT * split.noise_um2:
            break
        if not budget.allows(CAUSES):
            break
    return candidates, None


def _to_ask_anew(
    state: SearchState,
    candidates: list[Candidate],
    chosen: tuple[SearchState, Candidate] | None,
    split: DataSplit,
    n_causes: int,
    executor: Executor | None,
) -> SearchState | None:
    """Return another state to ask all in before anything is accepted, None where this one will do."""
    accepted = None if chosen is None else chosen[1]
    if accepted is not None and accepted.brings_plays:
        # its plays mend what a coarse grid gets wrong of any loop: those of the base are asked first
        finer = on_finer_grid(state, split, executor)
        if finer is not state:
            return finer
    return with_unseating(state, candidates, accepted, split, n_causes, executor)


def _in_place_of_creep(screened: tuple[Screened, ...]) -> list[list[Screened]]:
    """Return the trials of each cause that takes the place of the power law, the likeliest first."""
    names = {trial.name for trial in screened if cause_classes()[trial.name].replaces_creep}
    trials = sorted(screened, key=lambda trial: -trial.explained)
    return [[trial for trial in trials if trial.name == name] for name in sorted(names)]

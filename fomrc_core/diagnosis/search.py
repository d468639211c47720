"""The search for causes: screen, refit, accept on held-out data, re-test, stop."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fomrc_core.diagnosis.beside_slow import found_beside_slow
from fomrc_core.diagnosis.between_knees import repeats_between_knees
from fomrc_core.diagnosis.candidate import Candidate, held_view, refitted, worth_a_refit
from fomrc_core.diagnosis.data_split import MUCH_LEFT, DataSplit, held_residuals
from fomrc_core.diagnosis.decision import (
    is_accepted,
    is_finding,
    likelier,
    margin_of,
    rivals_of,
    simplest,
    still_tied,
    sure_gain,
    ties_of,
    whitened_margin_of,
)
from fomrc_core.diagnosis.events_or_plays import events_in_place_of_plays
from fomrc_core.diagnosis.finer_grid import on_finer_grid
from fomrc_core.diagnosis.held_out_score import SURE, held_out_score
from fomrc_core.diagnosis.kin import kin_left_out, with_kin
from fomrc_core.diagnosis.last_look import LastLook, looked_at_last
from fomrc_core.diagnosis.other_forms import in_best_form
from fomrc_core.diagnosis.pair_search import Round, any_pair, best_beside, or_pair
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.record_effects import follow_held, refollowed, sought_again
from fomrc_core.diagnosis.screening import Screened, screen
from fomrc_core.diagnosis.search_state import (
    AS_NOISE,
    PRUNED,
    SearchState,
    pruned,
    with_rival,
    without_finding,
    without_wander,
)
from fomrc_core.diagnosis.step import Step
from fomrc_core.diagnosis.unseated import with_unseating
from fomrc_core.diagnosis.with_the_start import comes_with_the_start
from fomrc_core.diagnosis.work_budget import CAUSES, COMPARED, PAIRS, WorkBudget
from fomrc_core.fitting.joint_fit import Refit, fit_until_still, refit
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
) -> SearchResult:
    """Return the causes the data carry, from a model without effects.

    Args:
        start: fitted base.
        split: records.
        causes: names to try.
        tell: progress.
        executor: runs refits side by side where given.
        is_thorough: whether ten times the work is allowed.
    """
    # Long: one loop of rounds, each question of a round in its order.
    budget = WorkBudget.of(split, is_thorough)
    final = refit(start, split.train, n_iterations=2)
    state = SearchState(final.model, (), final, frozenset())
    for number in range(_MAX_ROUNDS):
        share = 0.15 + 0.8 * number / _MAX_ROUNDS
        tell(share, f"screening, {len(state.steps)} causes so far")
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
        state, accepted = chosen
        tell(share + 0.1, f"found {accepted.cause}, joint refit")
        state = _with_finding(state, accepted, candidates, split, causes, executor)
        state = _with_better_rival(state, split, causes, executor, budget, partial(tell, share + 0.12))
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


def _with_finding(
    state: SearchState,
    accepted: Candidate,
    candidates: list[Candidate],
    split: DataSplit,
    causes: tuple[str, ...],
    executor: Executor | None,
) -> SearchState:
    """Return the state after an acceptance: fitted until still, every finding tested again."""
    tied = ties_of(accepted, candidates, split)
    rivals = rivals_of(accepted, candidates)
    if not split.is_telling:
        tied += [rival for rival in rivals if rival not in tied]
    compared = [*candidates, *kin_left_out(accepted, PresentModel.of(state.model, split), split, causes)]
    margins = margin_of(accepted, compared, split), whitened_margin_of(accepted, compared, split)
    is_second = bool(state.steps) and math.isnan(state.steps[-1].margin)
    if (is_second or not is_accepted(accepted, len(causes))) and cause_classes()[accepted.cause].is_exchangeable:
        # the second of a pair was not asked for beside the first, and what was found beside something slow was hidden
        # by it: the last look compares them
        margins = math.nan, math.nan
    step = Step(state.model, accepted, (), (), rivals, *margins).tied_with(tied)
    final = fit_until_still(_in_shortest_form(accepted.fitted.model), split.train, executor)
    # whether a loop needs plays of its own held-out data say, also where nothing else has been found
    may_bring_plays = any(e.name == accepted.cause and e.owns_columns for e in final.model.effects)
    in_form = in_best_form(final, split, executor) if state.steps or may_bring_plays else final
    if in_form is not final:
        # those it was compared with stood beside another form: the last look compares it anew
        final, step = in_form, step.uncompared()
    for name in sorted(_sought_again_beside(accepted, final.model, split)):
        final = sought_again(final, split, name, executor)
    found = SearchState(follow_held(final.model, split), (*state.steps, step), final, state.tried | {accepted.cause})
    is_of_plays = repeats_between_knees(found.model, split, accepted.cause)
    if is_of_plays or comes_with_the_start(found.model, split, accepted.cause):
        return replace(state, tried=found.tried)
    found = pruned(found, split, executor)
    if accepted.is_bound and found.steps and found.steps[-1].accepted is accepted:
        last = found.steps[-1].tied_with(still_tied(found.model, tied, split))
        found = replace(found, steps=(*found.steps[:-1], last))
    return found


def _in_shortest_form(model: TrialModel) -> TrialModel:
    """Return the model with each effect told the shorter way, where that says nearly the same."""
    for effect in model.effects:
        shorter = effect.in_shortest_form()
        if shorter is not effect:
            model = model.with_cause(shorter)
    return model


def _sought_again_beside(accepted: Candidate, model: TrialModel, split: DataSplit) -> set[str]:
    """Return the causes of single records to seek anew: one just found, and those with times a fit does not move.

    One just found in a single record a fit has moved since, but for such times, and where it ran away.
    """
    timed = {cause.name for at, cause in model.found() if at is not None and cause.has_own_times()}
    lengths_s = [float(np.ptp(record.time_s)) for record in split.train]
    astray = {c.name for at, c in model.found() if at is not None and at < len(lengths_s) and c.ran_away(lengths_s[at])}
    is_seen_anew = len(split.train) > 1 or bool(cause_classes()[accepted.cause].moved_times)
    return timed | astray | ({accepted.cause} if accepted.is_bound and is_seen_anew else set())


def _with_better_rival(
    state: SearchState,
    split: DataSplit,
    causes: tuple[str, ...],
    executor: Executor | None,
    budget: WorkBudget,
    say: Callable[[str], None],
) -> SearchState:
    """Return the state with a cause that does better in the place of a finding; as it is where none does."""
    better = _better_rival(state, split, causes, executor, budget)
    if better is None:
        return state
    at, rival = better
    say(f"{rival.cause} in place of {state.steps[at].accepted.cause}, joint refit")
    # one that was found since as well was fitted beside those before it alone
    behind = () if state.model.has(rival.cause) else state.steps[at + 1 :]
    return with_rival(state, at, rival, (state.steps[:at], behind), split, executor)


def _better_rival(
    state: SearchState, split: DataSplit, causes: tuple[str, ...], executor: Executor | None, budget: WorkBudget
) -> tuple[int, Candidate] | None:
    """Return the place of a finding, and the cause that does better in it beside all that was found since.

    Where a rival was found later itself, the finding may have stood in for a third cause: the rival goes first if the
    cause that is then found beside it does better than all that has been found.
    """
    if state.final.squared_error < AS_NOISE * split.noise_um2:
        return None  # nothing is left that another cause could explain
    for at, step in enumerate(state.steps[:-1]):
        name = step.accepted.cause
        near = {rival.cause for rival in step.rivals}
        # what holds another as a special case does as well wherever that one is right
        for rival in sorted(step.rivals, key=lambda rival: cause_classes()[rival.cause].generalizes in near):
            if not (cause_classes()[name].is_exchangeable and cause_classes()[rival.cause].is_exchangeable):
                continue
            if not state.model.has(name):
                continue
            if state.model.has(rival.cause):
                if not budget.allows(PAIRS):
                    continue
                second = best_beside(rival, split, causes, executor)
                if second is None or second.cause == name:
                    continue
                start = second.fitted.model
            else:
                effect = next(e for e in rival.fitted.model.effects if e.name == rival.cause)
                start = state.model.without(name).with_cause(effect)
            other = fit_until_still(start, split.train, executor)
            held_um = [held_residuals(m, split.held) for m in (state.model, refollowed(other.model, split))]
            held = held_out_score(*held_um)
            if sure_gain(state.final, other, split) > SURE and held.log_gain > PRUNED:
                return at, rival if state.model.has(rival.cause) else replace(rival, fitted=other)
    return None

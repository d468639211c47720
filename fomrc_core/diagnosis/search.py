"""The search for causes: screen, refit, accept on held-out data, re-test, stop."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace

from fomrc_core.diagnosis.candidate import Candidate, candidates_for, held_view, refitted, worth_a_refit
from fomrc_core.diagnosis.data_split import DataSplit, held_residuals, is_idle_held
from fomrc_core.diagnosis.decision import (
    SURE,
    is_accepted,
    likelier,
    margin_of,
    rivals_of,
    simplest,
    still_tied,
    sure_gain,
    ties_of,
    whitened_margin_of,
)
from fomrc_core.diagnosis.held_out_score import WORTHWHILE_LOG_GAIN, held_out_score
from fomrc_core.diagnosis.kin import with_kin
from fomrc_core.diagnosis.last_look import LastLook, looked_at_last
from fomrc_core.diagnosis.present_model import PresentModel, residual_inflation
from fomrc_core.diagnosis.record_effects import follow_held, sought_again
from fomrc_core.diagnosis.screening import Screened, screen
from fomrc_core.diagnosis.step import Step
from fomrc_core.diagnosis.wander import gain_beyond_wander
from fomrc_core.fitting.joint_fit import Refit, fit_until_still, refit
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes

MAX_FINDINGS = 5  # beside hysteresis and creep; each costs a round
_MAX_ROUNDS = MAX_FINDINGS + 2  # two in which a cause takes another's place
_LEAST_SIGMAS = 3.0  # standard errors of its main parameter from zero, else a finding is noise
_AS_NOISE = 1.1  # times the noise's power: about what a floor is known to
_MUCH_LEFT = 4.0  # times the noise's power, slow noise that no repeat shows among it
_SPEAKS_UP = 0.3  # in the logarithm of the mean squared error: a third more of it explained than by what was chosen
_MOST_FIRSTS = 2  # tried with a second beside them: each costs a round
_MAX_TIERS = 2  # of a round: each costs its refits
_PRUNED = 0.03  # logarithmic gain below which a finding has been taken over by those found since


@dataclass(frozen=True, eq=False)
class SearchResult:
    """What the search came to.

    Attributes:
        model: the final model.
        steps: acceptances that still stand, in order.
        final: the last joint refit.
        screened: the last screening, for the smallest detectable sizes.
        runner_up: best candidate that was not accepted in the last round, if any.
    """

    model: TrialModel
    steps: tuple[Step, ...]
    final: Refit
    screened: tuple[Screened, ...]
    runner_up: Candidate | None


Tell = Callable[[float, str], None]


def search(
    start: TrialModel, split: DataSplit, causes: tuple[str, ...], tell: Tell, executor: Executor | None = None
) -> SearchResult:
    """Return the causes the data carry, from a model without effects.

    Args:
        start: fitted base.
        split: records.
        causes: names to try.
        tell: progress.
        executor: runs refits side by side where given.
    """
    final = refit(start, split.train, n_iterations=2)
    state = _SearchState(final.model, (), final, frozenset())
    for number in range(_MAX_ROUNDS):
        share = 0.15 + 0.8 * number / _MAX_ROUNDS
        tell(share, f"screening, {len(state.steps)} causes so far")
        present = PresentModel.of(state.model, split)
        wanted = tuple(name for name in causes if name not in state.tried)
        screened = screen(present, wanted, held_view(state.model, split), executor)
        candidates: list[Candidate] = []
        chosen = None
        if len(state.steps) < MAX_FINDINGS:
            tell(share + 0.05, "refit of the likely causes")
            candidates, chosen = _asked(state, present, split, screened, causes, executor)
            if chosen is None:
                chosen = _any_pair(state, candidates, split, wanted, len(causes), executor)
            else:
                chosen = _or_pair(chosen, state, candidates, split, wanted, len(causes), executor)
        if chosen is None:
            tell(share + 0.07, "other causes in the place of those found")
            look = _last_look(state, split, causes, executor)
            if look.better is None or number == _MAX_ROUNDS - 1:
                runner_up = candidates[0] if candidates else None
                return SearchResult(state.model, look.steps, state.final, screened, runner_up)
            at, rival = look.better
            # it was found beside all the others
            beside = (state.steps[:at], state.steps[at + 1 :])
            state = _with_rival(state, at, rival, beside, split, executor)
            continue
        state, accepted = chosen
        tell(share + 0.1, f"found {accepted.cause}, joint refit")
        state = _with_finding(state, accepted, candidates, split, executor)
        better = _better_rival(state, split, causes, executor)
        if better is not None:
            at, rival = better
            tell(share + 0.12, f"{rival.cause} in place of {state.steps[at].accepted.cause}, joint refit")
            # it was found beside those before it
            state = _with_rival(state, at, rival, (state.steps[:at], ()), split, executor)
    look = _last_look(state, split, causes, executor)
    return SearchResult(state.model, look.steps, state.final, screened, None)


@dataclass(frozen=True, eq=False)
class _SearchState:
    """How far a search has come: the model, the acceptances that stand, the last joint refit, the names not to try."""

    model: TrialModel
    steps: tuple[Step, ...]
    final: Refit
    tried: frozenset[str]


def _last_look(state: _SearchState, split: DataSplit, causes: tuple[str, ...], executor: Executor | None) -> LastLook:
    # In a loop that only repeats whatever did nearly as well is tied already.
    if not split.is_telling:
        return LastLook(state.steps, None)
    # Where much is left nothing is explained, whoever does as well: there it is asked for a way on.
    is_much_left = state.final.squared_error > _MUCH_LEFT * split.noise_um**2 * split.n_used
    return looked_at_last(state.steps, state.final, split, causes, executor, is_hasty=is_much_left)


def _with_rival(
    state: _SearchState,
    at: int,
    rival: Candidate,
    beside: tuple[tuple[Step, ...], tuple[Step, ...]],
    split: DataSplit,
    executor: Executor | None,
) -> _SearchState:
    """Return the state with another cause in the place of one: with what was found since it does better.

    Args:
        state: the state so far.
        at: place of the one.
        rival: the other, fitted beside those before and behind it.
        beside: the acceptances before and behind it that its model has.
        split: records.
        executor: runs refits side by side where given.
    """
    steps = (*beside[0], Step(state.steps[at].before, rival, (), ()), *beside[1])
    final = fit_until_still(rival.fitted.model, split.train, executor)
    tried = frozenset(step.accepted.cause for step in steps)
    return _SearchState(follow_held(final.model, split), steps, final, tried)


def _asked(
    state: _SearchState,
    present: PresentModel,
    split: DataSplit,
    screened: tuple[Screened, ...],
    causes: tuple[str, ...],
    executor: Executor | None,
) -> tuple[list[Candidate], tuple[_SearchState, Candidate] | None]:
    """Return the candidates, and the one to accept with the state before it, None where there is none.

    What looks less likely beside the likeliest is asked where of those none is a finding.
    """
    # Many arguments: one move of a search.
    candidates: list[Candidate] = []
    for _ in range(_MAX_TIERS):
        by_cause = worth_a_refit(present, split, screened)
        tier = refitted(present, split, by_cause, executor)
        candidates = sorted((*candidates, *tier), key=lambda candidate: -candidate.total_gain)
        accepted = next((c for c in tier if is_accepted(c, len(causes)) and _is_no_wander(c, split)), None)
        if accepted is not None:
            likeliest = likelier(accepted, candidates, split, len(causes))
            candidates = with_kin(likeliest, candidates, present, split, causes)
            return candidates, (state, simplest(likeliest, candidates, split, len(causes)))
        asked = {trials[0].name for trials in by_cause}
        screened = tuple(trial for trial in screened if trial.name not in asked)
        if not asked or state.final.squared_error < _MUCH_LEFT * split.noise_um**2 * split.n_used:
            break
    return candidates, None


def _is_no_wander(candidate: Candidate, split: DataSplit) -> bool:
    return gain_beyond_wander(candidate.fitted.model, candidate.cause, split) > SURE


def _any_pair(
    state: _SearchState,
    candidates: list[Candidate],
    split: DataSplit,
    wanted: tuple[str, ...],
    n_causes: int,
    executor: Executor | None,
) -> tuple[_SearchState, Candidate] | None:
    """Return a second candidate to accept, and the state with a first, where no one alone does.

    The first is the likeliest, or one that explains much of the training data: where two causes act, one of them alone
    may do worse than none on held-out data, that show more of the other.
    """
    # Many arguments: one move of a search.
    told = [c for c in candidates[1:] if c.is_plausible and not c.is_bound and not c.brings_plays]
    told = [c for c in told if c.train_log_gain > _SPEAKS_UP]
    told = sorted(told, key=lambda candidate: -candidate.train_log_gain)[:_MOST_FIRSTS]
    for first in (*(c for c in candidates[:1] if c.score.log_gain >= -WORTHWHILE_LOG_GAIN), *told):
        pair = _with_pair(state, first, candidates, split, wanted, n_causes, executor)
        if pair is not None:
            return pair
    return None


def _with_pair(
    state: _SearchState,
    first: Candidate,
    candidates: list[Candidate],
    split: DataSplit,
    wanted: tuple[str, ...],
    n_causes: int,
    executor: Executor | None,
) -> tuple[_SearchState, Candidate] | None:
    """Return a second candidate to accept, and the state with the first of the pair, where one alone does not do."""
    # Many arguments: one move of a search.
    pair = _second_of_pair(state.model, first, split, wanted, executor)
    if pair is None or not is_accepted(pair[1], n_causes) or not _is_no_wander(pair[1], split):
        return None
    first, second = pair
    steps = (*state.steps, Step(state.model, replace(first, score=second.score), (), ()))
    state = replace(state, model=first.fitted.model, steps=steps, tried=state.tried | {first.cause})
    return state, likelier(second, candidates, split, n_causes)


def _or_pair(
    chosen: tuple[_SearchState, Candidate],
    state: _SearchState,
    candidates: list[Candidate],
    split: DataSplit,
    wanted: tuple[str, ...],
    n_causes: int,
    executor: Executor | None,
) -> tuple[_SearchState, Candidate]:
    """Return what was chosen, or a pair that does better in training and on held-out data.

    Where training data surely speak for another cause than held-out data do neither is the whole: each may stand in
    there for what the other record shows of two.
    """
    # Many arguments: one move of a search.
    accepted = chosen[1]
    told = [c for c in candidates if not c.is_bound and c.is_plausible]
    told = [c for c in told if c.train_log_gain > accepted.train_log_gain + _SPEAKS_UP]
    # beside one that does, one that does worse than none held out has nothing to say
    told = [c for c in told if c.score.log_gain >= -WORTHWHILE_LOG_GAIN]
    for first in sorted(told, key=lambda candidate: -candidate.train_log_gain)[:_MOST_FIRSTS]:
        pair = _with_pair(state, first, candidates, split, wanted, n_causes, executor)
        if pair is None or pair[1].score.log_gain < accepted.score.log_gain:
            continue
        # two explain more than one whichever they are: what was chosen gets a second as well
        own = _with_pair(state, accepted, candidates, split, wanted, n_causes, executor)
        errors = [accepted.fitted.squared_error, *([] if own is None else [own[1].fitted.squared_error])]
        if pair[1].fitted.squared_error < min(errors):
            return pair
    return chosen


def _with_finding(
    state: _SearchState,
    accepted: Candidate,
    candidates: list[Candidate],
    split: DataSplit,
    executor: Executor | None,
) -> _SearchState:
    """Return the state after an acceptance: fitted until still, every finding tested again."""
    tied = ties_of(accepted, candidates, split)
    rivals = rivals_of(accepted, candidates)
    if not split.is_telling:
        tied += [rival for rival in rivals if rival not in tied]
    margins = margin_of(accepted, candidates, split), whitened_margin_of(accepted, candidates, split)
    step = Step(state.model, accepted, (), (), rivals, *margins).tied_with(tied)
    final = fit_until_still(accepted.fitted.model, split.train, executor)
    if accepted.is_bound:
        final = sought_again(final, split, accepted.cause, executor)
    found = _SearchState(follow_held(final.model, split), (*state.steps, step), final, state.tried | {accepted.cause})
    found = _pruned(found, split, executor)
    if accepted.is_bound and found.steps and found.steps[-1].accepted is accepted:
        last = found.steps[-1].tied_with(still_tied(found.model, tied, split))
        found = replace(found, steps=(*found.steps[:-1], last))
    return found


def _better_rival(
    state: _SearchState, split: DataSplit, causes: tuple[str, ...], executor: Executor | None
) -> tuple[int, Candidate] | None:
    """Return the place of a finding, and the cause that does better in it beside all that was found since.

    Where a rival was found later itself, the finding may have stood in for a third cause: the rival goes first if the
    cause that is then found beside it does better than all that has been found.
    """
    if state.final.squared_error < _AS_NOISE * split.noise_um**2 * split.n_used:
        return None  # nothing is left that another cause could explain
    for at, step in enumerate(state.steps[:-1]):
        name = step.accepted.cause
        for rival in step.rivals:
            if not (cause_classes()[name].is_exchangeable and cause_classes()[rival.cause].is_exchangeable):
                continue
            if not state.model.has(name):
                continue
            if state.model.has(rival.cause):
                second = _best_beside(rival, split, causes, executor)
                if second is None or second.cause == name:
                    continue
                start = second.fitted.model
            else:
                effect = next(e for e in rival.fitted.model.effects if e.name == rival.cause)
                start = state.model.without(name).with_cause(effect)
            other = fit_until_still(start, split.train, executor)
            held = held_out_score(held_residuals(state.model, split.held), held_residuals(other.model, split.held))
            if sure_gain(state.final, other, split) > SURE and held.log_gain > _PRUNED:
                return at, rival
    return None


def _second_of_pair(
    model: TrialModel, first: Candidate, split: DataSplit, causes: tuple[str, ...], executor: Executor | None
) -> tuple[Candidate, Candidate] | None:
    """Return a first candidate and a second one that together gain on held-out data, where one alone does not."""
    if first.train_log_gain < WORTHWHILE_LOG_GAIN:
        return None
    second = _best_beside(first, split, causes, executor)
    if second is None:
        return None
    before = held_residuals(model, split.held)
    after = held_residuals(second.fitted.model, split.held)
    return first, replace(second, score=held_out_score(before, after))


def _best_beside(
    first: Candidate, split: DataSplit, causes: tuple[str, ...], executor: Executor | None
) -> Candidate | None:
    """Return the candidate that gains most beside a first one."""
    present = PresentModel.of(first.fitted.model, split)
    wanted = tuple(name for name in causes if name != first.cause)
    screened = screen(present, wanted, held_view(present.model, split), executor)
    return next(iter(candidates_for(present, split, screened, executor)), None)


def _pruned(state: _SearchState, split: DataSplit, executor: Executor | None) -> _SearchState:
    """Return what stands after every cause has been tested again; the last must have taught something as well.

    One that goes may have been all that another was needed beside, so that those that are left are tested once more.
    """
    given = state.steps
    for step in given:
        name = step.accepted.cause
        is_last = step is given[-1]
        if not state.model.has(name):
            continue
        lesser = refit(state.model.without(name), split.train, n_iterations=6, executor=executor)
        train_gain = math.log(lesser.squared_error / state.final.squared_error)
        score = held_out_score(held_residuals(lesser.model, split.held), held_residuals(state.model, split.held))
        is_kept = score.log_gain >= _PRUNED or (is_last and score.is_worthwhile())
        is_of_records = any(at is not None and cause.name == name for at, cause in state.model.found())
        if is_kept:
            continue
        is_asked_of_training = is_of_records or is_last or is_idle_held(state.model, name, split)
        if train_gain < _PRUNED or not is_asked_of_training:
            state = _without_step(state, step, lesser.model, split, executor)
    errors = state.final.standard_errors(split.train, residual_inflation(state.final.residual, split.train))
    for step in state.steps:
        name = step.accepted.cause
        ratios = []
        for p in state.final.free:
            if p.cause == name and p.spec.name == cause_classes()[name].main_parameter and not p.spec.is_log:
                error = errors.get((p.cause, p.index, p.spec.name), 0.0)
                ratios.append(abs(p.get(state.model)) / error if error > 0.0 else math.inf)
        # where much is still unexplained its correlation widens every standard error: a sure held-out gain stands
        if ratios and max(ratios) < _LEAST_SIGMAS and step.accepted.score.log_gain < WORTHWHILE_LOG_GAIN:
            state = _without_step(state, step, state.model.without(name), split, executor)
    return state if not state.steps or len(state.steps) == len(given) else _pruned(state, split, executor)


def _without_step(
    state: _SearchState, step: Step, lesser: TrialModel, split: DataSplit, executor: Executor | None
) -> _SearchState:
    """Return the state without an acceptance, the lesser model fitted until still."""
    final = fit_until_still(lesser, split.train, executor)
    steps = tuple(kept for kept in state.steps if kept is not step)
    return replace(state, model=follow_held(final.model, split), steps=steps, final=final)

"""How far a search has come, and what of it still stands."""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import dataclass, replace

from fomrc_core.diagnosis.acceptance import is_foreseen_apart
from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import DataSplit, held_residuals, is_idle_held
from fomrc_core.diagnosis.held_out_score import WORTHWHILE_LOG_GAIN, held_out_score
from fomrc_core.diagnosis.other_forms import in_best_form
from fomrc_core.diagnosis.present_model import residual_inflation
from fomrc_core.diagnosis.record_effects import follow_held, refollowed, sought_again
from fomrc_core.diagnosis.step import Step
from fomrc_core.diagnosis.wander import gain_beyond_wander
from fomrc_core.fitting.joint_fit import Refit, fit_until_still
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes

_LEAST_SIGMAS = 3.0  # standard errors of its main parameter from zero, else a finding is noise
AS_NOISE = 1.1  # times the noise's power: about what a floor is known to
# In log likelihood beyond noise that wanders: a few directions that follow noise gain as much once in twenty times.
_BY_CHANCE = 3.0
PRUNED = 0.03  # logarithmic gain below which a finding has been taken over by those found since


@dataclass(frozen=True, eq=False)
class SearchState:
    """How far a search has come: the model, the acceptances that stand, the last joint refit, the names not to try."""

    model: TrialModel
    steps: tuple[Step, ...]
    final: Refit
    tried: frozenset[str]


def with_rival(
    state: SearchState,
    at: int,
    rival: Candidate,
    beside: tuple[tuple[Step, ...], tuple[Step, ...]],
    split: DataSplit,
    executor: Executor | None,
) -> SearchState:
    """Return the state with another cause in the place of one: with what was found since it does better.

    What was found since may have mended what the one got wrong: every finding is tested again beside the other.

    Args:
        state: the state so far.
        at: place of the one.
        rival: the other, fitted beside those before and behind it.
        beside: the acceptances before and behind it that its model has.
        split: records.
        executor: runs refits side by side where given.
    """
    # what stands behind was likelier than others beside the one that goes: that says nothing beside the other
    behind = (step if step.accepted.is_bound else step.uncompared() for step in beside[1])
    steps = (*beside[0], Step(state.steps[at].before, rival, (), ()), *behind)
    final = in_best_form(fit_until_still(rival.fitted.model, split.train, executor), split, executor)
    for name in sorted({cause.name for at, cause in final.model.found() if at is not None}):
        # they were found beside what stood there before
        final = sought_again(final, split, name, executor)
    tried = frozenset(step.accepted.cause for step in steps)
    return pruned(SearchState(follow_held(final.model, split), steps, final, tried), split, executor)


def pruned(state: SearchState, split: DataSplit, executor: Executor | None) -> SearchState:
    """Return what stands after every cause has been tested again; the last must have taught something as well.

    One that goes may have been all that another was needed beside, so that those that are left are tested once more.
    """
    given = state.steps
    for step in given:
        name = step.accepted.cause
        is_last = step is given[-1]
        if not state.model.has(name):
            continue
        lesser = step.left_out_of(state.model, split, executor)
        train_gain = math.log(lesser.squared_error / state.final.squared_error)
        # what a load made up for in the held-out record while this cause was there it need not without it
        alone = refollowed(lesser.model, split)
        score = held_out_score(held_residuals(alone, split.held), held_residuals(state.model, split.held))
        is_kept = score.log_gain >= PRUNED or (is_last and score.is_worthwhile())
        is_of_records = any(at is not None and cause.name == name for at, cause in state.model.found())
        if is_kept:
            continue
        is_asked_of_training = is_of_records or is_last or is_idle_held(state.model, name, split)
        if train_gain < PRUNED or not is_asked_of_training:
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
            lesser_model = state.model.as_before(step.before, name)
            state = _without_step(state, step, lesser_model, split, executor)
    return state if not state.steps or len(state.steps) == len(given) else pruned(state, split, executor)


def without_wander(state: SearchState, split: DataSplit, executor: Executor | None) -> SearchState:
    """Return what is left of a state when what only follows noise that wanders is taken out.

    While other causes are hidden a drift is accepted for what it follows of them. Beside all that was found since it is
    asked again, as it was then, whether noise that wanders would do the same, which foresees nothing of another record.
    """
    for step in state.steps:
        name = step.accepted.cause
        if len(state.steps) == 1 or not state.model.has(name) or not cause_classes()[name].is_exchangeable:
            continue
        if gain_beyond_wander(state.final.model, name, split) < _BY_CHANCE:
            lesser = step.left_out_of(state.model, split, executor)
            fewer = _without_step(state, step, lesser.model, split, executor)
            score = held_out_score(held_residuals(fewer.model, split.held), held_residuals(state.model, split.held))
            if not is_foreseen_apart(replace(step.accepted, score=score), split):
                state = fewer
    return state


def without_finding(state: SearchState, step: Step, split: DataSplit, executor: Executor | None) -> SearchState:
    """Return the state without an acceptance, all others staying and tested again."""
    lesser = step.left_out_of(state.model, split, executor).model
    return pruned(_without_step(state, step, lesser, split, executor), split, executor)


def _without_step(
    state: SearchState, step: Step, lesser: TrialModel, split: DataSplit, executor: Executor | None
) -> SearchState:
    """Return the state without an acceptance, the lesser model fitted until still."""
    final = fit_until_still(lesser, split.train, executor)
    steps = tuple(kept for kept in state.steps if kept is not step)
    return replace(state, model=follow_held(final.model, split), steps=steps, final=final)

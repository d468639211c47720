"""Whether a near rival of what was found earlier does better beside all that was found since."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace

from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import DataSplit, held_residuals
from fomrc_core.diagnosis.decision import sure_gain
from fomrc_core.diagnosis.held_out_score import SURE, held_out_score
from fomrc_core.diagnosis.pair_search import best_beside
from fomrc_core.diagnosis.record_effects import refollowed
from fomrc_core.diagnosis.search_state import AS_NOISE, PRUNED, SearchState, with_rival
from fomrc_core.diagnosis.work_budget import PAIRS, WorkBudget
from fomrc_core.fitting.joint_fit import fit_until_still
from fomrc_core.model.causes import cause_classes


def with_better_rival(
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

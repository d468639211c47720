"""A search after an acceptance: all fitted until still, in the form that held-out data ask for, and tested again."""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from fomrc_core.diagnosis.acceptance import is_accepted
from fomrc_core.diagnosis.between_knees import repeats_between_knees
from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.decision import margin_of, rivals_of, still_tied, ties_of, whitened_margin_of
from fomrc_core.diagnosis.kin import kin_left_out
from fomrc_core.diagnosis.kin_exchanged import with_kin_exchanged
from fomrc_core.diagnosis.other_forms import in_best_form
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.record_effects import follow_held, sought_again
from fomrc_core.diagnosis.search_state import SearchState, pruned
from fomrc_core.diagnosis.step import Step
from fomrc_core.diagnosis.with_the_start import comes_with_the_start
from fomrc_core.fitting.joint_fit import fit_until_still
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes


def with_finding(
    state: SearchState,
    accepted: Candidate,
    candidates: list[Candidate],
    split: DataSplit,
    causes: tuple[str, ...],
    executor: Executor | None,
    is_second: bool = False,
) -> SearchState:
    """Return the state after an acceptance: fitted until still, every finding tested again.

    Args:
        state: before it; with the first of a pair where the second is accepted.
        accepted: the candidate.
        candidates: those it is compared with.
        split: records.
        causes: names to try.
        executor: runs refits side by side where given.
        is_second: whether it is the second of a pair, and was not asked for beside the first.
    """
    # Many arguments: one move of a search, and whether it is half of one.
    tied = ties_of(accepted, candidates, split)
    rivals = rivals_of(accepted, candidates)
    if not split.is_telling:
        tied += [rival for rival in rivals if rival not in tied]
    compared = [*candidates, *kin_left_out(accepted, PresentModel.of(state.model, split), split, causes)]
    margins = margin_of(accepted, compared, split), whitened_margin_of(accepted, compared, split)
    if (is_second or not is_accepted(accepted, len(causes))) and cause_classes()[accepted.cause].is_exchangeable:
        # those it was chosen from stood beside other causes, or something slow hid it: the last look compares it
        margins = math.nan, math.nan
    step = Step(state.model, accepted, (), (), rivals, *margins).tied_with(tied)
    final = fit_until_still(_in_shortest_form(accepted.fitted.model), split.train, executor)
    # whether a loop needs plays of its own held-out data say, also where nothing else has been found
    may_bring_plays = any(e.name == accepted.cause and e.owns_columns for e in final.model.effects)
    in_form = in_best_form(final, split, executor) if state.steps or may_bring_plays else final
    in_form = with_kin_exchanged(in_form, split, executor)
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

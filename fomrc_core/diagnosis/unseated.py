"""A cause that another refutes: beside that one it comes to what no record can show.

While a cause is hidden another stands in for a part of it, and its parameters look like those of something real. Beside
the hidden one they go where the data send them, a mass that would ring faster than two samples show, and what was said
of them before rests on nothing. Then it is the older name that is wrong, and the younger must not be refused for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace

from fomrc_core.diagnosis.acceptance import is_accepted, is_finding
from fomrc_core.diagnosis.candidate import Candidate, candidate_of
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.decision import sure_gain, ties_of
from fomrc_core.diagnosis.held_out_score import SURE
from fomrc_core.diagnosis.other_forms import in_best_form
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.search_state import SearchState, with_rival
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.joint_fit import fit_until_still, refit
from fomrc_core.model.causes import cause_classes


def with_unseating(
    state: SearchState,
    candidates: Sequence[Candidate],
    accepted: Candidate | None,
    split: DataSplit,
    n_causes: int,
    executor: Executor | None,
) -> SearchState | None:
    """Return the state with a cause in place of what it refutes, None where none refutes any.

    What the refuted cause did is asked anew in the next round. The younger one must be a finding but for what it
    refutes, and surely better than whatever is a finding without that, or as good with fewer parameters.

    Args:
        state: how far the search has come.
        candidates: of this round.
        accepted: what was chosen of them, None where nothing was.
        split: records.
        n_causes: number of causes the search tries.
        executor: simulates side by side where given.
    """
    for other in sorted(candidates, key=lambda candidate: -candidate.total_gain):
        found = [at for at, step in enumerate(state.steps) if step.accepted.cause in other.unseats]
        if other.is_bound or not found or len(found) < len(other.unseats):
            continue
        if not all(cause_classes()[name].is_exchangeable for name in other.unseats):
            continue
        possible = replace(other, is_plausible=True)
        if not is_accepted(possible, 1) or (accepted is not None and not _is_better(possible, accepted, split)):
            continue
        rival = _without_refuted(state, other, found, split, executor)
        if rival is None or not is_finding(rival, split, n_causes):
            continue
        if sure_gain(state.final, rival.fitted, split) < SURE:
            continue
        kept = [(at, step) for at, step in enumerate(state.steps) if at not in found]
        beside = (
            tuple(step for at, step in kept if at < found[0]),
            tuple(step for at, step in kept if at > found[0]),
        )
        changed = with_rival(state, found[0], rival, beside, split, executor)
        if changed.model.has(other.cause):
            return changed
    return None


def _is_better(other: Candidate, accepted: Candidate, split: DataSplit) -> bool:
    """Return whether one that refutes others is surely better than one that does not, or as good where they are gone.

    With them go their parameters.
    """
    if sure_gain(accepted.fitted, other.fitted, split) > SURE:
        return other.held_gain > accepted.held_gain
    return other.n_free <= accepted.n_free and bool(ties_of(accepted, [other], split))


def _without_refuted(
    state: SearchState, other: Candidate, found: list[int], split: DataSplit, executor: Executor | None
) -> Candidate | None:
    """Return a cause as a candidate without those of these places, beside all others; None where nothing simulates it.

    What it refutes could do in other ways what it does, and says nothing of it.
    """
    model = other.fitted.model
    for at in found:
        model = model.as_before(state.steps[at].before, state.steps[at].accepted.cause)
    final = in_best_form(fit_until_still(model, split.train, executor), split, executor)
    lesser = refit(final.model.as_before(state.steps[found[0]].before, other.cause), split.train, executor=executor)
    try:
        return candidate_of(PresentModel.of(lesser.model, split), split, other.cause, final, other.is_bound)
    except ParameterError:
        return None

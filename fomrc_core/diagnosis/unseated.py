"""A cause that another refutes: beside that one it comes to what no record can show.

While a cause is hidden another stands in for a part of it, and its parameters look like those of something real. Beside
the hidden one they go where the data send them, a mass that would ring faster than two samples show, and what was said
of them before rests on nothing. Then it is the older name that is wrong, and the younger must not be refused for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace

from fomrc_core.diagnosis.candidate import Candidate, candidate_of
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.decision import is_finding, sure_gain
from fomrc_core.diagnosis.held_out_score import SURE
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.search_state import SearchState, with_rival
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.joint_fit import fit_until_still
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
    refutes, and surely better than whatever is a finding without that.

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
        if accepted is not None and not _is_surely_better(other, accepted, split):
            continue
        if not is_finding(replace(other, is_plausible=True), split, n_causes):
            continue
        changed = _in_place(state, other, found, split, executor)
        if changed is not None and changed.model.has(other.cause):
            return changed
    return None


def _is_surely_better(other: Candidate, accepted: Candidate, split: DataSplit) -> bool:
    is_likelier = sure_gain(accepted.fitted, other.fitted, split) > SURE
    return is_likelier and other.held_gain > accepted.held_gain


def _in_place(
    state: SearchState, other: Candidate, found: list[int], split: DataSplit, executor: Executor | None
) -> SearchState | None:
    """Return the state with another cause in the first of these places, and the others empty."""
    fewer = other.fitted.model
    for at in found:
        fewer = fewer.as_before(state.steps[at].before, state.steps[at].accepted.cause)
    final = fit_until_still(fewer, split.train, executor)
    before = PresentModel.of(state.steps[found[0]].before, split)
    try:
        rival = candidate_of(before, split, other.cause, final, other.is_bound)
    except ParameterError:
        return None
    kept = [(at, step) for at, step in enumerate(state.steps) if at not in found]
    beside = (
        tuple(step for at, step in kept if at < found[0]),
        tuple(step for at, step in kept if at > found[0]),
    )
    return with_rival(state, found[0], rival, beside, split, executor)

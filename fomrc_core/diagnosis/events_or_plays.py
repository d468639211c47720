"""Whether what bends to much only bends to what befell records: one past before each of them, or a load in each.

One-sided plays begin relaxed, as the record does not, and whoever measures does the same before each record: plays that
were learned from one past foresee the other. Few parameters that leave as little say it without them.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor

from fomrc_core.diagnosis.acceptance import HARDLY, is_accepted, is_finding
from fomrc_core.diagnosis.candidate import Candidate, candidate_of
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.decision import is_likelier_with_fewer
from fomrc_core.diagnosis.pair_search import score_of_pair
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.record_effects import sought_again
from fomrc_core.errors import ParameterError


def events_in_place_of_plays(
    winner: Candidate,
    candidates: Sequence[Candidate],
    present: PresentModel,
    split: DataSplit,
    n_causes: int,
    executor: Executor | None,
) -> Candidate:
    """Return what befell records in the place of a cause with plays of its own, where it does as well with fewer.

    In training each parameter and weight costs what it gains by itself; in the held-out record, whose own past or load
    is fitted to some of its blocks, the others must be left as little.

    Args:
        winner: what would be accepted.
        candidates: all there are.
        present: the model before it.
        split: records.
        n_causes: number of causes the search tries.
        executor: runs refits side by side where given.
    """
    if not winner.brings_plays or not split.is_apart:
        return winner
    for other in candidates:
        if not other.is_bound or not is_accepted(other, n_causes):
            continue
        fitted = sought_again(other.fitted, split, other.cause, executor)
        try:
            event = candidate_of(present, split, other.cause, fitted, bound=True)
        except ParameterError:
            continue
        if not is_likelier_with_fewer(event, winner, split) or not is_finding(event, split, n_causes):
            continue
        if score_of_pair(winner.fitted.model, fitted.model, split).log_gain > -HARDLY:
            return event
    return winner

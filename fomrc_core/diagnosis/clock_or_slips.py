"""Whether samples were lost or doubled, or two clocks do not agree, by which readings come to be late by samples too.

Lags that are taken from readings tell the two apart where the drive is followed; where it jumps nobody read what was
between. So the clocks' disagreement is fitted as what it is, to the records as they were read.
"""

from __future__ import annotations

from concurrent.futures import Executor

from fomrc_core.diagnosis.candidate import refitted
from fomrc_core.diagnosis.prepared import Prepared
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import screen
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes

CLOCKS = tuple(name for name, kind in cause_classes().items() if kind.is_of_clock)


def moved_by_clock(
    moved: Prepared, given: Prepared, before: TrialModel, after: TrialModel, executor: Executor | None
) -> frozenset[int]:
    """Return the records, by their numbers, of which a disagreement of clocks leaves as little as moved readings do.

    Of what was wrong with records it matters not which names are asked for.

    Args:
        moved: records with readings moved where samples seem to be lost or doubled.
        given: the records as they were.
        before: of these, with no such cause.
        after: of the moved ones.
        executor: screens and refits side by side where given.
    """
    if not moved.moved:
        return frozenset()
    present = PresentModel.of(before, given.split)
    trials = screen(present, CLOCKS, executor=executor)
    by_cause = [[trial for trial in trials if trial.name == name] for name in CLOCKS]
    explained: frozenset[int] = frozenset()
    for candidate in refitted(present, given.split, [own for own in by_cause if own], executor):
        explained |= moved.explained_moves(given, candidate.fitted.model, after)
    return explained

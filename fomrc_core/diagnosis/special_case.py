"""A cause that holds a simpler one as a special case, and the simpler one begun where the other has come to."""

from __future__ import annotations

from collections.abc import Sequence

from fomrc_core.diagnosis.candidate import Candidate, candidate_of
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.effects import Effect
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.model.causes import cause_classes


def with_special_case(
    winner: Candidate, candidates: list[Candidate], present: PresentModel, split: DataSplit, causes: Sequence[str]
) -> list[Candidate]:
    """Return the candidates, the special case of the winner begun where that has come to as well.

    From its own trials a lag of many samples may come to rest far from there.

    Args:
        winner: the likeliest.
        candidates: all there are.
        present: the present model.
        split: records.
        causes: names that are asked for: a special case that is not is none.
    """
    effect = next((e for e in winner.fitted.model.effects if e.name == winner.cause), None)
    special = effect.special_case() if effect is not None else {}
    if effect is None or not special or effect.generalizes not in causes or present.model.has(effect.generalizes):
        return candidates
    begun = [kind for kind in cause_classes()[effect.generalizes].proposed([special]) if isinstance(kind, Effect)]
    if not begun:
        return candidates
    fitted = refit(winner.fitted.model.without(winner.cause).with_cause(begun[0]), split.train)
    known = next((c for c in candidates if c.cause == effect.generalizes), None)
    if known is not None and known.fitted.squared_error <= fitted.squared_error:
        return candidates
    own = candidate_of(present, split, effect.generalizes, fitted, bound=False)
    return sorted([*(c for c in candidates if c is not known), own], key=lambda candidate: -candidate.total_gain)

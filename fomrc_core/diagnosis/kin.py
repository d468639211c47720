"""Causes akin to the likeliest one, begun where that has come to: a special case that it holds, or much the same."""

from __future__ import annotations

from collections.abc import Sequence

from fomrc_core.diagnosis.candidate import Candidate, candidate_of
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.effects import Effect
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.model.causes import cause_classes


def with_kin(
    winner: Candidate, candidates: list[Candidate], present: PresentModel, split: DataSplit, causes: Sequence[str]
) -> list[Candidate]:
    """Return the candidates, the kin of the winner begun where that has come to as well.

    From its own trials a lag of many samples may come to rest far from there.

    Args:
        winner: the likeliest.
        candidates: all there are.
        present: the present model.
        split: records.
        causes: names that are asked for: kin that is not is none.
    """
    effect = next((e for e in winner.fitted.model.effects if e.name == winner.cause), None)
    if effect is None:
        return candidates
    lesser = winner.fitted.model.as_before(present.model, winner.cause)
    for name, parameters in effect.kin().items():
        if name not in causes or present.model.has(name):
            continue
        begun = [kind for kind in cause_classes()[name].proposed([parameters]) if isinstance(kind, Effect)]
        if not begun:
            continue
        fitted = refit(lesser.with_cause(begun[0]), split.train)
        known = next((c for c in candidates if c.cause == name), None)
        if known is not None and known.fitted.squared_error <= fitted.squared_error:
            continue
        own = candidate_of(present, split, name, fitted, bound=False)
        candidates = sorted(
            [*(c for c in candidates if c is not known), own], key=lambda candidate: -candidate.total_gain
        )
    return candidates

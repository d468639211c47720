"""Causes akin to the likeliest one, begun where that has come to: a special case that it holds, or much the same."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

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
    for name, parameters in _kin_of(winner).items():
        if name not in causes:
            continue
        own = _begun_where_it_is(winner, name, parameters, present, split)
        known = next((c for c in candidates if c.cause == name), None)
        # of two forms that leave alike in training held-out data know which is right
        if own is None or (known is not None and known.total_gain >= own.total_gain):
            continue
        candidates = sorted(
            [*(c for c in candidates if c is not known), own], key=lambda candidate: -candidate.total_gain
        )
    return candidates


def kin_left_out(
    winner: Candidate, present: PresentModel, split: DataSplit, causes: Sequence[str]
) -> tuple[Candidate, ...]:
    """Return the kin of a winner that was not asked for, each fitted from where the winner has come to.

    A cause is taken out of a search because it cannot act there, or in error: it is never found, but what does no
    better than it is no sure answer either.

    Args:
        winner: the cause that is found.
        present: the model before it.
        split: records.
        causes: names that are asked for.
    """
    begun = (
        _begun_where_it_is(winner, name, parameters, present, split)
        for name, parameters in _kin_of(winner).items()
        if name not in causes
    )
    return tuple(own for own in begun if own is not None)


def effect_of(name: str, parameters: Mapping[str, float]) -> Effect | None:
    """Return the effect of that name with the parameters that its kin says; None where there can be none."""
    begun = (kind for kind in cause_classes()[name].proposed([parameters]) if isinstance(kind, Effect))
    return next(begun, None)


def _kin_of(winner: Candidate) -> Mapping[str, Mapping[str, float]]:
    effect = next((e for e in winner.fitted.model.actuator_effects() if e.name == winner.cause), None)
    return {} if effect is None else effect.kin()


def _begun_where_it_is(
    winner: Candidate, name: str, parameters: Mapping[str, float], present: PresentModel, split: DataSplit
) -> Candidate | None:
    """Return the cause of that name, fitted from those parameters in the place of the winner; None where it cannot."""
    if present.model.has(name):
        return None
    begun = effect_of(name, parameters)
    if begun is None:
        return None
    lesser = winner.fitted.model.as_before(present.model, winner.cause)
    return candidate_of(present, split, name, refit(lesser.with_cause(begun), split.train), bound=False)

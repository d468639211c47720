"""The last look at a search: beside all that was found since, is there a cause that does as well as one found early?

A cause is accepted while others are still hidden, and what those hide of one candidate they need not hide of another.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.acceptance import HARDLY, NEARLY, is_accepted
from fomrc_core.diagnosis.candidate import Candidate, candidate_of, candidates_for
from fomrc_core.diagnosis.data_split import DataSplit, held_residuals
from fomrc_core.diagnosis.decision import (
    explains_events,
    is_likelier_than,
    is_surely_better,
    margin_of,
    simplest,
    sure_gain,
    ties_of,
    whitened_margin_of,
)
from fomrc_core.diagnosis.held_out_score import SURE, held_out_score
from fomrc_core.diagnosis.kin import kin_left_out, with_kin
from fomrc_core.diagnosis.pair_search import SPEAKS_UP, best_beside, score_of_pair
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import held_view, screen
from fomrc_core.diagnosis.search_state import AS_NOISE
from fomrc_core.diagnosis.step import Step
from fomrc_core.fitting.joint_fit import Refit, refit
from fomrc_core.model.causes import cause_classes

# In the logarithm of the mean squared error on held-out data: less is no difference from one stretch to another.
_BETTER = 0.03


@dataclass(frozen=True, eq=False)
class LastLook:
    """What came of it.

    Attributes:
        steps: the acceptances, each that was looked at with the causes that do as well in its place.
        better: place of an acceptance and the candidate to take it, None where there is none: one that surely does
            better, alone or with a second, or does as well with fewer parameters.
        unshown: place of an acceptance that no record shows any more as what it is called; None where there is none.
    """

    steps: tuple[Step, ...]
    better: tuple[int, Candidate] | None
    unshown: int | None = None


def looked_at_last(
    steps: Sequence[Step],
    final: Refit,
    split: DataSplit,
    causes: Sequence[str],
    executor: Executor | None,
    may_ask: Callable[[], bool] = lambda: True,
) -> LastLook:
    """Return the acceptances beside those that might stand in their places at the end.

    The last was accepted beside all the others, so that it is asked only where it took another's place.

    Args:
        steps: acceptances that stand, in order.
        final: the last joint refit, with all of them.
        split: records.
        causes: names to try.
        executor: runs refits side by side where given.
        may_ask: whether one more may be asked for: what is left uncompared has no margin, for what it was while others
            were hidden says nothing beside them.
    """
    # Many arguments: one search, looked at from without, and how far.
    found = frozenset(step.accepted.cause for step in steps)
    looked = [step.tied_but_for(found) for step in steps]
    for at, step in enumerate(steps):
        name = step.accepted.cause
        if at == len(steps) - 1 and not math.isnan(step.margin):
            continue
        # what belongs to single records was compared when it was accepted, but for the first of a pair; a rival that
        # did as well then may have been found since, and says nothing any more
        is_bound = step.accepted.is_bound
        was_sure = step.margin > SURE and step.whitened_margin > SURE
        if (is_bound and was_sure) or not final.model.has(name):
            continue
        if not may_ask():
            looked[at] = step.uncompared()
            continue
        own, candidates, left_out = _in_place_of(step, steps, final, split, causes, executor)
        anew = next((c for c in candidates if c.cause == name), None)
        if anew is not None and sure_gain(final, anew.fitted, split) > SURE:
            return LastLook(tuple(steps), (at, anew))
        if is_bound and not own.is_plausible and own.train_log_gain < HARDLY:
            # it was told while others were hidden: beside them it mends as little as noise, and as what it is no more
            return LastLook(tuple(steps), None, at)
        candidates = [c for c in candidates if c is not anew]
        better = _better(own, candidates, final, split, len(causes))
        if better is None and not is_bound:
            better = _first_of_two(candidates, final, split, tuple(causes), executor, may_ask)
        if better is not None:
            return LastLook(tuple(steps), (at, better))
        # What was as likely when this one was accepted, others still hidden, says nothing any more beside them.
        looked[at] = replace(
            step.tied_with(ties_of(own, candidates, split)),
            margin=margin_of(own, [*candidates, *left_out], split),
            whitened_margin=whitened_margin_of(own, [*candidates, *left_out], split),
        )
    return LastLook(tuple(looked), None)


def _better(
    own: Candidate, candidates: list[Candidate], final: Refit, split: DataSplit, n_causes: int
) -> Candidate | None:
    """Return the candidate that surely does better in a cause's place, or does as well with fewer parameters.

    In the place of what befell single records what befell them may stand, if it surely does better. What belongs to
    the actuator was scored on other data: it may where training says so with its parameters counted, as at first.
    """
    held = held_residuals(final.model, split.held)
    for other in candidates:
        if own.is_bound and not other.is_bound:
            if explains_events(other, own, split) and is_accepted(other, n_causes):
                return other
            continue
        if not is_accepted(other, n_causes):
            continue
        if other.is_bound:
            if sure_gain(final, other.fitted, split) > SURE and _held_gain(final, held, other, split) > _BETTER:
                return other
            continue
        if not _is_likelier(own, other, final, split):
            continue
        if cause_classes()[other.cause].generalizes == own.cause and not is_surely_better(other, own):
            continue
        if _held_gain(final, held, other, split) > _BETTER or is_likelier_than(own, other, split):
            return other
    if own.is_bound:
        return None
    simpler = simplest(own, candidates, split, n_causes)
    return None if simpler is own else simpler


def _is_likelier(own: Candidate, other: Candidate, final: Refit, split: DataSplit) -> bool:
    """Return whether a candidate is surely likelier in a cause's place, by training or by all data together.

    Training may speak against it by little where held-out data, which neither was fitted to, say more for it: twice as
    much left there is no noise, and that must be sure however the noise is whitened. Where training says much neither
    is the whole. Plays bend to what training lacks.
    """
    learnt = sure_gain(final, other.fitted, split)
    if learnt > SURE:
        return True
    if other.brings_plays or margin_of(own, [other], split) >= -SURE:
        return False
    if learnt > 0.0:
        return True
    lost = math.log(other.fitted.squared_error / final.squared_error)
    told = held_out_score(list(own.held), list(other.held)).log_gain
    return lost < HARDLY and told > NEARLY and whitened_margin_of(own, [other], split) < -SURE


def _first_of_two(
    candidates: list[Candidate],
    final: Refit,
    split: DataSplit,
    causes: tuple[str, ...],
    executor: Executor | None,
    may_ask: Callable[[], bool],
) -> Candidate | None:
    """Return the candidate that surely does better in a cause's place together with a second found beside it.

    Where held-out data speak for it, and training data for what stands there, neither is the whole.
    """
    if final.squared_error < AS_NOISE * split.noise_um2:
        return None
    held = held_residuals(final.model, split.held)
    told = {c.cause: _held_gain(final, held, c, split) for c in candidates if not c.is_bound}
    loud = [c for c in candidates if told.get(c.cause, 0.0) > SPEAKS_UP and is_accepted(c, len(causes))]
    if not loud or not may_ask():
        return None
    first = simplest(max(loud, key=lambda c: told[c.cause]), loud, split, len(causes))
    second = best_beside(first, split, causes, executor)
    if second is None or sure_gain(final, second.fitted, split) <= SURE:
        return None
    return first if _held_gain(final, held, second, split) > _BETTER else None


def _held_gain(final: Refit, held: list[Array], other: Candidate, split: DataSplit) -> float:
    """Return by how much a candidate leaves less held out than what stands, in the logarithm of the squared error."""
    if other.is_bound:
        # scored on blocks of its own record until it is followed in the held-out one
        return score_of_pair(final.model, other.fitted.model, split).log_gain
    return held_out_score(held, list(other.held)).log_gain


def _in_place_of(
    step: Step,
    steps: Sequence[Step],
    final: Refit,
    split: DataSplit,
    causes: Sequence[str],
    executor: Executor | None,
) -> tuple[Candidate, list[Candidate], tuple[Candidate, ...]]:
    """Return a cause as a candidate for what is left without it beside all the others, and who else there is.

    Its kin that was not asked for comes last: it can take nobody's place. What belongs to single records is among them
    itself, begun anew: a past or a time found while others were hidden does not come to what is right by a fit.
    """
    # Many arguments: one search, looked at from within.
    name = step.accepted.cause
    found = {each.accepted.cause for each in steps}
    fewer = final.model.as_before(step.before, name)
    lesser = refit(fewer, split.train, n_iterations=2, executor=executor).model
    present = PresentModel.of(lesser, split)
    again = {name} if step.accepted.is_bound else set()
    wanted = tuple(cause for cause in causes if cause not in found - again)
    screened = screen(present, wanted, held_view(lesser, split), executor)
    own = candidate_of(present, split, name, final, bound=step.accepted.is_bound)
    candidates = candidates_for(present, split, screened, executor, own)
    # a special case that its own trials leave in another valley is compared from where the cause has come to
    candidates = with_kin(own, candidates, present, split, wanted)
    return own, candidates, kin_left_out(own, present, split, causes)

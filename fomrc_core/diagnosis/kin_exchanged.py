"""Two found causes that are akin, each tried with what the other has taken: an amplifier and a mass that both ring.

Linear causes one behind the other do as much the other way round. Only what stands between them, the loops, tells which
is which, and that by so little beside the first of them alone that it may be taken for the other; what is found
beside it then comes to the place of the first, and no fit leads from there across.
"""

from __future__ import annotations

from concurrent.futures import Executor
from itertools import combinations

from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.decision import sure_gain
from fomrc_core.diagnosis.held_out_score import SURE
from fomrc_core.diagnosis.kin import effect_of
from fomrc_core.effects import Effect
from fomrc_core.fitting.joint_fit import Refit, fit_until_still, refit
from fomrc_core.fitting.trial_model import TrialModel

_FIRST_ITERATIONS = 3
_FAR_BEHIND = 1.5  # times the squared error after them: another valley, and no better one


def with_kin_exchanged(final: Refit, split: DataSplit, executor: Executor | None) -> Refit:
    """Return the joint refit with two causes that are akin exchanged, where that is surely likelier.

    Both have as many parameters either way: the likelier is the one that leaves less in training. Nothing is asked
    where no more than noise is left.

    Args:
        final: at rest.
        split: records.
        executor: runs refits side by side where given.
    """
    for one, other in combinations(final.model.actuator_effects(), 2):
        start = _exchanged(final.model, one, other)
        if start is None or final.squared_error < split.noise_um2:
            continue
        first = refit(start, split.train, n_iterations=_FIRST_ITERATIONS)
        if first.squared_error > _FAR_BEHIND * final.squared_error:
            continue
        likelier = fit_until_still(first.model, split.train, executor)
        if sure_gain(final, likelier, split) > SURE:
            return likelier
    return final


def _exchanged(model: TrialModel, one: Effect, other: Effect) -> TrialModel | None:
    """Return the model with each of two causes where the other was; None where they are not akin, or cannot be."""
    for_other, for_one = one.kin().get(other.name), other.kin().get(one.name)
    if for_other is None or for_one is None:
        return None
    exchanged = effect_of(one.name, for_one), effect_of(other.name, for_other)
    if exchanged[0] is None or exchanged[1] is None:
        return None
    return model.with_cause(exchanged[0]).with_cause(exchanged[1])

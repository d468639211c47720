"""The weights of plays learned from all records: whether it is them that a right model errs by held out, or a cause.

A drive that passes a threshold once, or in one large step, leaves open how heavy the plays there are, and where: noise
and the grid say no more. One that turns just there shows the error, ten times the noise at single turns, however right
the causes are. Held against it is what sets of coefficients always are (Chow, 1960): one set of weights for all records
must do as well in each as weights of its own, and leave noise in all. Of a cause that is missing or wrong it does not:
what that does in one drive no play does in all of them.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fomrc_core.diagnosis.data_split import DataSplit, HeldOut, begun_either_way
from fomrc_core.diagnosis.element_weights import with_element_weights
from fomrc_core.diagnosis.finer_grid import on_halved_grid
from fomrc_core.diagnosis.held_out_score import SURE
from fomrc_core.diagnosis.judged_rest import JudgedRest
from fomrc_core.diagnosis.judgement import LARGEST_EXCESS, LARGEST_SLOW, Judgement
from fomrc_core.diagnosis.present_model import residual_inflation
from fomrc_core.fitting.base_fit import rebased
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.fitting.linear_part import residuals, squared_error
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.noise import NoiseFloor

_MOST_THRESHOLDS = 450  # of a grid: the normal equations of all records are solved for all of them at once
_N_ITERATIONS = 4  # of the creep order; the causes stay as they are


def unless_of_weights(
    rest: JudgedRest, model: TrialModel, base: TrialModel, split: DataSplit, noise: NoiseFloor
) -> Judgement:
    """Return the judgement of what a model leaves, as noise where weights learned from all records leave no more.

    Args:
        rest: what the model leaves, judged.
        model: with the causes found, learned from the training records.
        base: model without causes.
        split: records.
        noise: floor known before any model.
    """
    given = rest.judgement
    apart = {part.index: part for part in (*split.held, *split.report) if part.index >= len(split.train)}
    if given.is_noise or not apart or rest.learned_um > LARGEST_SLOW * rest.floor_um:
        return given  # what weights leave of the data they were learned from they leave of all
    every = with_weights_of_all(model, split, tuple(apart[i] for i in sorted(apart)))
    if _surely_costs_training(every, model, split):
        return given
    again = JudgedRest.of(every, base, split, noise, learning_excess=0.0)
    if not again.judgement.is_noise or again.worst_um > LARGEST_EXCESS * again.learned_um:
        return given
    told = (
        f"held out {1e3 * rest.worst_um:.3g} nm is left with the weights of elements that were learned, and "
        f"{1e3 * again.worst_um:.3g} nm with weights learned from all records: the training drives say too little of "
        "them, and the model that is written errs by it"
    )
    return replace(again.judgement, rests_on=(*given.rests_on, told))


def with_weights_of_all(model: TrialModel, split: DataSplit, apart: tuple[HeldOut, ...]) -> TrialModel:
    """Return the model with plays chosen anew and weights and creep order learned from all records, its causes held.

    The grid is refined while that surely does better.

    Args:
        model: the model.
        split: records.
        apart: those that were not learned from, by their numbers, which follow those of the training records.
    """
    for part in apart:
        model = min(begun_either_way(model, part), key=lambda each: _squares(each.alone(part.index), (part.record,)))
    records = (*split.train, *(part.record for part in apart))
    best = _learned(model, records)
    while (halved := on_halved_grid(best, _MOST_THRESHOLDS)) is not None:
        finer = _learned(halved, records)
        if _gain(best, finer, records) <= SURE:
            break
        best = finer
    return best


def _learned(model: TrialModel, records: tuple[FitRecord, ...]) -> TrialModel:
    fitted = refit(rebased(model, records), records, free=(), n_iterations=_N_ITERATIONS)
    return with_element_weights(fitted.model, records)


def _surely_costs_training(every: TrialModel, model: TrialModel, split: DataSplit) -> bool:
    """Return whether the training records surely ask for weights of their own: each may gain half of one by chance."""
    return _gain(every, model, split.train) > SURE + 0.5 * model.weights.size


def _gain(model: TrialModel, other: TrialModel, records: tuple[FitRecord, ...]) -> float:
    """Return by how much another model makes records likelier, in log likelihood, correlated samples counted as few."""
    left_um = residuals(other, records)
    n_used = sum(int(np.count_nonzero(r.is_used)) for r in records)
    n_effective = n_used / residual_inflation(left_um, records)
    return 0.5 * n_effective * math.log(_squares(model, records) / squared_error(records, left_um))


def _squares(model: TrialModel, records: tuple[FitRecord, ...]) -> float:
    return squared_error(records, residuals(model, records))

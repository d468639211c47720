"""Whether a given model has too few Maxwell elements: a cause of its own, tested apart from the others."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import DataSplit, held_residuals
from fomrc_core.diagnosis.held_out_score import held_out_score
from fomrc_core.diagnosis.present_model import residual_inflation
from fomrc_core.diagnosis.step import Step
from fomrc_core.fitting.element_fit import fit_elements, trial_of
from fomrc_core.fitting.joint_fit import Refit, refit
from fomrc_core.fitting.linear_part import residuals, squared_error
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.piezo_model import PiezoModel

_SIGNIFICANCE = 0.01  # of one diagnosis, shared by the causes it tries


def coarse_model(given: PiezoModel, split: DataSplit) -> TrialModel:
    """Return the given model's structure fitted to the training records: its number of elements, freely placed."""
    starts = tuple(None for _ in split.train)
    best = fit_elements(given.play_form, given.creep_order, split.train, starts)
    fitted = trial_of(best.form, best.order, split.train, starts)
    nothing = tuple(() for _ in range(split.n_records))
    return replace(fitted, record_effects=nothing, starts=())


def missing_step(
    name: str, coarse: TrialModel, base: TrialModel, final: TrialModel, split: DataSplit, n_causes: int
) -> Step | None:
    """Return the acceptance of further elements as a cause, or None where the coarse ones do with the effects found.

    Tested beside the effects that were found, so that what an effect explains is not blamed on the elements.

    Args:
        name: of the cause.
        coarse: the given elements, fitted.
        base: fine elements, fitted.
        final: the model with what the search found.
        split: records.
        n_causes: number of causes tried in all.
    """
    with_effects = replace(coarse, effects=final.effects, record_effects=final.record_effects, starts=final.starts)
    fitted_coarse = refit(with_effects, split.train)
    score = held_out_score(held_residuals(fitted_coarse.model, split.held), held_residuals(final, split.held))
    if not (score.is_worthwhile() and score.p_value < _SIGNIFICANCE / n_causes):
        return None
    residuals_um = residuals(base, split.train)
    before = squared_error(split.train, residuals(coarse, split.train))
    after = squared_error(split.train, residuals_um)
    no_parameters = tuple(np.zeros((r.time_s.size, 0)) for r in split.train)
    fitted = Refit(base, after, (), no_parameters, residuals_um, True)
    quoted = held_out_score(held_residuals(coarse, split.held), held_residuals(base, split.held))
    gained = Candidate(
        name,
        fitted,
        replace(quoted, p_value=score.p_value),
        math.log(before / after),
        tuple(held_residuals(base, split.held)),
        base.weights.size - coarse.weights.size,
    )
    # against the coarse elements with the same effects: no other cause is asked
    left = residuals(final, split.train)
    n_effective = split.n_used / residual_inflation(left, split.train)
    margin = 0.5 * n_effective * math.log(fitted_coarse.squared_error / squared_error(split.train, left))
    return Step(coarse, gained, (), (), margin=margin, whitened_margin=margin)


def n_elements_needed(model: PiezoModel) -> int:
    """Return how many elements the extended model has."""
    return model.n_elements

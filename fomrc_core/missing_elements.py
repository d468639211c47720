"""Whether a given model has too few Maxwell elements: the cause missing_hysteresis, tested apart from the others."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fomrc_core.acceptance import held_out_score
from fomrc_core.base_fit import residuals, squared_error
from fomrc_core.bench import Bench, held_residuals
from fomrc_core.chain import Chain
from fomrc_core.columns import ColumnKinds
from fomrc_core.model import PiezoModel
from fomrc_core.polish import polish
from fomrc_core.refit import Refit, refit
from fomrc_core.search import Contender, Step

_SIGNIFICANCE = 0.01


def coarse_chain(model: PiezoModel, bench: Bench) -> Chain:
    """Return the given model's structure fitted to the training records: its number of elements, freely placed."""
    starts = tuple(() for _ in bench.train)
    best = polish(model.play_form, model.creep_order, bench.train, starts)
    thresholds = np.concatenate(([0.0], best.form.thresholds))
    weights = np.concatenate(([best.form.slope], best.form.weights))
    own = tuple(() for _ in range(bench.n_records))
    return Chain(ColumnKinds.plays(thresholds), weights, best.order, (), own)


def missing_step(coarse: Chain, base: Chain, final: Chain, bench: Bench, n_causes: int) -> Step | None:
    """Return the acceptance of missing_hysteresis, or None where the coarse elements do with the effects found.

    Tested beside the effects that were found, so that what an effect explains is not blamed on the elements.
    """
    with_effects = replace(coarse, effects=final.effects, record_effects=final.record_effects)
    lesser = refit(with_effects, bench.train).chain
    score = held_out_score(held_residuals(lesser, bench.held), held_residuals(final, bench.held))
    if not (score.is_worthwhile() and score.p_value < _SIGNIFICANCE / n_causes):
        return None
    left = residuals(base, bench.train)
    before = squared_error(bench.train, residuals(coarse, bench.train))
    after = squared_error(bench.train, left)
    directions = tuple(np.zeros((r.time_s.size, 0)) for r in bench.train)
    fitted = Refit(base, after, (), directions, left, True)
    quoted = held_out_score(held_residuals(coarse, bench.held), held_residuals(base, bench.held))
    gained = Contender("missing_hysteresis", fitted, replace(quoted, p_value=score.p_value), math.log(before / after),
                       tuple(held_residuals(base, bench.held)), base.weights.size - coarse.weights.size)  # fmt: skip
    return Step(coarse, gained, (), ())


def n_elements_needed(model: PiezoModel) -> int:
    """Return how many elements the extended model has."""
    return model.n_elements

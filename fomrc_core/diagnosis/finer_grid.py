"""Thresholds of the plays between those there were: what a grid is too coarse for is nobody's cause.

A base chooses its plays from a grid. Where the noise is ten thousand times below the stroke, and a drive moves a wide
play only once, a threshold between two of the grid leaves a jump, which causes with plays of their own, a load or a
past would be named for. Plays of the same kind are asked first.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from fomrc_core.diagnosis.data_split import DataSplit, held_residuals
from fomrc_core.diagnosis.decision import sure_gain
from fomrc_core.diagnosis.held_out_score import SURE, held_out_score
from fomrc_core.diagnosis.record_effects import follow_held
from fomrc_core.diagnosis.search_state import AS_NOISE, SearchState
from fomrc_core.fitting.base_fit import rebased
from fomrc_core.fitting.joint_fit import fit_until_still, refit
from fomrc_core.fitting.trial_model import TrialModel

_MOST_THRESHOLDS = 900  # of a grid: its normal equations are solved for all of them at once


def on_finer_grid(state: SearchState, split: DataSplit, executor: Executor | None) -> SearchState:
    """Return the state with plays chosen from a finer grid, where that is surely likelier and predicts no worse.

    Each grid has the thresholds of the one before and those halfway between them, while more than noise is left.

    Args:
        state: with the last joint refit.
        split: records.
        executor: simulates side by side where given.
    """
    while state.final.squared_error > AS_NOISE * split.noise_um2:
        finer = on_halved_grid(state.final.model, _MOST_THRESHOLDS)
        if finer is None:
            break
        final = fit_until_still(finer, split.train, executor)
        if sure_gain(state.final, final, split) <= SURE:
            break
        model = follow_held(final.model, split)
        score = held_out_score(held_residuals(state.model, split.held), held_residuals(model, split.held))
        if score.log_gain < 0.0:
            break
        state = replace(state, model=model, final=final)
    return state


def on_halved_grid(model: TrialModel, n_most: int) -> TrialModel | None:
    """Return a model with a grid that has the thresholds of its own and those halfway between them.

    None where it has none, or one that would have more than so many.
    """
    grid_v = model.grid_v
    if grid_v is None or 2 * grid_v.size > n_most:
        return None
    return replace(model, grid_v=np.sort(np.concatenate((grid_v, 0.5 * (grid_v[1:] + grid_v[:-1])))))


def on_same_grid(model: TrialModel, other: TrialModel, split: DataSplit) -> TrialModel:
    """Return a model with plays chosen from the grid of another where that is finer: what they leave is compared."""
    if model.grid_v is None or other.grid_v is None or other.grid_v.size <= model.grid_v.size:
        return model
    finer = rebased(replace(model, grid_v=other.grid_v), split.train)
    return refit(finer, split.train, n_iterations=3).model

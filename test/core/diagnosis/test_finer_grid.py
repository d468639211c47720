"""Plays between the thresholds of a grid: what that is too coarse for is told as noise, and is nobody's cause."""

from __future__ import annotations

import math

import numpy as np

from fomrc_core.diagnosis.base_model import base_model
from fomrc_core.diagnosis.data_split import DataSplit, held_residuals, split_data
from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.diagnosis.finer_grid import on_finer_grid, on_same_grid
from fomrc_core.diagnosis.judgement import Status
from fomrc_core.diagnosis.search_state import SearchState
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.records.recording import Recording

STEP_S, NOISE_UM = 0.01, 1e-3


def _measured(n: int, seed: int, noise_um: float = NOISE_UM) -> Recording:
    """Return a stage of 200 um of five plays, from a relaxed state, made here with numpy alone."""
    rng, time_s = np.random.default_rng(seed), STEP_S * np.arange(n)
    sines = sum(np.sin(2 * np.pi * f * time_s + rng.uniform(0, 6)) for f in (0.11, 0.23, 0.37, 0.71))
    voltage_v = 6.0 * np.minimum(time_s / 0.5, 1.0) * np.asarray(sines)
    moved_um = 4.0 * voltage_v
    for half_width, weight in ((0.61, 1.0), (2.037, 0.8), (5.113, 0.6), (9.871, 0.5), (14.4, 0.7)):
        play = 0.0
        for k, u in enumerate(voltage_v):
            play = min(max(play, u - half_width), u + half_width)
            moved_um[k] += weight * play
    return Recording(time_s, voltage_v, moved_um + rng.normal(0.0, noise_um, n))


def _split(noise_um: float) -> DataSplit:
    return split_data((_measured(2400, 1, noise_um),), _measured(1500, 11, noise_um), None, noise_um)


def _held(state: SearchState, split: DataSplit) -> float:
    left_um = np.concatenate(held_residuals(state.model, split.held))
    return float(np.sqrt(np.mean(left_um**2))) / split.noise_um


def _begun(split: DataSplit) -> SearchState:
    final = refit(base_model(split), split.train, n_iterations=2)
    return SearchState(final.model, (), final, frozenset())


def test_what_a_coarse_grid_leaves_is_followed_to_the_noise() -> None:
    split = _split(NOISE_UM)
    coarse = _begun(split)
    finer = on_finer_grid(coarse, split, None)
    assert _held(coarse, split) > 1.5
    assert _held(finer, split) < 1.15
    # the same plays, nearer to where they are: hardly more of them
    assert finer.model.weights.size < 2 * coarse.model.weights.size
    again = on_same_grid(coarse.model, finer.model, split)
    assert again.grid_v is not None
    assert finer.model.grid_v is not None
    assert again.grid_v.size == finer.model.grid_v.size
    assert on_same_grid(finer.model, coarse.model, split) is finer.model


def test_where_noise_is_all_that_is_left_nothing_is_tried() -> None:
    split = _split(20.0 * NOISE_UM)
    coarse = _begun(split)
    assert on_finer_grid(coarse, split, None) is coarse


def test_nothing_is_found_in_it_and_the_noise_is_known() -> None:
    found = diagnose(_measured(2400, 1), test=_measured(1500, 11))
    assert found.status is Status.NOTHING_FOUND
    assert not found.findings
    # what the quoted record leaves is its noise, and not that and the grid's
    left_um = math.sqrt(np.mean([np.mean(v.driven().residual_um ** 2) for v in found.records if v.time_s.size == 1500]))
    assert left_um < 1.15 * NOISE_UM

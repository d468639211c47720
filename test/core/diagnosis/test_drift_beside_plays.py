"""A drift of one record is followed until the plays that had bent to it are those of the actuator again.

The truth are sixty plays that creep by a power law, and a frame that warms up in a quarter of the record.
"""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.diagnosis.candidate import candidates_for
from fomrc_core.diagnosis.data_split import split_data
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import held_view, screen
from fomrc_core.effects.thermal_drift import ThermalDrift
from fomrc_core.fitting.base_fit import threshold_grid
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import fit_until_still
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.recording import Recording

_N, _RATE_HZ, _NOISE_UM, _WARM_UP_UM = 3000, 50.0, 3e-4, 0.05
_N_PLAYS, _N_GRID = 60, 150


def _actuator() -> TrialModel:
    rng = np.random.default_rng(5)
    weights = np.concatenate(([1.0], rng.uniform(0.01, 0.08, _N_PLAYS - 1)))
    thresholds_v = np.concatenate(([0.0], np.sort(rng.uniform(0.01, 3.0, _N_PLAYS - 1))))
    return TrialModel(ColumnKinds.plays(thresholds_v), weights, 0.014, (), ((), ()))


def _recorded(seed: int, warm_up_um: float) -> Recording:
    rng = np.random.default_rng(seed)
    time_s = np.arange(_N) / _RATE_HZ
    lines_hz, sizes_v, phases = rng.uniform(0.02, 0.3, 8), rng.uniform(0.3, 1.0, 8), rng.uniform(0.0, 6.0, 8)
    lines_v = np.sin(2.0 * np.pi * lines_hz[:, None] * time_s + phases[:, None]) * sizes_v[:, None]
    swell = 0.35 + 0.65 * np.abs(np.sin(2.0 * np.pi * 1.7 * time_s / time_s[-1]))
    drive_v = np.minimum(time_s / 3.0, 1.0) * (swell * np.sum(lines_v, axis=0) + 1.5)
    moved_um = predict(_actuator(), FitRecord.of(Recording(time_s, drive_v, drive_v)), 0)
    moved_um += warm_up_um * (1.0 - np.exp(-time_s / (0.25 * time_s[-1])))
    return Recording(time_s, drive_v, moved_um + rng.normal(0.0, _NOISE_UM, _N))


@pytest.mark.parametrize("seed", [3, 4])
def test_plays_are_chosen_anew_beside_a_drift_until_none_gains(seed: int) -> None:
    split = split_data((_recorded(10 + seed, _WARM_UP_UM),), _recorded(20 + seed, 0.0), None, _NOISE_UM)
    plays = ColumnKinds.plays(threshold_grid(split.train, _N_GRID))
    start = TrialModel(plays, np.full(_N_GRID, 0.03), 0.02, (), ((), ()), grid_v=plays.thresholds_v)
    base = fit_until_still(start, split.train).model
    present = PresentModel.of(base, split)
    screened = screen(present, ("thermal_drift",), held_view(base, split))
    (found,) = candidates_for(present, split, screened, None)
    # a grid of plays leaves a few per cent that are not the drift's
    assert found.fitted.squared_error < 1.12 * split.noise_um2
    drift = next(cause for _, cause in found.fitted.model.found(0) if isinstance(cause, ThermalDrift))
    assert drift.warm_up_um == pytest.approx(_WARM_UP_UM, rel=0.02)

"""A past and a drift of one record are sought beside one another: either bends to what the other is not yet.

The truth of these records are plays that had been driven before, and a steady drift, made here with numpy alone.
"""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.pair_fits import fitted_pairs
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import held_view, screen
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.records.recording import Recording
from test.core.driven_plays import states_of_plays, sum_of_lines

_RATE_HZ, _N, _NOISE_UM = 200.0, 3000, 0.004
_THRESHOLDS_V = np.array([0.0, 0.4, 0.8, 1.2, 1.8])
_WEIGHTS = np.array([1.0, 0.3, 0.3, 0.3, 0.3])
_PLAIN = TrialModel(ColumnKinds.plays(_THRESHOLDS_V), _WEIGHTS, 0.0, (), ((), ()))


def _measured(seed: int, extreme_v: float, drift_um: float) -> Recording:
    rng = np.random.default_rng(seed)
    time_s = np.arange(_N) / _RATE_HZ
    drive_v = 0.6 * np.minimum(time_s / 3.0, 1.0) * sum_of_lines(rng, time_s, 0.05, 1.0)
    moved_um = states_of_plays(_THRESHOLDS_V, drive_v, extreme_v) @ _WEIGHTS + drift_um * time_s / time_s[-1]
    return Recording(time_s, drive_v, moved_um + rng.normal(0.0, _NOISE_UM, _N))


def _split(seed: int, extreme_v: float, drift_um: float) -> DataSplit:
    return split_data((_measured(seed, extreme_v, drift_um),), _measured(2, 0.0, 0.0), None, _NOISE_UM)


@pytest.mark.parametrize(("seed", "extreme_v", "drift_um"), [(11, 3.0, -0.5), (12, -2.5, 0.5)])
def test_of_a_past_and_a_drift_the_noise_is_left(seed: int, extreme_v: float, drift_um: float) -> None:
    split = _split(seed, extreme_v, drift_um)
    present = PresentModel.of(_PLAIN, split)
    screened = screen(present, ("initial_state", "thermal_drift", "external_load"), held_view(_PLAIN, split))
    best = fitted_pairs(present, split, screened, None)[0]
    assert best.pair.names == {"initial_state", "thermal_drift"}
    assert best.fitted.squared_error < 1.1 * split.noise_um2
    past = next(cause for _, cause in best.fitted.model.found(0) if isinstance(cause, Prehistory))
    assert past.extreme_v == pytest.approx(extreme_v, rel=0.05)

"""Two causes told from their signatures together are fitted together, and accepted one after the other.

The truth of these records is a plain stage behind a delay, read by a sensor that bends, made here with numpy alone.
"""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.diagnosis.judgement import Status
from fomrc_core.diagnosis.pair_fits import fitted_pairs
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import held_view, screen
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.recording import Recording

RATE_HZ, N = 200.0, 3000
DELAY_S, BEND_PER_UM = 0.022, 0.05
NOISE_UM, UM_PER_V = 0.004, 2.0
PLAIN = TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([UM_PER_V]), 0.0, (), ((), ()))
ASKED = ("transport_delay", "sensor_nonlinearity", "slow_relaxation", "gain_drift", "cross_axis")


def _measured(seed: int) -> Recording:
    rng = np.random.default_rng(seed)
    time_s = np.arange(N) / RATE_HZ
    lines_hz, phases = rng.uniform(0.05, 1.5, 8), rng.uniform(0.0, 2.0 * np.pi, 8)

    voltage_v = np.sum(np.sin(2.0 * np.pi * lines_hz[:, None] * time_s + phases[:, None]), axis=0)
    voltage_v *= np.minimum(time_s, 1.0)  # from rest at 0 V: before the record it stood there
    moved_um = UM_PER_V * np.interp(time_s - DELAY_S, time_s, voltage_v)
    read_um = moved_um + BEND_PER_UM * moved_um**2 / 2.0
    return Recording(time_s, voltage_v, read_um + rng.normal(0.0, NOISE_UM, N))


@pytest.fixture(scope="module")
def split() -> DataSplit:
    return split_data((_measured(1),), _measured(2), None, NOISE_UM)


def test_the_two_that_act_leave_the_noise_when_they_are_fitted_together(split: DataSplit) -> None:
    present = PresentModel.of(PLAIN, split)
    screened = screen(present, ASKED, held_view(PLAIN, split))
    best = fitted_pairs(present, split, screened, None)[0]
    assert best.pair.names == {"transport_delay", "sensor_nonlinearity"}
    assert best.fitted.squared_error < 1.3 * split.noise_um2
    delay = next(e for e in best.fitted.model.effects if e.name == "transport_delay")
    assert delay.to_mapping()["delay_s"] == pytest.approx(DELAY_S, rel=0.02)


def test_a_pair_with_what_was_chosen_is_fitted_as_well(split: DataSplit) -> None:
    present = PresentModel.of(PLAIN, split)
    screened = screen(present, ASKED, held_view(PLAIN, split))
    fitted = fitted_pairs(present, split, screened, None, "cross_axis")
    assert fitted == sorted(fitted, key=lambda found: found.fitted.squared_error)
    beside = fitted_pairs(present, split, screened, None, "slow_relaxation")
    assert any("slow_relaxation" in found.pair.names for found in beside)


def test_both_are_told_and_explain_what_is_measured() -> None:
    answer = diagnose((_measured(3),), test=_measured(4), report=_measured(5))
    assert {finding.cause for finding in answer.findings} == {"transport_delay", "sensor_nonlinearity"}
    assert answer.status is Status.EXPLAINED

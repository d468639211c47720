"""What a cause that is no finding surely explains, of training data alone or of held-out data as well, is no noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.diagnosis.candidate import Candidate, candidate_of
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.judgement import judge
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.training_tells import unless_training_tells
from fomrc_core.effects.sensor_nonlinearity import SensorNonlinearity
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording

_PLAIN = TrialModel(ColumnKinds.plays(np.linspace(0.0, 1.8, 10)), np.linspace(1.0, 0.1, 10), 0.02, (), ((),))
_NOISE_UM = 2e-3
NOISE = judge(_NOISE_UM, False, _NOISE_UM, _NOISE_UM, _NOISE_UM, ())


def _candidate(quadratic_per_um: float) -> tuple[Candidate, DataSplit]:
    amplitudes = (2.0, 0.7, 1.4, 0.4, 1.8, 1.0)
    drives = [triangle(a, slope_v_per_s=3.0, n_cycles=2, rate_hz=100.0).voltage_v for a in amplitudes]
    voltage_v = np.concatenate(drives)
    time_s = 0.01 * np.arange(voltage_v.size)
    bent = SensorNonlinearity(quadratic_per_um, 0.0)
    moved_um = predict(_PLAIN.with_cause(bent), FitRecord.of(Recording(time_s, voltage_v, voltage_v)), 0)
    record = Recording(time_s, voltage_v, moved_um + np.random.default_rng(1).normal(0.0, _NOISE_UM, time_s.size))
    split = split_data((record,), record, None, _NOISE_UM)
    fitted = refit(_PLAIN.with_cause(bent), split.train)
    present = PresentModel.of(refit(_PLAIN, split.train).model, split)
    return candidate_of(present, split, "sensor_nonlinearity", fitted, bound=False), split


def test_what_a_cause_explains_in_training_is_no_noise() -> None:
    candidate, split = _candidate(0.03)
    told = unless_training_tells(NOISE, candidate, split)
    assert NOISE.is_noise
    assert not told.is_noise
    assert len(told.reasons) == 1
    assert "sensor_nonlinearity explains" in told.reasons[0]


def test_a_cause_of_one_record_says_nothing() -> None:
    candidate, split = _candidate(0.03)
    assert unless_training_tells(NOISE, replace(candidate, is_bound=True), split) is NOISE


def test_what_a_cause_that_cannot_be_foresees_of_another_record_is_no_noise() -> None:
    candidate, split = _candidate(0.03)
    candidate = replace(candidate, is_plausible=False)
    told = unless_training_tells(NOISE, candidate, split)
    assert not told.is_noise
    assert told.reasons[0].endswith("in held-out data, with parameters no such cause has")


@pytest.mark.parametrize("change", [{"log_gain": 0.0}, {"p_value": 0.1}])
def test_a_cause_that_cannot_be_and_foresees_nothing_says_nothing(change: dict[str, float]) -> None:
    candidate, split = _candidate(0.03)
    candidate = replace(candidate, is_plausible=False, score=replace(candidate.score, **change))
    assert unless_training_tells(NOISE, candidate, split) is NOISE


def test_a_small_gain_or_none_says_nothing() -> None:
    candidate, split = _candidate(1e-6)
    assert unless_training_tells(NOISE, candidate, split) is NOISE
    assert unless_training_tells(NOISE, None, split) is NOISE

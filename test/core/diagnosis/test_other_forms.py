"""A sensor whose poles were counted while another cause was hidden is counted again once that one is found."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.diagnosis.candidate import candidate_of
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.other_forms import in_best_form
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.search_state import SearchState, with_rival
from fomrc_core.diagnosis.step import Step
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.dead_zone import DeadZone
from fomrc_core.effects.gain_drift import GainDrift
from fomrc_core.effects.sensor_bandwidth import SensorBandwidth
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import fit_until_still
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.excitation import multisine
from fomrc_core.records.recording import Recording
from test.core.driven_plays import states_of_plays, sum_of_lines

_NOISE_UM = 1e-3
_PLAIN = TrialModel(ColumnKinds.plays(np.array([0.0, 0.3])), np.array([1.5, 0.3]), 0.0, (), ((),))
_TRUE = SensorBandwidth(30.0, 3.0)


@pytest.fixture(name="split")
def _split() -> DataSplit:
    rate_hz = 200.0
    drive_v = multisine(1.0, lowest_hz=0.5, highest_hz=60.0, period_s=4.0, n_periods=2, rate_hz=rate_hz).voltage_v
    time_s = np.arange(drive_v.size) / rate_hz
    moved_um = predict(_PLAIN.with_cause(_TRUE), FitRecord.of(Recording(time_s, drive_v, drive_v)), 0)
    noise_um = np.random.default_rng(1).normal(0.0, _NOISE_UM, time_s.size)
    return split_data((Recording(time_s, drive_v, moved_um + noise_um),), None, None, _NOISE_UM)


def test_the_poles_of_a_sensor_are_counted_again(split: DataSplit) -> None:
    wrong = fit_until_still(_PLAIN.with_cause(SensorBandwidth(25.0, 1.0)), split.train)
    found = in_best_form(wrong, split, None)
    (sensor,) = found.model.effects
    assert isinstance(sensor, SensorBandwidth)
    assert sensor.form() == _TRUE.form()
    assert sensor.cutoff_hz == pytest.approx(_TRUE.cutoff_hz, rel=0.01)
    assert found.squared_error < 0.5 * wrong.squared_error


def test_a_form_that_is_right_stays_and_so_does_a_cause_of_one_form(split: DataSplit) -> None:
    right = fit_until_still(_PLAIN.with_cause(_TRUE), split.train)
    assert in_best_form(right, split, None) is right
    zone = fit_until_still(_PLAIN.with_cause(DeadZone(0.01)), split.train)
    assert in_best_form(zone, split, None) is zone


def test_what_stays_beside_a_cause_that_takes_a_place_is_counted_again(split: DataSplit) -> None:
    zone = _PLAIN.with_cause(DeadZone(0.05))
    counted = fit_until_still(zone.with_cause(SensorBandwidth(25.0, 1.0)), split.train)
    present = PresentModel.of(_PLAIN, split)
    of_zone = candidate_of(present, split, "dead_zone", fit_until_still(zone, split.train), bound=False)
    of_sensor = candidate_of(present, split, "sensor_bandwidth", counted, bound=False)
    steps = (Step(_PLAIN, of_zone, (), ()), Step(of_zone.fitted.model, of_sensor, (), ()))
    state = SearchState(counted.model, steps, counted, frozenset())
    late = fit_until_still(_PLAIN.with_cause(SensorBandwidth(25.0, 1.0)).with_cause(GainDrift(1e-6)), split.train)
    rival = candidate_of(present, split, "gain_drift", late, bound=False)
    changed = with_rival(state, 0, rival, ((), steps[1:]), split, None)
    sensor = next(effect for effect in changed.model.effects if isinstance(effect, SensorBandwidth))
    assert sensor.form() == _TRUE.form()


def _one_sided(seed: int) -> Recording:
    """Return a stage whose plays count more above zero."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(2400) / 200.0
    drive_v = 0.35 * np.minimum(time_s, 1.0) * sum_of_lines(rng, time_s, 0.2, 2.0)
    plays_v = states_of_plays(np.array([0.0, 0.3, 0.6]), drive_v)
    moved_um = plays_v @ np.array([1.2, 0.3, 0.3]) + 0.2 * np.sum(np.maximum(plays_v[:, 1:], 0.0), axis=1)
    return Recording(time_s, drive_v, moved_um + rng.normal(0.0, _NOISE_UM, time_s.size))


def test_a_loop_that_was_told_as_a_warp_gets_plays_where_they_are_worth_their_weights() -> None:
    split = split_data((_one_sided(1),), _one_sided(2), None, _NOISE_UM)
    base = TrialModel(ColumnKinds.plays(np.array([0.0, 0.3, 0.6])), np.array([1.2, 0.3, 0.3]), 0.0, (), ((), (), ()))
    warped = fit_until_still(base.with_cause(AsymmetricHysteresis(warp_per_v=1e-3)), split.train)
    found = in_best_form(warped, split, None)
    assert np.any(found.model.columns.owned_by("asymmetric_hysteresis"))
    assert found.squared_error < 0.5 * warped.squared_error
    assert in_best_form(found, split, None).model.weights.size == found.model.weights.size, "once is enough"


def test_a_symmetric_loop_gets_no_plays(split: DataSplit) -> None:
    plain = fit_until_still(_PLAIN.with_cause(_TRUE).with_cause(AsymmetricHysteresis(warp_per_v=1e-5)), split.train)
    assert not np.any(in_best_form(plain, split, None).model.columns.owned_by("asymmetric_hysteresis"))

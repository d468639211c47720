"""What belongs to one record - its past, a load, the phase of a hum - is found from where a search begins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.diagnosis.candidate import candidate_of, candidates_for
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.prehistory_search import with_searched_past
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.record_effects import fit_one_record, sought_again
from fomrc_core.diagnosis.screening import screen
from fomrc_core.diagnosis.with_finding import _sought_again_beside
from fomrc_core.effects.base.evidence import Evidence, RecordEvidence
from fomrc_core.effects.external_load import ExternalLoad
from fomrc_core.effects.mains_hum import MainsHum
from fomrc_core.effects.thermal_drift import ThermalDrift
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import fit_until_still, refit
from fomrc_core.fitting.linear_part import residuals, squared_error
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.records.excitation import multisine, triangle
from fomrc_core.records.recording import Recording

NOISE_UM = 1e-3
PLAIN = TrialModel(ColumnKinds.plays(np.array([0.0, 0.1, 0.4, 1.0])), np.array([1.5, 0.3, 0.4, 0.3]), 0.02, (), ((),))


def _measured(chain: TrialModel, voltage_v: np.ndarray, rate_hz: float, seed: int) -> Recording:
    time_s = np.arange(voltage_v.size) / rate_hz
    moved_um = predict(chain, FitRecord.of(Recording(time_s, voltage_v, voltage_v)), 0)
    return Recording(time_s, voltage_v, moved_um + np.random.default_rng(seed).normal(0.0, NOISE_UM, time_s.size))


def _evidence(record: Recording, residual_um: np.ndarray) -> Evidence:
    steps_s = np.full(record.time_s.size, record.sample_period_s)
    own = RecordEvidence(record.time_s, steps_s, record.voltage_v, record.measured_um, residual_um)
    return Evidence((own,), NOISE_UM)


@pytest.mark.parametrize(
    ("extreme_v", "held_s", "resting_s"), [(2.2, 0.7, 0.06), (-1.4, 12.0, 1.5), (0.9, 1.4, 0.15), (2.9, 0.5, 0.05)]
)
def test_a_past_is_found_from_trials_that_know_neither_its_size_nor_its_times(extreme_v, held_s, resting_s):
    past = Prehistory(extreme_v, 0.0, held_s, resting_s)
    drive = triangle(2.0, slope_v_per_s=2.0, n_cycles=3, rate_hz=200.0)
    record = _measured(PLAIN.with_start(0, past), drive.voltage_v, 200.0, 1)
    prepared = (FitRecord.of(record),)
    trials = [e for e in Prehistory.screening(_evidence(record, record.measured_um)) if isinstance(e, Prehistory)]
    start = with_searched_past(PLAIN, 0, trials, lambda c: squared_error(prepared, residuals(c, prepared)))
    fitted = refit(start, prepared)
    found = fitted.model.start_of(0)
    assert found is not None
    assert found.extreme_v == pytest.approx(extreme_v, rel=0.02)
    assert np.sqrt(fitted.squared_error / record.time_s.size) < 1.02 * NOISE_UM


def test_the_frequency_of_a_hum_is_fitted_over_many_of_its_periods():
    rate_hz, duration_s = 500.0, 60.0
    n = int(rate_hz * duration_s)
    drive = multisine(1.0, lowest_hz=0.1, highest_hz=5.0, period_s=20.0, n_periods=3, rate_hz=rate_hz).voltage_v[:n]
    hum = MainsHum(78.774, 0.01, 0.6)
    record = _measured(PLAIN.with_cause(hum, 0), drive, rate_hz, 2)
    # a quarter of a turn at the end of the record
    start = PLAIN.with_cause(replace(hum, frequency_hz=hum.frequency_hz + 0.25 / duration_s, amplitude_um=0.007), 0)
    fitted = refit(start, (FitRecord.of(record),))
    found = fitted.model.record_effects[0][0]
    assert isinstance(found, MainsHum)
    assert found.frequency_hz == pytest.approx(hum.frequency_hz, abs=1e-4)
    assert abs(found.amplitude_um) == pytest.approx(hum.amplitude_um, rel=0.01)


def test_a_load_that_stayed_is_tried_where_the_base_has_bent_to_it():
    drive = triangle(2.0, slope_v_per_s=2.0, n_cycles=4, rate_hz=200.0)
    record = _measured(PLAIN, drive.voltage_v, 200.0, 3)
    t = record.time_s
    onset_s = 0.4 * t[-1]
    # what a bent base leaves of a step: it fades on either side
    left_um = 0.015 * np.sign(t - onset_s) * np.exp(-np.abs(t - onset_s) / (0.03 * t[-1]))
    trials = ExternalLoad.screening(_evidence(record, left_um))
    stayed = [e for e in trials if isinstance(e, ExternalLoad) and e.release_s > t[-1]]
    assert min(abs(e.onset_s - onset_s) for e in stayed) < 0.02 * t[-1]


def test_a_load_found_wrong_in_one_record_is_sought_again():
    drive = triangle(2.0, slope_v_per_s=2.0, n_cycles=4, rate_hz=200.0).voltage_v
    duration_s = drive.size / 200.0
    loads = ExternalLoad(-0.015, 0.6 * duration_s), ExternalLoad(-0.015, 0.5 * duration_s)
    records = [_measured(PLAIN.with_cause(load, 0), drive, 200.0, 4 + k) for k, load in enumerate(loads)]
    split: DataSplit = split_data(tuple(records), None, None, NOISE_UM)
    wrong = replace(loads[1], displacement_um=-0.010, release_s=0.55 * duration_s)
    both = replace(PLAIN, record_effects=((loads[0],), (wrong,)))
    stuck = fit_until_still(both, split.train)
    better = sought_again(stuck, split, "external_load", None)
    found = better.model.record_effects[1][0]
    assert isinstance(found, ExternalLoad)
    assert better.squared_error < stuck.squared_error
    assert found.release_s > duration_s
    assert found.onset_s == pytest.approx(0.5 * duration_s, abs=0.05)


@pytest.mark.parametrize(
    "drift",
    [ThermalDrift(warm_up_um=0.1, warm_up_s=5.0), ThermalDrift(um_per_s=4e-3, um_per_s2=-3e-4, um_per_s3=6e-6)],
)
def test_a_drift_is_fitted_in_the_form_it_has(drift):
    drive = triangle(2.0, slope_v_per_s=2.0, n_cycles=4, rate_hz=400.0).voltage_v
    record = _measured(PLAIN.with_cause(drift, 0), np.tile(drive, 2), 400.0, 7)
    split = split_data((record,), record, None, NOISE_UM)
    plain = replace(PLAIN, record_effects=((), ()))
    chain = refit(plain, split.train).model
    present = PresentModel.of(chain, split)
    (candidate,) = candidates_for(present, split, screen(present, ("thermal_drift",)), None)
    (found,) = candidate.fitted.model.record_effects[0]
    assert isinstance(found, ThermalDrift)
    assert (found.warm_up_um != 0.0) == (drift.warm_up_um != 0.0)
    assert np.sqrt(candidate.fitted.squared_error / split.n_used) < 1.02 * NOISE_UM


def test_a_past_is_sought_from_those_of_the_other_records_too():
    past = Prehistory(1.1, 0.0, 5.1, 0.43)
    drive = triangle(2.0, slope_v_per_s=2.0, n_cycles=3, rate_hz=200.0)
    record = FitRecord.of(_measured(PLAIN.with_start(0, past), drive.voltage_v, 200.0, 8))
    known = replace(PLAIN, record_effects=((), ()), starts=(past, None))
    found = fit_one_record(known, record, 1, {"initial_state"}).start_of(1)
    assert found is not None
    assert found.extreme_v == pytest.approx(past.extreme_v, rel=0.02)


def test_a_hum_known_from_one_record_is_followed_in_another_whose_drive_has_its_line():
    rate_hz, tone = 200.0, MainsHum(5.0, 0.01, 0.4, second_amplitude_um=0.004, second_phase_rad=1.0)
    drive = multisine(1.0, lowest_hz=0.5, highest_hz=12.0, period_s=2.0, n_periods=10, rate_hz=rate_hz).voltage_v
    other = replace(tone, phase_rad=2.5, second_phase_rad=-0.7)
    record = FitRecord.of(_measured(PLAIN.with_cause(other, 0), drive, rate_hz, 9))
    known = replace(PLAIN, record_effects=((tone,), ()), starts=(None, None))
    assert not MainsHum.screening(_evidence(record.recording, record.measured_um - np.mean(record.measured_um)))
    model = fit_one_record(known, record, 1, {"mains_hum"})
    found = model.record_effects[1][0]
    assert isinstance(found, MainsHum)
    assert found.second_amplitude_um == pytest.approx(0.004, rel=0.1), "with the harmonic that it has"
    left = squared_error((record,), residuals(model.alone(1), (record,)))
    assert np.sqrt(left / record.time_s.size) < 1.02 * NOISE_UM


def test_a_past_that_ran_away_is_sought_anew_and_comes_back():
    """Held a million times as long as its record, and with nothing in the drive to come back by."""
    past = Prehistory(2.2, 0.0, 0.7, 0.06)
    drive = triangle(2.0, slope_v_per_s=2.0, n_cycles=3, rate_hz=200.0)
    records = [_measured(PLAIN.with_start(0, past), drive.voltage_v, 200.0, seed) for seed in (10, 11)]
    split = split_data((records[0],), records[1], None, NOISE_UM)
    plain = replace(PLAIN, record_effects=((), ()), starts=(None, None))
    astray = fit_until_still(plain.with_start(0, Prehistory(2.0, 0.0, 1e7, 0.02)), split.train)
    duration_s = float(records[0].time_s[-1])
    started = astray.model.start_of(0)
    assert started is not None
    assert started.ran_away(duration_s)
    assert not past.ran_away(duration_s)
    assert not Prehistory.long_rest(1.0).ran_away(duration_s), "a plain rest is as long as it likes"
    accepted = candidate_of(PresentModel.of(plain, split), split, "initial_state", astray, bound=True)
    assert "initial_state" in _sought_again_beside(accepted, astray.model, split)
    found = sought_again(astray, split, "initial_state", None)
    back = found.model.start_of(0)
    assert back is not None
    assert back.held_s == pytest.approx(past.held_s, rel=0.5)
    assert np.sqrt(found.squared_error / split.n_used) < 1.02 * NOISE_UM < np.sqrt(astray.squared_error / split.n_used)

"""When a load comes and goes is found to the sample, and how long it takes: a model that jumps leaves what rises."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.diagnosis import candidate_fits
from fomrc_core.diagnosis.acceptance import is_no_wander
from fomrc_core.diagnosis.candidate import candidate_of
from fomrc_core.diagnosis.data_split import DataSplit, HeldOut, split_data
from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.diagnosis.held_out_score import SURE
from fomrc_core.diagnosis.judgement import Status
from fomrc_core.diagnosis.moved_times import with_times_moved
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.record_effects import follow_held
from fomrc_core.diagnosis.screening import Screened
from fomrc_core.diagnosis.wander import gain_beyond_wander
from fomrc_core.effects.external_load import ExternalLoad
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.recording import Recording

STEP_S, NOISE_UM = 0.01, 2e-3
STAGE = PiezoModel(np.array([8.0, 3.0, 5.0, 2.0, 1.2]), np.array([0.4, 1.5, 4.0, 9.0]), 0.02)


def sweeps(n: int, seed: int) -> np.ndarray:
    """Return a drive of some slow sines, from zero on [V], shape (n,)."""
    rng, time_s = np.random.default_rng(seed), STEP_S * np.arange(n)
    sines = sum(np.sin(2 * np.pi * f * time_s + rng.uniform(0, 6)) for f in (0.11, 0.23, 0.37, 0.71))
    return 6.0 * np.minimum(time_s / 0.5, 1.0) * np.asarray(sines)


def settled(n: int, begin: float, end: float, samples: float) -> np.ndarray:
    """Return what a weight does that is put on and taken off, and settles through a damper [1], shape (n,)."""
    out, level = np.zeros(n), 0.0
    fine = 50  # of a sample
    for k in range((n - 1) * fine + 1):
        on = begin <= k / fine < end
        level += (float(on) - level) / (samples * fine)
        if k % fine == 0:
            out[k // fine] = level
    return out


@pytest.mark.parametrize("samples", [0.5, 4.0])
def test_a_weight_that_settles_within_some_samples_is_explained_with_its_moments(samples: float) -> None:
    records = []
    for seed, (n, begin, end) in enumerate(((2400, 700.3, 1410.8), (1500, 500.6, 900.2))):
        drive_v, rng = sweeps(n, seed + 5), np.random.default_rng(seed)
        moved_um = STAGE.simulate(np.full(n, STEP_S), drive_v) + 0.12 * settled(n, begin, end, samples)
        records.append(Recording(STEP_S * np.arange(n), drive_v, moved_um + rng.normal(0.0, NOISE_UM, n)))
    found = diagnose(records[0], test=records[1])
    assert [finding.cause for finding in found.findings] == ["external_load"]
    assert found.status is Status.EXPLAINED
    load = found.findings[0].parameters
    assert load["displacement_um"] == pytest.approx(0.12, rel=0.01)
    # where it rises, and how fast, make up for each other
    middle_s = load["onset_s"] + load["rise_s"]
    assert middle_s == pytest.approx(STEP_S * (700.3 + samples), abs=STEP_S)
    assert load["rise_s"] == pytest.approx(STEP_S * samples, abs=0.7 * STEP_S)
    # held out as well: of an edge that jumps a quarter is left at least
    view = next(view for view in found.records if view.time_s.size == 1500)
    left_um = view.driven().residual_um
    beside = np.r_[495:515, 895:915]
    assert np.max(np.abs(left_um[beside])) < 0.12 / 8.0


PLAIN = TrialModel(ColumnKinds.plays(np.array([0.0, 0.1, 0.4, 1.0])), np.array([1.5, 0.3, 0.4, 0.3]), 0.02, (), ((),))


def _loaded(load_um: np.ndarray) -> FitRecord:
    """Return a record of the plain model under this load, shape (n_samples,)."""
    drive_v, time_s = sweeps(load_um.size, 3), STEP_S * np.arange(load_um.size)
    moved_um = predict(PLAIN, FitRecord.of(Recording(time_s, drive_v, drive_v)), 0)
    return FitRecord.of(Recording(time_s, drive_v, moved_um + load_um))


def _moved(begun: ExternalLoad, record: FitRecord) -> ExternalLoad:
    (load,) = with_times_moved(PLAIN.with_cause(begun, 0), record, 0).causes_in(0)
    assert isinstance(load, ExternalLoad)
    return load


def test_a_load_that_stays_is_moved_at_its_one_edge() -> None:
    record = _loaded(0.3 * (STEP_S * np.arange(1200) >= 5.0))
    load = _moved(ExternalLoad(0.3, 5.0 + 6.3 * STEP_S), record)
    assert load.onset_s == pytest.approx(5.0, abs=STEP_S)
    assert load.release_s == ExternalLoad(0.3, 5.0).release_s, "what never ends is not moved to an end"


def test_an_edge_that_jumps_in_the_middle_of_a_rise_moves_to_where_it_begins() -> None:
    record = _loaded(0.3 * settled(1200, 400.4, 800.4, 1.0))
    # one of the two moments is where nobody looks, as in a sensor that drops out
    record = record.using(np.abs(record.time_s - STEP_S * 402.5) > 6 * STEP_S)
    # neither a jump at another moment nor a rise from where it is leaves less of a rise than a jump in its middle
    load = _moved(ExternalLoad(0.3, STEP_S * 405.9, STEP_S * 805.9, 0.0), record)
    assert load.rise_s == pytest.approx(STEP_S, abs=0.3 * STEP_S)
    assert load.release_s == pytest.approx(STEP_S * 800.4, abs=0.3 * STEP_S)


@pytest.mark.parametrize(("onset", "release"), [(105.4, 800.4), (700.6, 1150.4), (400.4, 420.4)])
def test_moments_of_a_load_go_as_far_as_it_takes(onset: float, release: float) -> None:
    record = _loaded(-0.3 * settled(1200, 400.4, 800.4, 0.5))
    record = record.using(np.abs(record.time_s - STEP_S * 600.0) > 20 * STEP_S)
    load = _moved(ExternalLoad(-0.3, STEP_S * onset, STEP_S * release), record)
    assert load.onset_s == pytest.approx(STEP_S * 400.4, abs=STEP_S)
    assert load.release_s == pytest.approx(STEP_S * 800.4, abs=STEP_S)


def test_a_load_that_was_read_from_what_a_bent_base_left_is_fitted_where_it_is() -> None:
    rng = np.random.default_rng(8)
    blank = [_loaded(0.3 * settled(1200, begin, begin + 350.0, 0.5)) for begin in (400.4, 600.7)]
    told = [Recording(r.time_s, r.voltage_v, r.measured_um + rng.normal(0.0, NOISE_UM, r.time_s.size)) for r in blank]
    split = split_data((told[0],), told[1], None, NOISE_UM)
    present = PresentModel.of(PLAIN, split)
    # a hundred samples off at one end: beside what is left there no edge stands out
    read = Screened(ExternalLoad(0.25, 3.0, 7.504), 0, explained=1.0, signature_power=1.0, amplitude=1.0)
    fitted = candidate_fits.gone_on(present, split, candidate_fits.begin((present, split, [read])), math.inf)
    assert fitted is not None
    (load,) = fitted.model.causes_in(0)
    assert isinstance(load, ExternalLoad)
    assert load.onset_s == pytest.approx(4.004, abs=STEP_S)
    assert candidate_of(present, split, load.name, fitted, bound=True).is_plausible


def test_a_load_is_found_in_records_whose_sensor_stuck_for_a_while() -> None:
    records = []
    for seed, (n, begin, end, stuck) in enumerate(((2400, 700.3, 1410.8, 1800), (1500, 900.6, 1300.2, 360))):
        drive_v, rng = sweeps(n, seed + 5), np.random.default_rng(seed)
        moved_um = STAGE.simulate(np.full(n, STEP_S), drive_v) + 0.12 * settled(n, begin, end, 2.0)
        moved_um += rng.normal(0.0, NOISE_UM, n)
        moved_um[stuck : stuck + 40] = moved_um[stuck]
        # the drive has gone on by far more than a load moves the stage
        assert np.ptp(drive_v[stuck : stuck + 40]) > 2.0
        records.append(Recording(STEP_S * np.arange(n), drive_v, moved_um))
    found = diagnose(records[0], test=records[1])
    assert [finding.cause for finding in found.findings] == ["external_load"]
    assert found.status is Status.EXPLAINED


def test_a_load_is_followed_in_a_held_out_record_in_time_and_size() -> None:
    n = 1300
    load_um = 0.3 * settled(n, 622.4, 1010.7, 12.0)
    learned, other = _loaded(np.zeros(n)), _loaded(load_um)
    model = replace(PLAIN, record_effects=((ExternalLoad(0.3, 2.0),), ()))
    part = HeldOut(other, 1)
    followed = follow_held(model, DataSplit((learned,), (part,), (part,), 1e-3))
    (load,) = followed.causes_in(1)
    assert isinstance(load, ExternalLoad)
    assert load.displacement_um == pytest.approx(0.3, rel=0.005)
    assert load.onset_s + load.rise_s == pytest.approx(STEP_S * 634.4, abs=STEP_S)


def test_a_load_that_came_some_samples_earlier_is_no_noise_that_wanders() -> None:
    """Its jump is left twice, a sample each: beside a walk as much as none at all."""
    rng = np.random.default_rng(4)
    blank = [_loaded(0.3 * ((STEP_S * np.arange(1200) >= 5.0) & (STEP_S * np.arange(1200) < 8.0))) for _ in range(2)]
    told = [Recording(r.time_s, r.voltage_v, r.measured_um + rng.normal(0.0, NOISE_UM, r.time_s.size)) for r in blank]
    split = split_data((told[0],), told[1], None, NOISE_UM)
    plain = replace(PLAIN, record_effects=((), ()))
    late = plain.with_cause(ExternalLoad(0.3, 5.0 + 6 * STEP_S, 8.0 + 5 * STEP_S), 0)
    fitted = refit(late, split.train)
    candidate = candidate_of(PresentModel.of(plain, split), split, "external_load", fitted, bound=True)
    assert gain_beyond_wander(fitted.model, "external_load", split) < SURE, "as it was begun"
    assert is_no_wander(candidate, split)
    # and where there is none no moment makes one of a walk
    walk_um = np.cumsum(rng.normal(0.0, 20.0 * NOISE_UM, 1200))
    told = [Recording(r.time_s, r.voltage_v, r.measured_um + walk_um) for r in (_loaded(np.zeros(1200)),) * 2]
    split = split_data((told[0],), told[1], None, NOISE_UM)
    fitted = refit(late, split.train)
    assert not is_no_wander(replace(candidate, fitted=fitted), split)


def test_a_load_followed_beside_another_model_is_sought_anew_beside_the_present_one() -> None:
    n = 2400
    drive_v, time_s = sweeps(n, 3), STEP_S * np.arange(n)
    learned = FitRecord.of(Recording(time_s, drive_v, drive_v))
    plain = replace(PLAIN, record_effects=((), ()))
    moved_um = predict(PLAIN, learned, 0) + 0.12 * settled(n, 900.3, 1600.8, 1.0)
    held_out = HeldOut(
        FitRecord.of(Recording(time_s, drive_v, moved_um + np.random.default_rng(2).normal(0.0, NOISE_UM, n))), 1
    )
    # what a model that lacked another cause took for a load there, far from what this one leaves
    model = plain.with_cause(ExternalLoad(0.12, 5.0, 9.0, 0.01), 0).with_cause(ExternalLoad(0.3, 2.0, 1e9, 3.0), 1)
    followed = follow_held(model, DataSplit((learned,), (held_out,), (held_out,), NOISE_UM))
    (load,) = followed.causes_in(1)
    assert isinstance(load, ExternalLoad)
    assert load.displacement_um == pytest.approx(0.12, rel=0.02)
    assert load.onset_s == pytest.approx(9.003, abs=2 * STEP_S)
    assert load.release_s == pytest.approx(16.008, abs=2 * STEP_S)

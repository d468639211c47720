"""What a first fit leaves: a late reading is an excursion, a stage that stands while its drive moves is none."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.records.quality import FaultKind, examine_residual
from fomrc_core.records.quality.place_of_drive import made_by_drive
from fomrc_core.records.recording import Recording

N, STEP_S = 3000, 1e-3


def _found(moved_um: np.ndarray, readings_um: np.ndarray) -> np.ndarray:
    """Return the samples left out of a record whose model says where the stage would have been."""
    noise_um = np.random.default_rng(3).normal(0.0, 1e-3, N)
    record = Recording(np.arange(N) * STEP_S, 10.0 * moved_um, readings_um + noise_um, name="stage")
    faults = examine_residual(record, record.measured_um - moved_um).quality.faults
    spikes = [fault.samples for fault in faults if fault.kind is FaultKind.SPIKES]
    return np.concatenate(spikes) if spikes else np.zeros(0, dtype=np.int64)


def _moved_um() -> np.ndarray:
    """Return sines between rests, which begin and end at speed [um], shape (N,)."""
    time_s = np.arange(N) * STEP_S
    return 3.0 * np.sin(2.0 * np.pi * 1.3 * np.clip(np.abs(time_s - 1.5) - 0.2, 0.0, None))


def test_readings_that_were_late_are_left_out() -> None:
    moved_um = _moved_um()
    readings_um = moved_um.copy()
    late = np.array([200, 640, 1290, 1750, 2200])
    readings_um[late] = moved_um[late - 1]
    assert set(_found(moved_um, readings_um)) == set(late)


def test_a_stage_that_stands_while_its_drive_moves_is_not_left_out() -> None:
    moved_um = _moved_um()
    readings_um = moved_um.copy()
    readings_um[300:340] = moved_um[300]
    assert not set(_found(moved_um, readings_um)) & set(range(295, 345))


def test_a_stage_that_stands_for_few_samples_and_creeps_is_not_left_out() -> None:
    moved_um = _moved_um()
    readings_um = moved_um.copy()
    for first in (300, 700, 2100):
        stands = slice(first, first + 8)
        readings_um[stands] = moved_um[first] + 0.05 * (moved_um[stands] - moved_um[first])
    assert _found(moved_um, readings_um).size == 0


@pytest.mark.parametrize("seed", [6, 20, 47])
def test_what_a_model_misses_in_more_than_a_tenth_of_a_record_is_no_fault_of_its_sensor(seed: int) -> None:
    """Two periods of a few tones, an amplifier at its ends at both tips, and a model that knows of no end."""
    at, rng = np.arange(150), np.random.default_rng(seed)
    tones = [(rng.uniform(0.3, 1.0), rng.uniform(0.0, 6.28)) for _ in range(4)]
    moved_um = sum((a * np.sin(2.0 * np.pi * (k + 1) * at / 69 + b) for k, (a, b) in enumerate(tones)), np.zeros(150))
    moved_um -= np.mean(moved_um)
    ordered_um, noise_um = np.sort(moved_um), rng.normal(0.0, 1e-3, 150)
    ends_um = np.clip(moved_um, ordered_um[8], ordered_um[-9])
    record = Recording(at * STEP_S, 10.0 * moved_um, ends_um + noise_um, name="stage")
    examined = examine_residual(record, record.measured_um - moved_um)
    assert examined.quality.faults == ()
    assert np.array_equal(examined.recording.measured_um, record.measured_um)
    # one reading that was wrong is still left out
    wrong_um = moved_um + np.where(at == 75, 0.1, 0.0)
    record = Recording(at * STEP_S, 10.0 * moved_um, wrong_um + noise_um, name="stage")
    (fault,) = examine_residual(record, record.measured_um - moved_um).quality.faults
    assert list(fault.samples) == [75]


def _sawtooth(n: int = 4000) -> np.ndarray:
    """Return a slow sine with fast teeth on it: no two tips at one drive value."""
    at = np.arange(n)
    return np.asarray(np.sin(2.0 * np.pi * at / 1300.0) + np.where(at % 40 < 30, at % 40, 120 - 3 * (at % 40)) / 30.0)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_excursions_at_the_tips_of_a_drive_are_no_faults_of_the_sensor(scale: float) -> None:
    voltage_v = _sawtooth()
    is_tip = voltage_v > np.quantile(voltage_v, 0.985)
    assert np.all(made_by_drive(is_tip, scale * voltage_v) == is_tip)
    # a few that come elsewhere are still faults
    elsewhere = np.zeros(voltage_v.size, dtype=np.bool_)
    elsewhere[[200, 1714, 3009]] = True
    assert not np.any(is_tip & elsewhere)
    found = made_by_drive(is_tip | elsewhere, scale * voltage_v)
    assert np.count_nonzero(found & is_tip) > 0.9 * np.count_nonzero(is_tip)
    assert not np.any(found & elsewhere)


@pytest.mark.parametrize("lower_share", [0.5, 1.0])
@pytest.mark.parametrize("seed", [2, 9, 24])
def test_excursions_at_both_ends_of_a_drive_are_no_faults_of_the_sensor(seed: int, lower_share: float) -> None:
    """Both tips of quick swings: two places of the drive, of which neither has most of the excursions."""
    at, rng = np.arange(3000), np.random.default_rng(seed)
    voltage_v = (1.0 + 0.2 * np.sin(at / 700.0)) * (np.abs((at / 11.0 + rng.uniform(0.0, 2.0)) % 2.0 - 1.0) - 0.5)
    is_tip = (voltage_v > np.quantile(voltage_v, 0.985)) | (voltage_v < np.quantile(voltage_v, 0.015 * lower_share))
    wrong = rng.choice(np.flatnonzero(np.abs(voltage_v) < 0.3), 4, replace=False)  # far from the ends
    is_excursion = is_tip.copy()
    is_excursion[wrong] = True
    found = made_by_drive(is_excursion, voltage_v)
    assert np.count_nonzero(found & is_tip) > 0.9 * np.count_nonzero(is_tip)
    assert not np.any(found[wrong])


@pytest.mark.parametrize("n_spikes", [1, 3, 5, 20, 100])
@pytest.mark.parametrize("drive", ["teeth", "mostly at rest"])
def test_spikes_at_random_times_stay_faults_whatever_the_drive(n_spikes: int, drive: str) -> None:
    voltage_v = _sawtooth() if drive == "teeth" else np.repeat([0.0, 1.0, 0.0, 2.0], 1000)
    told = 0
    for seed in range(200):
        is_spike = np.zeros(voltage_v.size, dtype=np.bool_)
        is_spike[np.random.default_rng([n_spikes, seed]).choice(voltage_v.size, n_spikes, replace=False)] = True
        told += np.any(made_by_drive(is_spike, voltage_v))
    assert told <= 3  # of two hundred at one in a thousand: four and more happen once in ten thousand


@pytest.mark.parametrize("shift", [-1, 0, 3])
def test_excursions_about_the_steps_of_a_staircase_are_no_faults_of_the_sensor(shift: int) -> None:
    voltage_v = np.repeat(np.random.default_rng(3).uniform(-1.0, 1.0, 40), 100)
    about_steps = np.zeros(voltage_v.size, dtype=np.bool_)
    about_steps[100 + shift : 3950 : 100] = True
    late = np.zeros(voltage_v.size, dtype=np.bool_)
    late[[250, 1777]] = True
    assert np.all(made_by_drive(about_steps | late, voltage_v) == about_steps)


def test_late_readings_stand_out_where_the_drive_is_fast_and_are_faults_all_the_same() -> None:
    voltage_v = _sawtooth()
    fast = np.flatnonzero(np.abs(np.diff(voltage_v, prepend=voltage_v[0])) > 0.08)
    is_late = np.zeros(voltage_v.size, dtype=np.bool_)
    is_late[np.random.default_rng(5).choice(fast, 40, replace=False)] = True
    assert not np.any(made_by_drive(is_late, voltage_v))


@pytest.mark.parametrize("period", [40, 60, 100, 200])
def test_a_stage_that_stands_while_its_drive_turns_is_not_left_out(period: int) -> None:
    moved_um = 3.0 * np.abs((np.arange(N) / period) % 2.0 - 1.0)
    turn, early = period * (1500 // period // 2 * 2), 1.5
    readings_um = moved_um.copy()
    # from just before the turn on: the model is beyond it for one sample or three, and on the other side of it then
    readings_um[turn - 1 : turn + 14] = 3.0 - early * 3.0 / period
    assert _found(moved_um, readings_um).size == 0

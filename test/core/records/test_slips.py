"""Samples lost or kept twice without a trace in the stamps are found, and the readings put where they belong."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fomrc_core import diagnose
from fomrc_core.compute.arrays import Array
from fomrc_core.plants.electromechanical import table1_plant
from fomrc_core.records.quality import FaultKind, Lags, Slip, find_lags, find_slips, without_slips
from fomrc_core.records.recording import Recording

_N = 3000
_ALL = np.ones(_N, dtype=np.bool_)


def _motion(seed: int = 0) -> Array:
    rng, k = np.random.default_rng(seed), np.arange(_N)
    lines = rng.uniform(0.0, 0.02, 12)[:, None]
    return np.asarray(np.sum(np.sin(2.0 * np.pi * (lines * k + rng.uniform(size=(12, 1)))), axis=0))


def _lost(readings: Array, places: list[int]) -> Array:
    return np.pad(np.delete(readings, places), (0, len(places)), mode="edge")


def _doubled(readings: Array, places: list[int]) -> Array:
    return np.insert(readings, places, readings[places])[: readings.size]


@pytest.mark.parametrize(("damage", "sign"), [(_lost, 1), (_doubled, -1)])
def test_slips_are_found_and_the_readings_put_back(damage, sign) -> None:
    places, moved = [700, 1800, 2100], _motion()
    noise = 2e-3 * np.random.default_rng(1).normal(size=_N)
    readings = damage(moved + noise, places)
    slips = find_slips(readings, moved, _ALL)
    assert [s.n_lost for s in slips] == [sign] * 3
    assert [s.sample for s in slips] == pytest.approx(places, abs=3)
    found = without_slips(Recording(np.arange(_N) * 1.0, moved, readings), slips)
    valid = found.recording.valid_samples
    inside = valid & (np.min(np.abs(np.arange(_N)[:, None] - places), axis=1) > 3)
    assert np.max(np.abs((found.recording.measured_um - moved)[inside])) < 0.02, "a sample of motion is up to 0.3"
    assert 3 <= np.count_nonzero(~valid) <= 30
    assert [f.kind for f in found.quality.faults] == [FaultKind.LOST if sign > 0 else FaultKind.DOUBLED]
    assert "moved to where they belong" in str(found.quality)


@pytest.mark.parametrize(("damage", "sign"), [(_lost, 1), (_doubled, -1)])
def test_slips_that_add_up_to_a_good_part_of_a_period_are_found(damage, sign) -> None:
    # five samples of a motion of 30 and more to a period: its rate says nothing of it any more
    places, moved = [337, 1007, 1756, 2296, 2610], _motion(5)
    fast = np.interp(np.linspace(0.0, _N / 2.0, _N), np.arange(_N), moved[:_N])
    fast = np.asarray(np.sin(2.0 * np.pi * 0.03 * np.arange(_N)) + 0.3 * fast)
    noise = 5e-3 * np.random.default_rng(1).normal(size=_N)
    slips = find_slips(damage(fast + noise, places), fast, _ALL)
    assert [s.n_lost for s in slips] == [sign] * 5
    assert [s.sample for s in slips] == pytest.approx(places, abs=8)


def test_noise_a_gain_and_a_delay_are_no_slips() -> None:
    moved = _motion(2)
    late = np.interp(np.arange(_N) - 0.7, np.arange(_N), moved)
    for seed in range(20):
        noise = 1e-2 * np.random.default_rng(seed).normal(size=_N)
        assert find_slips(1.02 * late + noise + 0.3, moved, _ALL) == ()


def test_a_clock_that_drifts_does_better_as_one() -> None:
    moved = _motion(3)
    drifted = np.interp(np.arange(_N) * (1.0 - 1e-3), np.arange(_N), moved)
    slips = find_slips(drifted, moved, _ALL)
    put_back = without_slips(Recording(np.arange(_N) * 1.0, moved, drifted), slips).recording.measured_um
    back, lags = drifted, Lags.none(_N)
    for _ in range(2):
        lags = lags.beside(find_lags(back, moved, _ALL))
        back = lags.taken_from(drifted, _ALL)
    assert float(np.std(back - moved)) < 0.3 * float(np.std(put_back - moved))


def test_jumps_that_are_late_by_samples_are_put_back_sharp() -> None:
    jumps = np.cumsum(np.random.default_rng(5).normal(size=_N) * (np.arange(_N) % 40 == 0))
    moved = jumps + 0.03 * _motion(5)
    sample = np.arange(_N)
    drifted = moved[np.rint(sample * (1.0 - 1e-3)).astype(int)]
    back = Lags(1e-3 * sample, np.zeros(_N)).taken_from(drifted, _ALL)
    # but for the readings next to a jump that rounding took to its other side
    assert np.count_nonzero(np.abs(back - moved) > 0.1) <= _N // 40


@given(st.lists(st.integers(50, _N - 50), min_size=1, max_size=5, unique=True))
def test_readings_put_back_are_those_that_were_there(places: list[int]) -> None:
    moved, places = _motion(), sorted(places)
    # the reading that takes the place of the n-th lost one is n places early
    slips = tuple(Slip(place - n, 1) for n, place in enumerate(places))
    found = without_slips(Recording(np.arange(_N) * 1.0, moved, _lost(moved, places)), slips)
    valid = found.recording.valid_samples
    np.testing.assert_array_equal(found.recording.measured_um[valid], moved[valid])
    assert set(places) <= set(np.flatnonzero(~valid))


def test_a_diagnosis_says_that_samples_were_lost_and_finds_nothing_else() -> None:
    time_s = 0.01 * np.arange(3000)
    drive_v = 1.2 * np.sin(0.9 * time_s) + 0.8 * np.sin(2.3 * time_s + 1.0) + 0.4 * np.sin(7.1 * time_s)
    noise = 4e-3 * np.random.default_rng(4).normal(size=time_s.size)
    readings = _lost(table1_plant(20, substep_s=5e-3).simulate(0.01, drive_v) + noise, [900, 2000])
    found = diagnose(Recording(time_s, drive_v, readings, name="leaky"))
    (fault,) = (f for q in found.data_quality for f in q.faults if f.kind is FaultKind.LOST)
    assert list(fault.samples) == pytest.approx([900, 2000], abs=6)
    assert found.findings == ()


@pytest.mark.parametrize("ppm", [-1000.0, 600.0])
def test_a_diagnosis_takes_a_clock_that_drifts_by_samples_for_no_lost_or_doubled_ones(ppm: float) -> None:
    time_s = 0.01 * np.arange(3000)
    drive_v = 1.2 * np.sin(0.9 * time_s) + 0.8 * np.sin(2.3 * time_s + 1.0) + 0.4 * np.sin(7.1 * time_s)
    moved = table1_plant(20, substep_s=5e-3).simulate(0.01, drive_v)
    noise = 4e-3 * np.random.default_rng(4).normal(size=time_s.size)
    drifted = np.interp(time_s * (1.0 + 1e-6 * ppm), time_s, moved)
    found = diagnose(Recording(time_s, drive_v, drifted + noise, name="skewed"))
    assert not any(f.kind in (FaultKind.LOST, FaultKind.DOUBLED) for q in found.data_quality for f in q.faults)
    assert [f.cause for f in found.findings] == ["clock_skew"]


@pytest.mark.parametrize("n_late", [1, 2])
def test_a_record_that_is_late_as_a_whole_has_no_doubled_samples(n_late: int) -> None:
    plant, rate_hz = table1_plant(), 400.0
    records = []
    for seed in (1, 2):
        rng = np.random.default_rng(seed)
        t = np.arange(2400) / rate_hz
        waves = [np.sin(2.0 * np.pi * (f * t + rng.uniform())) for f in rng.uniform(2.0, 25.0, 6)]
        ramp = np.clip((t - 0.2) / 0.3, 0.0, 1.0)  # at rest at first
        voltage_v = ramp * (40.0 + 6.0 * np.sum(waves, axis=0))
        moved_um = plant.simulate(np.full(t.size, 1.0 / rate_hz), voltage_v)
        late_um = np.concatenate((np.repeat(moved_um[:1], n_late), moved_um[:-n_late]))
        noise_um = 1e-3 * float(np.ptp(moved_um)) * rng.normal(size=t.size)
        records.append(Recording(t, voltage_v, late_um + noise_um, name=f"{seed}"))
    found = diagnose(records[0], test=records[1])
    assert not [f for q in found.data_quality for f in q.faults if f.kind is FaultKind.DOUBLED]
    assert [f.cause for f in found.findings] == ["transport_delay"]


@pytest.mark.parametrize("seed", range(12))
def test_slips_of_a_motion_that_is_all_jumps_are_found(seed: int) -> None:
    # one alone undoes as much as it does wrong, for a delay takes what all have in common
    rng = np.random.default_rng(seed)
    steps = np.cumsum(rng.normal(size=_N) * (np.arange(_N) % 40 == 0))
    places = sorted(rng.integers(100, _N - 100, 3).tolist())
    readings = _lost(steps + 2e-3 * rng.normal(size=_N), places)
    slips = find_slips(readings, steps, _ALL)
    found = without_slips(Recording(np.arange(_N) * 1.0, steps, readings), slips).recording
    left = (found.measured_um - steps)[found.valid_samples]
    assert float(np.std(left)) < 2.0 * 2e-3, "a step is some hundred times the noise"


def test_slips_beside_a_load_are_found_where_that_is_asked_for() -> None:
    places, moved = [700, 1800, 2100], _motion()
    noise = 2e-3 * np.random.default_rng(1).normal(size=_N)
    loaded = _lost(moved + noise + 3.0 * (np.arange(_N) >= 1300), places)
    slips = find_slips(loaded, moved, _ALL, beside_levels=True)
    assert [s.n_lost for s in slips] == [1] * 3
    assert [s.sample for s in slips] == pytest.approx(places, abs=3)

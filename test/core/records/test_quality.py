"""Bad samples are found before a fit, left out of it, and told; sound records of every kind give no false alarm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stage_records import N, drives, loop, sensors

from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.errors import RecordingError
from fomrc_core.identification.convex import identify
from fomrc_core.records.excitation import triangle
from fomrc_core.records.quality import DataQuality, FaultKind, examine
from fomrc_core.records.recording import Recording
from fomrc_core.records.usability import check_usable
from fomrc_core.report.diagnosis_files import diagnosis_results
from fomrc_core.storage import read_model


def _record(
    drive: np.ndarray, readings: np.ndarray, scale: tuple[float, float, float] = (150.0, 20.0, 1e-3)
) -> Recording:
    volts, microns, step_s = scale
    return Recording(np.arange(N) * step_s, volts * drive, microns * readings, name="stage")


def test_sound_records_of_every_kind_give_no_alarm() -> None:
    rng = np.random.default_rng(11)
    told = []
    for name, drive in drives(rng).items():
        for sensor, readings in sensors(loop(drive), drive, rng).items():
            if faults := examine(_record(drive, readings)).quality.faults:
                told.append((name, sensor, str(faults[0])))
    assert told == []


def test_a_drive_of_coarse_steps_is_neither_stuck_nor_clipped_nor_dropping_out() -> None:
    rng = np.random.default_rng(5)
    told = []
    for name, drive in drives(rng).items():
        unit = (drive - np.min(drive)) / float(np.ptp(drive))
        for n_levels in (8, 40, 100):
            moved = loop(np.round(unit * n_levels) / n_levels)
            for step in (2e-5, 2e-4):
                read = np.round((moved + 0.5 * step * rng.standard_normal(N)) / step) * step
                record = _record(unit, read)
                try:
                    check_usable([record])
                    told += [(name, n_levels, step, str(fault)) for fault in examine(record).quality.faults]
                except RecordingError as error:
                    told.append((name, n_levels, step, str(error)))
    assert told == []


@pytest.mark.parametrize("n_levels", [16, 24])
@pytest.mark.parametrize("step", [1e-3, 3e-3])
def test_steps_of_a_converter_that_a_slow_drive_waits_for_are_no_sensor_that_stuck(n_levels: int, step: float) -> None:
    # every step of the record comes after equal readings, for the noise is less than the sensor's own step
    t = np.linspace(0.0, 1.0, N)
    rng = np.random.default_rng(7)
    drive = sum(np.sin(2.0 * np.pi * (k * t + rng.random())) / k for k in (2, 3, 5))
    unit = (drive - np.min(drive)) / float(np.ptp(drive))
    read = np.round(loop(np.round(unit * n_levels) / n_levels) / step) * step
    assert [str(fault) for fault in examine(_record(unit, read)).quality.faults] == []


def test_a_sensor_that_stuck_many_times_is_found(sound: Recording) -> None:
    rng = np.random.default_rng(4)
    begins, lengths = np.arange(150, N - 150, 300), rng.integers(8, 40, 13)
    at = [np.arange(begin, begin + length) for begin, length in zip(begins, lengths, strict=True)]
    spoilt = sound
    for stretch in at:
        spoilt = _spoilt(spoilt, stretch, float(spoilt.measured_um[stretch[0] - 1]))
    assert len(_found(examine(spoilt).quality, FaultKind.STUCK) & set(np.concatenate(at).tolist())) > 0.8 * sum(lengths)


@pytest.fixture(scope="module")
def sound() -> Recording:
    """A triangle with white noise of 1e-4 of the range."""
    rng = np.random.default_rng(3)
    drive = drives(rng)["triangle"] * (1.0 - 0.4 * np.linspace(0.0, 1.0, N))
    return _record(drive, sensors(loop(drive), drive, rng)["white"])


def _spoilt(record: Recording, at: np.ndarray, readings: np.ndarray | float) -> Recording:
    x = record.measured_um.copy()
    x[at] = readings
    return replace(record, displacement_um=x)


def _found(quality: DataQuality, kind: FaultKind) -> set[int]:
    return {int(k) for fault in quality.faults if fault.kind is kind for k in fault.samples}


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    share=st.floats(0.01, 100.0),
    scale=st.tuples(st.floats(0.1, 1e4), st.floats(1e-2, 2e4), st.sampled_from([1e-5, 1e-3, 0.1, 10.0])),
)
def test_spikes_are_found_in_any_unit_at_any_rate(
    seed: int, share: float, scale: tuple[float, float, float], sound: Recording
) -> None:
    rng = np.random.default_rng(seed)
    at = np.sort(rng.choice(np.arange(20, N - 20, 10), 5, replace=False))
    jumps = share * 20.0 * rng.choice([-1.0, 1.0], 5)
    spoilt = _spoilt(sound, at, sound.measured_um[at] + jumps)
    scaled = _record(spoilt.voltage_v / 150.0, spoilt.measured_um / 20.0, scale)
    quality = examine(scaled).quality
    assert _found(quality, FaultKind.SPIKES) == set(at.tolist())
    assert quality.n_masked == 5


@pytest.mark.parametrize("value", [0.0, -7.0, 45.0])
def test_dropouts_to_one_value_are_found_alone_and_in_rows(sound: Recording, value: float) -> None:
    rng = np.random.default_rng(8)
    x = sound.measured_um
    far = np.flatnonzero(np.abs(x - value) > 0.5)
    at = np.union1d(rng.choice(far[(far > 50) & (far < N - 50)], 60, replace=False), np.arange(1500, 1511))
    at = np.intersect1d(at, far)
    examined = examine(_spoilt(sound, at, value))
    assert _found(examined.quality, FaultKind.DROPOUTS) == set(at.tolist())
    assert np.array_equal(np.flatnonzero(~examined.recording.valid_samples), at)
    # bridged for the eye, and to nobody's harm
    assert float(np.max(np.abs(examined.recording.measured_um - x))) < 0.5


def test_a_sensor_that_stuck_is_found(sound: Recording) -> None:
    at = np.arange(1200, 1260)
    quality = examine(_spoilt(sound, at, float(sound.measured_um[1199]))).quality
    assert _found(quality, FaultKind.STUCK) == set(at.tolist())


def test_a_sensor_that_stuck_in_a_rest_in_which_the_stage_crept_on_is_found() -> None:
    # while the drive rests, so that it has no part in what comes at the release
    rng, k = np.random.default_rng(6), np.arange(N)
    drive = np.where(k < 1000, 0.0, np.where(k < 2500, 1.0, 0.3))
    crept = np.where(k < 1000, 0.0, 0.1 * np.log10(np.maximum(k - 999.0, 1.0)))
    readings = drive + crept + 1e-4 * rng.normal(size=N)
    sound = _record(drive, readings)
    assert not examine(sound).quality.faults
    at = np.arange(1300, 1360)
    quality = examine(_spoilt(sound, at, float(sound.measured_um[1299]))).quality
    assert _found(quality, FaultKind.STUCK) == set(at.tolist())


def test_stamps_say_what_is_missing_and_what_jitters(sound: Recording) -> None:
    kept = np.delete(np.arange(N), [700, 2100, 2101])
    short = Recording(sound.time_s[kept], sound.voltage_v[kept], sound.measured_um[kept], name="stage")
    (gap,) = examine(short).quality.faults
    assert (gap.kind, gap.samples.tolist(), gap.is_masked) == (FaultKind.GAPS, [700, 2099], False)
    assert gap.size == pytest.approx(3.0)
    jitter = 0.1 * np.random.default_rng(0).uniform(-1e-3, 1e-3, N)
    (uneven,) = examine(replace(sound, time_s=sound.time_s + jitter)).quality.faults
    assert uneven.kind is FaultKind.UNEVEN_CLOCK
    assert uneven.size == pytest.approx(0.1 * np.sqrt(2.0 / 3.0), rel=0.05)


def test_a_record_of_which_an_eighth_is_wrong_is_refused(sound: Recording) -> None:
    at = np.arange(10, N - 10, 8)
    with pytest.raises(RecordingError, match=r"stage: displacement_um: \d+ of 4000 readings are wrong"):
        examine(_spoilt(sound, at, -80.0))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_clipped_sensor_is_refused_with_noise_on_the_clipped_reading_too(sound: Recording, sign: float) -> None:
    rng = np.random.default_rng(4)
    clean = loop(sound.voltage_v / 150.0)
    flat = np.minimum(sign * clean, np.quantile(sign * clean, 0.9)) * sign
    clipped = replace(sound, displacement_um=20.0 * (flat + 1e-4 * rng.standard_normal(N)))
    with pytest.raises(RecordingError, match=r"lie flat at the (highest|lowest) reading but for noise"):
        check_usable([clipped])


def test_five_spikes_hide_no_load_and_are_no_cause() -> None:
    stage = read_model(Path(__file__).parents[3] / "config" / "pi_p753_table1.yaml")
    drive = triangle(2.5, slope_v_per_s=2.0, rate_hz=200.0).to_recording()
    moved = stage.simulate(drive.steps_s, drive.voltage_v)
    noise = np.random.default_rng(0).normal(0.0, 1e-3, drive.n_samples)
    loaded = moved + noise + np.where(drive.time_s > 0.63 * drive.duration_s, 0.3, 0.0)
    at = np.array([412, 691, 940, 1143, 2357])
    read = replace(drive, displacement_um=loaded, name="stage")
    found = diagnose(_spoilt(read, at, loaded[at] + np.array([30.0, -4.0, 0.2, -9.0, 2.0])))
    assert [finding.cause for finding in found.findings] == ["external_load"]
    assert abs(found.findings[0].parameters["displacement_um"]) == pytest.approx(0.3, rel=0.02)
    (listed,) = diagnosis_results(found)["data_quality"]
    assert [(f["kind"], f["samples"]) for f in listed["faults"]] == [("spikes", at.tolist())]
    assert "data quality: stage: spikes: 5 samples" in str(found)


def test_a_fit_is_that_of_the_record_without_its_spikes(sound: Recording) -> None:
    at = np.arange(100, N, 390)
    spoilt = _spoilt(sound, at, sound.measured_um[at] + 30.0)
    fit, clean = identify(spoilt, n_elements=3), identify(sound, n_elements=3)
    assert fit.rms_um == pytest.approx(clean.rms_um, rel=0.01)
    assert fit.model.creep_order == pytest.approx(clean.model.creep_order, rel=0.05)
    assert fit.data_quality[0].n_masked == at.size


def test_a_stage_that_stood_already_is_no_sensor_that_stuck(sound: Recording) -> None:
    # a coarse sensor reads the same for a while where the stage stands; a lead was open from well before that
    step_um, first = 0.02, 1200
    readings = step_um * np.round(sound.measured_um / step_um)
    stands = readings[first] + step_um * (np.arange(60) % 2)
    stands[40:] = readings[first]
    quality = examine(_spoilt(replace(sound, displacement_um=readings), np.arange(first, first + 60), stands)).quality
    assert not _found(quality, FaultKind.STUCK)

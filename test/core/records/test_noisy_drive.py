"""The noise of a recorded drive that the stage has never seen is smoothed out, and any other drive is left alone."""

from __future__ import annotations

import numpy as np
import pytest
from relay_stage import TIME_S, N, drive_v, lagged, monitored, recording

from fomrc_core.diagnosis.diagnosis import Status, diagnose
from fomrc_core.records.quality import FaultKind, examine
from fomrc_core.records.recording import Recording


def kinds(record: Recording) -> list[FaultKind]:
    return [fault.kind for fault in examine(record).quality.faults]


@pytest.mark.parametrize("seed", range(8))
def test_its_size_is_told_and_most_of_it_goes(seed: int) -> None:
    record = monitored(seed, 2e-3)
    examined = examine(record)
    (fault,) = examined.quality.faults
    assert fault.kind is FaultKind.NOISY_DRIVE
    assert fault.size == pytest.approx(2e-3, rel=0.1)
    assert "noisy drive: 2500 samples" in str(fault)
    assert "smoothed" in str(fault)
    left_v = examined.recording.voltage_v - drive_v(seed)
    assert np.sqrt(np.mean(left_v**2)) < 0.6 * 2e-3
    np.testing.assert_array_equal(examined.recording.measured_um, record.measured_um)


def test_steps_and_corners_stay_where_they_are() -> None:
    time = TIME_S
    for drive in (2.0 * np.abs((time / 1.0) % 2.0 - 1.0) - 1.0, np.repeat(np.tile([0.0, 0.7, -0.4, 1.0, 0.2], 5), 100)):
        noisy = drive + 1e-3 * np.random.default_rng(3).standard_normal(drive.size)
        smoothed = examine(recording(drive, noisy, 3)).recording.voltage_v
        assert np.max(np.abs(smoothed - drive)) < 5.0 * 1e-3
        assert np.sqrt(np.mean((smoothed - drive) ** 2)) < 0.6 * 1e-3


@pytest.mark.parametrize("seed", range(5))
def test_a_drive_that_is_followed_is_no_noise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rough = drive_v(seed) + 4e-3 * rng.standard_normal(N)
    for cutoff_hz in (0.0, 40.0, 6.0):  # at once, or behind an amplifier that lags
        followed = lagged(rough, cutoff_hz) if cutoff_hz else rough
        assert kinds(recording(followed, rough, seed)) == []


def test_rounding_of_numbers_is_no_noise_where_the_reading_stands_still() -> None:
    steps_v = np.repeat(np.tile([0.0, 0.7, -0.4, 1.0, 0.2], 5), 100)
    rounded_v = steps_v + 1e-15 * np.random.default_rng(2).standard_normal(N)
    assert kinds(Recording(TIME_S, rounded_v, np.round(2.0 * steps_v, 1))) == []


def test_what_somebody_made_is_no_noise() -> None:
    rng = np.random.default_rng(5)
    kernel = np.hanning(9) / np.sum(np.hanning(9))
    made = {
        "sine": np.sin(2.0 * np.pi * 2.0 * TIME_S),
        "steps": np.repeat(rng.uniform(-1.0, 1.0, 25), 100),
        "random steps at each sample": rng.uniform(-1.0, 1.0, N),
        "noise in a band": np.convolve(rng.standard_normal(N), kernel, mode="same"),
        "coarse levels": np.round(20.0 * np.sin(2.0 * np.pi * 0.5 * TIME_S)) / 20.0,
    }
    for name, drive in made.items():
        assert kinds(recording(lagged(drive, 13.0), drive, 5)) == [], name
        assert kinds(recording(drive, drive, 5)) == [], name


def test_what_the_reading_hardly_feels_is_left_as_it_is() -> None:
    assert kinds(monitored(1, 5e-5)) == []
    short = monitored(1, 2e-3)
    assert kinds(Recording(short.time_s[:300], short.voltage_v[:300], short.measured_um[:300])) == []
    uneven = short.time_s + 2e-4 * np.random.default_rng(0).random(N)
    assert FaultKind.NOISY_DRIVE not in kinds(Recording(uneven, short.voltage_v, short.measured_um))


@pytest.mark.parametrize("seed", range(10, 130, 10))
def test_it_is_no_cause(seed: int) -> None:
    train, test, report = (monitored(seed + k, 2e-3) for k in range(3))
    found = diagnose(train, test=test, report=report)
    assert found.status is Status.NOTHING_FOUND, found.summary()
    assert "noisy drive" in found.summary()

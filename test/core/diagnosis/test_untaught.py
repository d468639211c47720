"""A held-out drive that goes beyond all training records: what was never taught is nobody's error."""

from __future__ import annotations

import json

import numpy as np
import pytest

from fomrc_core.diagnosis.diagnosis import Status, diagnose
from fomrc_core.diagnosis.untaught import untaught_plays
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.records.recording import Recording
from fomrc_core.report.diagnosis_files import diagnosis_results
from test.hidden.creep import fractional_integral
from test.hidden.hysteresis import RelayPlane

STEP_S, N, NOISE_UM = 4e-3, 2500, 1e-3
ORDER = 0.02


def drive_v(seed: int, largest_v: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    t = STEP_S * np.arange(N)
    waves = [rng.uniform(0.3, 0.6) * np.sin(2.0 * np.pi * f * t) for f in rng.uniform(0.2, 3.0, 5)]
    shape = np.sum(waves, axis=0) * np.minimum(1.0, t / 0.5)
    return np.asarray(largest_v * shape / np.max(np.abs(shape)))


def measured(seed: int, largest_v: float, cutoff_hz: float = 0.0) -> Recording:
    """Return a stage of relays that creeps, behind an amplifier that lags where there is a cutoff."""
    command = drive_v(seed, largest_v)
    voltage = command.copy()
    if cutoff_hz:
        kept = np.exp(-2.0 * np.pi * cutoff_hz * STEP_S)
        gone = (1.0 - kept) / (2.0 * np.pi * cutoff_hz * STEP_S)
        for k in range(1, N):
            voltage[k] = kept * voltage[k - 1] + (gone - kept) * command[k - 1] + (1.0 - gone) * command[k]
    moved = RelayPlane(1.0, 0.8, 0.3, 0.5, 0.9).run(voltage)
    noise = NOISE_UM * np.random.default_rng(1000 + seed).standard_normal(N)
    reading = fractional_integral(moved, ORDER, STEP_S) + noise
    return Recording(STEP_S * np.arange(N), command, reading, name=f"drive_{seed}")


@pytest.mark.parametrize("seed", range(100, 200, 5))
def test_beyond_is_no_cause(seed: int) -> None:
    train, test, report = measured(seed, 1.0), measured(seed + 1, 1.5), measured(seed + 2, 1.3)
    found = diagnose(train, test=test, report=report)
    assert found.status is Status.NOTHING_FOUND, found.summary()
    assert [beyond.name for beyond in found.beyond_learned] == [test.name, report.name]
    assert f"beyond what was learned: {test.name}" in found.summary()
    told = json.loads(json.dumps(diagnosis_results(found)))["beyond_learned"]
    assert [each["record"] for each in told] == [test.name, report.name]


def test_a_cause_is_found_all_the_same() -> None:
    train, test, report = (measured(seed, largest, 6.0) for seed, largest in ((11, 1.0), (12, 1.4), (13, 1.6)))
    found = diagnose(train, test=test, report=report)
    assert found.status is Status.EXPLAINED, found.summary()
    (finding,) = found.findings
    assert finding.cause == "amplifier_bandwidth"
    assert finding.parameters["cutoff_hz"] == pytest.approx(6.0, rel=0.02)


def test_what_a_drive_reaches_is_what_it_moves() -> None:
    def record(*corners_v: float) -> FitRecord:
        voltage = np.interp(np.arange(400.0), np.linspace(0.0, 399.0, len(corners_v)), corners_v)
        return FitRecord.of(Recording(1e-3 * np.arange(400), voltage, voltage))

    taught = (record(0.0, 2.0, -1.0), record(0.0, -1.0, 1.0))
    for within in (record(0.0, 2.0), record(0.0, -2.0, 1.0), record(0.0, 1.99, -2.0, 2.0), record(0.0, 2.01)):
        assert not untaught_plays(taught, within).size
    beyond = untaught_plays(taught, record(0.0, -3.0))
    assert beyond[0] == pytest.approx(2.0, rel=0.01)
    assert np.all(np.diff(beyond) > 0.0)
    assert beyond[-1] < 3.0

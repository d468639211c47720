"""A held-out drive that goes beyond all training records: what was never taught is nobody's error."""

from __future__ import annotations

import json

import numpy as np
import pytest
from relay_stage import driven

from fomrc_core.diagnosis.diagnosis import Status, diagnose
from fomrc_core.diagnosis.untaught import untaught_plays
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.records.recording import Recording
from fomrc_core.report.diagnosis_files import diagnosis_results


@pytest.mark.parametrize("seed", range(100, 200, 5))
def test_beyond_is_no_cause(seed: int) -> None:
    train, test, report = driven(seed, 1.0), driven(seed + 1, 1.5), driven(seed + 2, 1.3)
    found = diagnose(train, test=test, report=report)
    assert found.status is Status.NOTHING_FOUND, found.summary()
    assert [beyond.name for beyond in found.beyond_learned] == [test.name, report.name]
    assert f"beyond what was learned: {test.name}" in found.summary()
    told = json.loads(json.dumps(diagnosis_results(found)))["beyond_learned"]
    assert [each["record"] for each in told] == [test.name, report.name]


def test_a_cause_is_found_all_the_same() -> None:
    train, test, report = (driven(seed, largest, 6.0) for seed, largest in ((11, 1.0), (12, 1.4), (13, 1.6)))
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

"""Records nothing can be learnt from are refused in one line; every measured one is taken."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fomrc_core.cli.application import run
from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.errors import DataUnavailableError, RecordingError
from fomrc_core.identification.convex import identify
from fomrc_core.records.recording import Recording
from fomrc_core.records.usability import check_usable
from fomrc_core.storage import write_recording
from fomrc_core.storage.measured_examples import fsm, pea_1hz

_RATE_HZ = 500.0


def _record(**changes: object) -> Recording:
    """Two seconds of a lagging sine, 1.2 um/V, with 1 nm of noise."""
    time_s = np.arange(1000) / _RATE_HZ
    voltage_v = 2.0 * np.sin(2.0 * np.pi * time_s)
    noise_um = np.random.default_rng(1).normal(0.0, 1e-3, time_s.size)
    moved_um = 2.4 * np.sin(2.0 * np.pi * time_s - 0.1) + noise_um
    return replace(Recording(time_s, voltage_v, moved_um, name="stage"), **changes)


def _cut(record: Recording, kept: np.ndarray) -> Recording:
    displacement_um = record.measured_um[kept]
    return Recording(record.time_s[kept], record.voltage_v[kept], displacement_um, name=record.name)


def _with_gap(n_lost: int) -> Recording:
    index = np.arange(1000)
    return _cut(_record(), (index < 400) | (index >= 400 + n_lost))


def _clipped(lowest_um: float = -np.inf, highest_um: float = np.inf) -> Recording:
    record = _record()
    return replace(record, displacement_um=np.clip(record.measured_um, lowest_um, highest_um))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: _cut(_record(), np.arange(1000) < 99), "stage: record is too short, got 99"),
        (lambda: _record(voltage_v=np.full(1000, 1.5)), "stage: voltage_v: voltage is constant, got 1.5"),
        (lambda: _record(displacement_um=np.zeros(1000)), "stage: displacement_um: displacement is constant"),
        (lambda: _record(displacement_um=None), "stage: no displacement recorded"),
        (lambda: _with_gap(20), "stage: time_s: gap after sample 399, at 0.798 s"),
        (lambda: _record(time_s=np.arange(1000) * 2e3), "stage: time_s: time is in other units than seconds"),
        (lambda: _record(displacement_um=_record().measured_um * 1e-6), "metres given as um"),
        (lambda: _record(displacement_um=_record().measured_um * 1e6), "pm given as um"),
        (lambda: _record(voltage_v=_record().voltage_v * 1e6), "uV as V"),
        (lambda: _clipped(highest_um=2.2), "exactly the highest reading while the voltage moves, got 2.2"),
        (lambda: _clipped(lowest_um=-2.35), "stand at exactly the lowest reading"),
    ],
)
def test_a_record_that_teaches_nothing_is_refused_in_one_line(make: Callable[[], Recording], message: str) -> None:
    with pytest.raises(RecordingError) as refused:
        check_usable([_record(), make()])
    assert message in str(refused.value)
    assert "allowed: " in str(refused.value)
    assert "\n" not in str(refused.value)


def test_no_record_at_all_is_refused() -> None:
    with pytest.raises(RecordingError, match="no recording given"):
        check_usable([])


def test_fits_and_diagnoses_refuse_it_whichever_record_it_is() -> None:
    good, bad = _record(), _clipped(highest_um=2.0)
    with pytest.raises(RecordingError, match="sensor is clipped"):
        identify([good, bad])
    for arguments in ({"test": bad}, {"report": bad}):
        with pytest.raises(RecordingError, match="sensor is clipped"):
            diagnose(good, **arguments)


@pytest.mark.parametrize(
    "record",
    [
        _record(),
        _with_gap(19),
        # 10 nm steps hide the noise: at the turns many readings are the same, and are right.
        _record(displacement_um=np.round(_record().measured_um / 0.01) * 0.01),
        # At rest a sensor without noise stands still.
        _record(
            voltage_v=np.where(np.arange(1000) < 250, 2.0, _record().voltage_v),
            displacement_um=np.where(np.arange(1000) < 250, 5.0, _record().measured_um),
        ),
    ],
    ids=["sine", "jitter", "coarse sensor", "rest at the highest reading"],
)
def test_records_that_only_look_bad_are_taken(record: Recording) -> None:
    check_usable([record])


def test_measured_records_are_taken() -> None:
    try:
        records = [*pea_1hz(), fsm(amplitude_mv=100), fsm(amplitude_mv=300, realisation=3, axis=2)]
    except DataUnavailableError as error:
        pytest.skip(str(error))
    check_usable(records)


@pytest.mark.parametrize("command", ["identify", "diagnose"])
@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (_cut(_record(), np.arange(1000) < 50), "bad.csv: record is too short, got 50"),
        (_record(voltage_v=np.ones(1000)), "bad.csv: voltage_v: voltage is constant"),
        (_with_gap(30), "bad.csv: time_s: gap after sample 399, at 0.798 s"),
        (_clipped(highest_um=2.0), "bad.csv: displacement_um: sensor is clipped"),
        (
            _record(displacement_um=_record().measured_um * 1e-6),
            "bad.csv: 1.2e-06 um/V is not what piezo actuators give",
        ),
        ("time_s,voltage_v,displacement_um\n0,0,0\n0.1,1,1\n0.1,2,2\n", "bad.csv, line 4, column time_s: time does"),
        ("time_s,voltage_v,displacement_um\n0,0,0\n0.1,nan,1\n", "bad.csv, line 3, column voltage_v: not finite"),
        ("time_s,current_a,displacement_um\n0,0,0\n0.1,1,1\n", "bad.csv: no column voltage_v"),
    ],
)
def test_the_commands_refuse_it_in_one_line(
    command: str,
    rows: Recording | str,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    if isinstance(rows, str):
        Path("bad.csv").write_text(rows)
    else:
        write_recording(rows, "bad.csv")
    assert run([command, "bad.csv", "--output", "result"]) == 2
    told = capsys.readouterr()
    *progress, line = told.err.splitlines()
    assert line.startswith(f"fomrc: {message}")
    assert all(shown.startswith((f"{command}: ", "read bad.csv: ")) for shown in progress)
    assert told.out == ""
    assert not [path for path in tmp_path.rglob("*") if path.is_file() and path.name != "bad.csv"]

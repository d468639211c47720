"""What a recording is good for is said, and the drives that are proposed are drives."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from small_model import MODEL

from fomrc_core.cli.application import run
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording
from fomrc_core.report.drive_to_add import DriveLimits
from fomrc_core.report.recording_check import RecordingCheck, check_recordings
from fomrc_core.storage import write_recording

_RATE_HZ = 500.0


def measured(time_s: np.ndarray, voltage_v: np.ndarray, seed: int = 0) -> Recording:
    moved = PiezoModel.from_mapping(MODEL).simulate(np.full(time_s.size, 1.0 / _RATE_HZ), voltage_v)
    noise = 1e-3 * np.random.default_rng(seed).normal(size=time_s.size)
    return Recording(time_s, voltage_v, moved + noise, name="checked")


def poor() -> Recording:
    t = np.arange(0.0, 8.0, 1.0 / _RATE_HZ)
    return measured(t, 0.5 * np.sin(2.0 * np.pi * t))


def rich() -> Recording:
    drive = triangle(2.0, slope_v_per_s=2.0, n_cycles=8, rate_hz=_RATE_HZ)
    rest = np.repeat([1.2, 2.0, 0.4, 0.0], int(8 * _RATE_HZ))
    voltage = np.concatenate((drive.voltage_v, rest, drive.voltage_v))
    return measured(np.arange(voltage.size) / _RATE_HZ, voltage)


@pytest.fixture(scope="module")
def of_poor() -> RecordingCheck:
    return check_recordings([poor()], limits=DriveLimits(2.0, time_s=200.0), n_elements=3)


def test_one_loop_is_not_enough_and_what_is_lacking_is_proposed(of_poor: RecordingCheck, tmp_path, monkeypatch) -> None:
    assert not of_poor.is_good
    assert of_poor.uncertainty.n_determined < 3
    proposed = {addition.command.split()[2] for addition in of_poor.additions}
    assert "triangle" in proposed
    monkeypatch.chdir(tmp_path)
    for addition in of_poor.additions:
        assert run(shlex.split(addition.command)[1:]) == 0, addition
        drive = np.loadtxt(tmp_path / f"{addition.command.split()[2]}.csv", delimiter=",", skiprows=1)
        assert np.max(np.abs(drive[:, 1])) <= 2.0 * (1.0 + 1e-9)
        assert drive[-1, 0] <= 200.0


def test_loops_of_many_widths_rests_and_a_repeat_are_better(of_poor: RecordingCheck) -> None:
    found = check_recordings([rich()], n_elements=3)
    assert found.uncertainty.n_determined > of_poor.uncertainty.n_determined
    assert found.order_error < of_poor.order_error
    assert found.drive.repeats
    assert not of_poor.drive.repeats or of_poor.drive.n_loop_kinds < found.drive.n_loop_kinds
    assert found.detectable
    # a cause shows from a smaller size on where more is recorded of it
    shared = [c for c in found.detectable if c in of_poor.detectable]
    assert shared


def test_a_rate_that_steps_cannot_keep_to_leaves_none() -> None:
    found = check_recordings([poor()], limits=DriveLimits(2.0, rate_v_per_s=1.0, time_s=5.0))
    assert all(a.command == "" for a in found.additions if "rests" in a.why or "widths" in a.why)


def test_the_command_prints_and_writes_it(tmp_path: Path, capsys) -> None:
    write_recording(poor(), tmp_path / "poor.csv")
    assert run(["check", str(tmp_path / "poor.csv"), "--max-voltage", "2", "--json", str(tmp_path / "c.json")]) == 0
    printed = capsys.readouterr().out
    assert "not yet enough" in printed
    assert "record next" in printed
    told = json.loads((tmp_path / "c.json").read_text())
    assert told["is_good"] is False
    assert {"drive", "uncertainty", "detectable", "record_next"} <= set(told)


@pytest.mark.parametrize("options", [["--max-voltage", "-1"], ["--max-time", "0"], ["--elements", "0"]])
def test_bad_limits_are_one_line(tmp_path: Path, capsys, options: list[str]) -> None:
    write_recording(poor(), tmp_path / "poor.csv")
    assert run(["check", str(tmp_path / "poor.csv"), *options]) == 2
    assert len([line for line in capsys.readouterr().err.splitlines() if line.startswith("fomrc: ")]) == 1

"""``fomrc watch``: a line, a page and JSON for a change, and none where there is none."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from small_model import MODEL

from fomrc_core.cli.application import run
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.recording import Recording
from fomrc_core.storage import read_model, write_model, write_recording

RATE_HZ, CHANGED_S = 50.0, 140.0
STAGE = PiezoModel.from_mapping(MODEL)


def recorded(path: Path, duration_s: float, factor: float = 1.0, rate_hz: float = RATE_HZ) -> str:
    time_s = np.arange(round(duration_s * rate_hz)) / rate_hz
    drive = 1.2 * np.sin(0.9 * time_s) + 0.8 * np.sin(2.3 * time_s + 1.0) - 0.8 * np.sin(1.0)
    moved = STAGE.simulate(np.full(time_s.size, 1.0 / rate_hz), drive)
    moved = np.where(time_s > CHANGED_S, factor * moved, moved)
    noise = np.random.default_rng(1).normal(0.0, 1e-3, time_s.size)
    write_recording(Recording(time_s, drive, moved + noise), path)
    return str(path)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_model(STAGE, tmp_path / "m.yaml", 1e-3)
    return tmp_path


def test_a_change_is_told_with_a_page_and_an_extended_model(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = recorded(here / "work.csv", 240.0, factor=1.02)
    assert run(["watch", record, "-m", "m.yaml", "-o", "seen", "--json", "seen.json", "--learn", "60"]) == 0
    told = capsys.readouterr()
    assert told.out.startswith("sensor_scale (relative_change 0.0")
    assert "1 changes noticed" in told.err
    (change,) = json.loads((here / "seen.json").read_text())["changes"]
    assert change["causes"][0]["parameters"]["relative_change"] == pytest.approx(0.02, rel=0.05)
    assert abs(change["since_s"] - CHANGED_S) < 3.0
    assert change["noticed_s"] < CHANGED_S + 20.0
    folder = here / "seen" / "change_1"
    assert json.loads((folder / "change.json").read_text()) == change
    assert "sensor_scale" in (folder / "change.html").read_text()
    extended = read_model(folder / "extended_model.yaml")
    np.testing.assert_allclose(extended.kappa_um_per_v, 1.02 * STAGE.kappa_um_per_v, rtol=2e-3)


def test_records_of_one_stage_go_on_where_the_last_one_ended(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    records = [recorded(here / name, 100.0) for name in ("one.csv", "two.csv")]
    assert run(["watch", *records, "-m", "m.yaml", "--learn", "60"]) == 0
    told = capsys.readouterr()
    assert told.out == "no change noticed\n"
    assert "200 s watched" in told.err


def test_too_little_motion_is_said(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["watch", recorded(here / "short.csv", 50.0), "-m", "m.yaml"]) == 0
    assert "too little motion" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["watch", "none.csv", "-m", "m.yaml", "-o", "seen"], "none.csv: no such file"),
        (["watch", "one.csv", "-m", "none.yaml"], "none.yaml: no such file"),
        (["watch", "one.csv", "-m", "m.yaml", "--learn", "1"], "learn_s: out of range, got 1.0"),
        (["watch", "one.csv", "-m", "m.yaml", "--json", "one.csv"], "one.csv"),
        (["watch", "one.csv", "fast.csv", "-m", "m.yaml"], "fast.csv: sampled at another period"),
    ],
)
def test_bad_input_is_one_line(here: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str) -> None:
    recorded(here / "one.csv", 30.0)
    recorded(here / "fast.csv", 30.0, rate_hz=80.0)
    assert run(arguments) == 2
    told = capsys.readouterr().err.strip().splitlines()
    assert said in told[-1]
    assert not (here / "seen").exists(), "nothing was watched"

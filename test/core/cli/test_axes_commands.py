"""``fomrc identify-axes`` stopped in the middle and begun again; ``compensate`` of several axes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from benchmarks.axes_inverse import N_SAMPLES, targets
from benchmarks.axes_inverse import RATE_HZ as TARGET_RATE_HZ
from benchmarks.axes_inverse import stage as ringing_stage
from fomrc_core.cli.application import run
from fomrc_core.model.axes import AxesModel
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.storage import write_columns
from fomrc_core.storage.axes_files import write_axes_model
from test.hidden.axes_truth import RATE_HZ, record, stage


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    truth = stage(2, 0)
    for r in range(3):
        u, y = (np.concatenate(list(np.moveaxis(a, 2, 0))) for a in record(truth, 1.0, r))
        columns = {f"voltage_{k + 1}_v": u[:, k] for k in range(2)} | {
            f"displacement_{k + 1}_um": y[:, k] for k in range(2)
        }
        np.savez(tmp_path / f"r{r}.npz", time_s=np.arange(len(u)) / RATE_HZ, **columns)  # type: ignore[arg-type]
    return tmp_path


def _words(output: str) -> list[str]:
    return ["identify-axes", "r0.npz", "r1.npz", "r2.npz", "--periods", "2", "-o", output]


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_stopped_it_goes_on_where_it_was(here: Path, how: signal.Signals, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*_words("whole.yaml"), "--json", "whole.json"]) == 0
    written = json.loads((here / "whole.json").read_text())
    assert len(written["standard_errors"]["frequency_hz"]) == len(written["model"]["axes"]["mode_frequency_hz"])
    assert "+-" in capsys.readouterr().out
    unfinished = here / "m.yaml.unfinished"
    command = [sys.executable, "-m", "fomrc_core.cli", *_words("m.yaml")]
    process = subprocess.Popen(
        command,
        cwd=here,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ},
        # what a shell runs in the background ignores SIGINT, and so does all that is begun from there
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    deadline = time.monotonic() + 60.0
    while not unfinished.exists():
        assert process.poll() is None, "it ended before it had kept anything"
        assert time.monotonic() < deadline, "nothing was kept within a minute"
        time.sleep(0.005)
    process.send_signal(how)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == (130 if how is signal.SIGINT else -signal.SIGKILL)
    if how is signal.SIGINT:
        assert "fits are kept in m.yaml.unfinished, the same command goes on there" in said
    assert not (here / "m.yaml").exists()
    assert run(_words("m.yaml")) == 0
    assert "goes on where it stopped" in capsys.readouterr().err
    assert (here / "m.yaml").read_bytes() == (here / "whole.yaml").read_bytes()
    assert not unfinished.exists()


def test_options_of_one_axis_are_refused_with_several(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["diagnose", "r0.npz", "--model", "m.yaml", "-o", "result"]
    for options in (["--thorough"], ["--report", "r1.npz"]):
        assert run([*command, *options]) == 2
        said = capsys.readouterr().err.splitlines()
        assert f"{options[0]}: not with several axes" in said[-1]
        assert len(said) == 1
        assert not (here / "result").exists()


def test_several_axes_are_compensated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    model, desired_um = ringing_stage(2, 0), targets(2, 100.0, 2.0)
    write_axes_model(model, "m.yaml")
    time_s = np.arange(N_SAMPLES) / TARGET_RATE_HZ
    columns = {"time_s": time_s, "desired_1_um": desired_um[:, 0], "desired_2_um": desired_um[:, 1]}
    write_columns(columns, "t.csv")
    words = ["compensate", "-m", "m.yaml", "-i", "t.csv", "-o", "v.csv"]
    assert run(words) == 0
    told = capsys.readouterr().err
    assert "axis 1: voltage between" in told
    assert "axis 2: 4096 samples at 6400 Hz: largest error by the model" in told
    names = (tmp_path / "v.csv").read_text().splitlines()[0].split(",")
    assert names == ["time_s", "voltage_1_v", "voltage_2_v", "desired_1_um", "desired_2_um"]
    voltage_v = np.loadtxt("v.csv", delimiter=",", skiprows=1)[:, 1:3]
    moved_um = model.simulate(np.full(N_SAMPLES, 1.0 / TARGET_RATE_HZ), voltage_v)
    assert np.abs(moved_um - desired_um)[512:-512].max() < 1e-6
    assert run([*words[:-1], "w.csv", "--max-voltage", "0.5"]) == 2
    assert "asks for more than the limit" in capsys.readouterr().err
    assert not (tmp_path / "w.csv").exists()
    write_columns({"time_s": time_s, "desired_um": desired_um[:, 0]}, "one.csv")
    assert run(["compensate", "-m", "m.yaml", "-i", "one.csv", "-o", "v.csv"]) == 2
    assert "one.csv: no column desired_1_um" in capsys.readouterr().err
    line = PiezoModel(np.array([4.0, 6.0]), np.array([0.5]), 0.01)
    write_axes_model(AxesModel((line, line), coupling=np.ones((3, 2))), "fewer.yaml")
    assert run(["compensate", "-m", "fewer.yaml", "-i", "t.csv", "-o", "v.csv"]) == 2
    assert "model.axes: no inverse, got (3, 2) (allowed: as many outputs as inputs)" in capsys.readouterr().err
    write_axes_model(AxesModel((line, line), coupling=np.array([[1.0, 0.1], [0.2, 1.0]])), "static.yaml")
    assert run(["compensate", "-m", "static.yaml", "-i", "t.csv", "-o", "v.csv"]) == 0

"""``fomrc identify-axes`` stopped in the middle, and begun again."""

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

from fomrc_core.cli.application import run
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
    process = subprocess.Popen(command, cwd=here, stderr=subprocess.PIPE, text=True, env={**os.environ})
    while not unfinished.exists() and process.poll() is None:
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

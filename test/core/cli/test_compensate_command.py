"""``fomrc compensate`` on a stage that rings and answers late: what it writes, says and refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fomrc_core.cli.application import run
from fomrc_core.storage import read_model, write_columns

_MODEL = """/**:
  ros__parameters:
    model:
      kappa_um_per_v: [20.0, 12.0, 9.0, 1.4]
      saturation_v: [0.02, 0.07, 0.2]
      creep_order: 0.015
      effects: [amplifier_bandwidth, mechanical_resonance, transport_delay]
      amplifier_bandwidth: {cutoff_hz: 500.0}
      mechanical_resonance: {frequency_hz: 300.0, damping_ratio: 0.02}
      transport_delay: {delay_s: 0.0005}
"""
_N = 1000


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.yaml").write_text(_MODEL)
    along = np.arange(_N) / _N
    scan_um = 2.0 * np.abs(2.0 * np.abs(2.0 * along - 1.0) - 1.0) - 1.0
    write_columns({"time_s": 1e-4 * np.arange(_N), "desired_um": scan_um}, tmp_path / "scan.csv")
    return tmp_path


def _compensate(*options: str) -> int:
    return run(["compensate", "-m", "model.yaml", "-i", "scan.csv", "-o", "v.csv", *options])


def _columns(path: Path) -> dict[str, np.ndarray]:
    names = path.read_text().splitlines()[0].split(",")
    return dict(zip(names, np.loadtxt(path, delimiter=",", skiprows=1).T, strict=True))


def test_a_scan_for_ever_is_written_and_what_it_asks_is_told(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _compensate("--periodic", "--bandwidth", "150", "--capacitance", "1.8e-6") == 0
    told = capsys.readouterr().err
    written = _columns(here / "v.csv")
    assert list(written) == ["time_s", "voltage_v", "desired_um"]
    rate = float(np.max(np.abs(np.diff(np.append(written["voltage_v"], written["voltage_v"][0])))) / 1e-4)
    assert f"largest voltage {np.max(np.abs(written['voltage_v'])):.4g} V, largest rate {rate:.4g} V/s" in told
    assert f"largest current {1.8e-6 * rate:.4g} A" in told
    assert "one period of 1000 samples, 0.1 s" in told
    played = read_model(here / "model.yaml").simulate(np.full(15 * _N, 1e-4), np.tile(written["voltage_v"], 15))
    off_um = np.abs(played[-_N:] - written["desired_um"])
    assert np.max(off_um) < 1e-3 * np.ptp(written["desired_um"])


def test_a_rate_for_a_converter(here: Path) -> None:
    assert _compensate("--periodic", "--bandwidth", "150", "--rate", "20000") == 0
    written = _columns(here / "v.csv")
    assert written["time_s"].size == 2 * _N
    np.testing.assert_allclose(np.diff(written["time_s"]), 5e-5, rtol=1e-9)


def test_when_the_stage_arrives(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    along = np.clip((np.arange(2 * _N) - 500) / 300.0, 0.0, 1.0)
    write_columns({"time_s": 1e-4 * np.arange(2 * _N), "desired_um": along**2 * (3.0 - 2.0 * along)}, here / "scan.csv")
    assert _compensate("--arrival-tolerance", "0.001") == 0
    line = next(line for line in capsys.readouterr().err.splitlines() if line.startswith("arrives within"))
    assert 0.075 < float(line.split(": ")[1].split()[0]) < 0.082


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--max-voltage", "0.4"), "voltage_v: sample "),
        (("--max-rate", "10"), "rate of voltage_v: sample 0 (at 0 s)"),
        (("--bandwidth", "6000"), "bandwidth_hz: out of range, got 6000.0 (allowed: above 0, at most 2000 Hz"),
        (("--bandwidth", "-1"), "--bandwidth: out of range, got -1.0"),
        (("--rate", "nan"), "--rate: is not a finite number"),
        (("--capacitance", "0"), "--capacitance: out of range, got 0.0"),
        (("--arrival-tolerance", "-1"), "--arrival-tolerance: out of range"),
        (("--max-voltage", "1", "--min-voltage", "2"), "--max-voltage: out of range, got 1.0"),
        (("--max-rate", "0"), "--max-rate: out of range"),
    ],
)
def test_what_cannot_be_is_told_in_a_line_and_nothing_is_written(
    here: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...], message: str
) -> None:
    assert _compensate("--periodic", *options) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("fomrc: ")
    assert message in last
    assert not (here / "v.csv").exists()


def test_uneven_times_are_told(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "scan.csv").write_text("time_s,desired_um\n0,0\n0.1,1\n0.3,2\n0.4,1\n")
    assert _compensate() == 2
    assert "not evenly spaced: after sample 1" in capsys.readouterr().err
    assert _compensate("--rate", "2000", "--bandwidth", "20") == 0


def test_a_resonance_near_the_sample_rate_is_told(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _compensate("--periodic", "--rate", "750", "--bandwidth", "50") == 0
    assert "rings at 300 Hz, near the sample rate of 750 Hz" in capsys.readouterr().err

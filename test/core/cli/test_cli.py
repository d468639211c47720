"""The command line: what it writes, what it says, and one line with exit status 2 for bad input."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fomrc_core.cli.application import run
from fomrc_core.cli.progress import progress_shown
from fomrc_core.diagnosis import work_budget
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording
from fomrc_core.storage import measured_examples as data_sources
from fomrc_core.storage import read_model, read_recording, write_columns, write_recording

_ROOT = Path(__file__).resolve().parents[3]
_TABLE_1 = _ROOT / "config" / "pi_p753_table1.yaml"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def measured(here: Path) -> Path:
    """A record of the paper's actuator under a triangle, offset 40 um, 1 nm of noise."""
    drive = triangle(slope_v_per_s=5.0, n_cycles=2, rate_hz=500.0)
    moved_um = read_model(_TABLE_1).simulate(np.full(drive.n_samples, 1 / 500), drive.voltage_v)
    noise_um = np.random.default_rng(0).normal(0.0, 1e-3, drive.n_samples)
    write_recording(Recording(drive.time_s, drive.voltage_v, moved_um + 40.0 + noise_um), here / "stage.csv")
    return here / "stage.csv"


def _table(path: Path) -> tuple[list[str], np.ndarray]:
    return path.read_text().splitlines()[0].split(","), np.loadtxt(path, delimiter=",", skiprows=1).T


def test_simulate_writes_its_columns_and_tells_offset_and_state(
    measured: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["simulate", "--model", str(_TABLE_1), "--input", "stage.csv", "--output", "out.csv"]) == 0
    names, values = _table(measured.parent / "out.csv")
    assert names == ["time_s", "voltage_v", "simulated_um", "displacement_um", "residual_um"]
    np.testing.assert_array_equal(values[4], values[3] - values[2])
    assert np.std(values[4]) < 1.2e-3
    told = capsys.readouterr().err
    assert "initial state: relaxed (estimated); offset 40" in told
    assert "NRMSE 0.0" in told


def test_simulate_can_be_told_that_the_record_begins_relaxed(
    measured: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--input", "stage.csv", "--output", "out.csv", "--initial-state", "relaxed"]
    assert run(["simulate", "--model", str(_TABLE_1), *options]) == 0
    assert "relaxed (as told)" in capsys.readouterr().err


def test_simulate_without_displacement_writes_only_what_there_is(here: Path) -> None:
    assert run(["excite", "triangle", "--slope", "10", "--cycles", "1", "--output", "drive.csv"]) == 0
    assert run(["simulate", "--model", str(_TABLE_1), "--input", "drive.csv", "--output", "out.csv.gz"]) == 0
    assert read_recording(here / "out.csv.gz").n_samples == read_recording(here / "drive.csv").n_samples
    assert (here / "out.csv.gz").read_bytes()[:2] == b"\x1f\x8b"


def test_compensate_then_simulate_gives_the_target(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time_s = np.arange(4000) * 1e-3
    desired_um = 1.5 * np.sin(2.0 * np.pi * time_s) * np.exp(-0.2 * time_s)
    write_columns({"time_s": time_s, "desired_um": desired_um}, here / "target.csv")
    assert run(["compensate", "--model", str(_TABLE_1), "--input", "target.csv", "--output", "v.csv"]) == 0
    assert "relaxed at first" in capsys.readouterr().err
    names, _ = _table(here / "v.csv")
    assert names == ["time_s", "voltage_v", "desired_um"]
    assert run(["simulate", "--model", str(_TABLE_1), "--input", "v.csv", "--output", "out.csv"]) == 0
    np.testing.assert_allclose(_table(here / "out.csv")[1][2], desired_um, atol=1e-12)


def test_compensate_names_what_it_does_not_invert(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = _TABLE_1.read_text() + "      effects: [mains_hum]\n"
    text += "      mains_hum: {frequency_hz: 50.0, amplitude_um: 0.01, phase_rad: 0.0}\n"
    (here / "model.yaml").write_text(text)
    (here / "target.csv").write_text("time_s,desired_um\n0,0\n0.1,1\n0.2,2\n")
    assert run(["compensate", "--model", "model.yaml", "--input", "target.csv", "--output", "v.csv"]) == 0
    assert "mains_hum" in capsys.readouterr().err


def test_identify_writes_a_model_that_simulates_the_record(measured: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--elements", "6", "--test", "stage.csv", "--output", "model.yaml", "--json", "fit.json"]
    assert run(["identify", "stage.csv", *options]) == 0
    told = capsys.readouterr()
    assert "creep order" in told.out
    assert "held out (stage.csv)" in told.out
    assert "identify:" in told.err
    results = json.loads((measured.parent / "fit.json").read_text())
    assert results["nrmse_percent"] < 0.5
    assert results["records"] == ["stage.csv"]
    model = read_model(measured.parent / "model.yaml")
    assert model.n_elements == 6
    assert results["model"]["creep_order"] == model.creep_order
    assert run(["simulate", "-m", "model.yaml", "-i", "stage.csv", "-o", "out.csv"]) == 0
    residual_um = _table(measured.parent / "out.csv")[1][4]
    assert 100.0 * np.std(residual_um) / np.ptp(read_recording(measured).measured_um) < 0.5


def test_identify_says_how_sure_each_parameter_is(measured: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--elements", "4", "--output", "model.yaml", "--json", "fit.json", "--uncertainty"]
    assert run(["identify", "stage.csv", *options]) == 0
    assert "element 4: kappa" in capsys.readouterr().out
    results = json.loads((measured.parent / "fit.json").read_text())
    low, high = results["uncertainty"]["creep_order_interval"]
    assert low < results["creep_order"] < high
    assert [element["number"] for element in results["uncertainty"]["elements"]] == [1, 2, 3, 4]
    assert f"fit_rms_um: {results['rms_um']!r}" in (measured.parent / "model.yaml").read_text()
    assert read_model(measured.parent / "model.yaml").n_elements == 4


def test_a_diagnosis_that_was_cut_short_says_how_to_go_on(
    measured: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(work_budget, "_FOR_CAUSES", 0.0)
    words = "--thorough goes on where the search was cut short"
    assert run(["diagnose", "stage.csv", "--model", str(_TABLE_1), "--output", "result"]) == 0
    assert words in capsys.readouterr().err
    assert run(["diagnose", "stage.csv", "--model", str(_TABLE_1), "--output", "result", "--thorough"]) == 0
    assert words not in capsys.readouterr().err


def test_diagnose_writes_findings_report_and_a_model_that_runs_at_once(
    measured: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["diagnose", "stage.csv", "--model", str(_TABLE_1), "--output", "result"]) == 0
    told = capsys.readouterr()
    assert told.out.startswith("status: ")
    assert "diagnose:" in told.err
    folder = measured.parent / "result"
    diagnosis = json.loads((folder / "diagnosis.json").read_text())
    assert {"status", "noise_floor_um", "baseline", "findings", "ambiguous_with", "unexplained_percent"} <= set(
        diagnosis
    )
    assert {"smallest_detectable", "next_experiment"} <= set(diagnosis)
    assert diagnosis["status"] == "nothing_found"
    assert "<html" in (folder / "report.html").read_text()[:500].lower()
    options = ["--model", "result/extended_model.yaml", "--input", "stage.csv", "--output", "out.csv"]
    assert run(["simulate", *options]) == 0
    assert np.std(_table(measured.parent / "out.csv")[1][4]) < 1.2e-3


def test_plain_columns_are_read_as_told(measured: Path) -> None:
    record = read_recording(measured)
    rows = np.column_stack((np.full(record.n_samples, 9.0), record.voltage_v, record.measured_um))
    np.savetxt("stage.dat", rows, fmt="%.9f")
    options = ["--columns", "time=none,voltage=1,displacement=2", "--rate", "500", "--output", "out.csv"]
    assert run(["simulate", "--model", str(_TABLE_1), "--input", "stage.dat", *options]) == 0
    assert np.std(_table(measured.parent / "out.csv")[1][4]) < 1.2e-3


@pytest.mark.parametrize(
    ("arguments", "n_samples"),
    [
        (["relax", "--duration", "2", "--rest", "0.5"], 2526),
        (["triangle", "--slope", "10", "--unipolar", "--cycles", "1"], 501),
        (["staircase", "--step", "1", "--amplitude", "2", "--dwell", "0.1", "--cycles", "1"], 900),
        (["steps", "--levels", "-1,2.5,0", "--dwell", "0.2", "--lead-in", "0.1"], 700),
        (["multisine", "--period", "1", "--periods", "2", "--lowest", "1", "--offset", "50"], 2000),
    ],
)
def test_excite_writes_drives(here: Path, arguments: list[str], n_samples: int) -> None:
    assert run(["excite", *arguments, "--output", "drive.csv"]) == 0
    drive = read_recording(here / "drive.csv")
    assert drive.n_samples == n_samples
    assert drive.displacement_um is None


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ([], "Usage: fomrc"),
        (["simulat"], "No such command"),
        (["simulate", "--model", "none.yaml"], "Missing option '--input'"),
        (["simulate", "-m", "none.yaml", "-i", "stage.csv", "-o", "x.csv"], "none.yaml: no such file"),
        (["simulate", "-m", "stage.csv", "-i", "stage.csv", "-o", "x.csv"], "stage.csv: "),
        (["simulate", "-m", "TABLE", "-i", "none.csv", "-o", "x.csv"], "none.csv: no such file"),
        (
            ["simulate", "-m", "TABLE", "-i", "broken.csv", "-o", "x.csv"],
            "broken.csv, line 3, column voltage_v",
        ),
        (["simulate", "-m", "TABLE", "-i", "stage.csv", "-o", "no/x.csv"], "no: no such folder"),
        (["simulate", "-m", "TABLE", "-i", "stage.csv", "-o", "x.csv", "--initial-state", "warm"], "'warm'"),
        (["compensate", "-m", "TABLE", "-i", "stage.csv", "-o", "x.csv"], "no column desired_um"),
        (["identify", "stage.csv"], "Missing option '--output'"),
        (["identify", "-o", "m.yaml"], "Missing argument"),
        (["identify", "stage.csv", "-o", "m.yaml", "--elements", "ten"], "--elements: not a number, got 'ten'"),
        (["identify", "stage.csv", "-o", "m.yaml", "--elements", "0"], "n_elements"),
        (["identify", "stage.csv", "-o", "m.yaml", "--method", "guess"], "'guess'"),
        (["identify", "drive.csv", "-o", "m.yaml"], "drive.csv: no displacement recorded"),
        (["identify", "short.csv", "-o", "m.yaml"], "short.csv: record is too short, got 3"),
        (
            ["identify", "stage.csv", "-o", "m.yaml", "--columns", "voltage=a"],
            "--columns voltage: not a column number",
        ),
        (["identify", "stage.csv", "-o", "m.yaml", "--columns", "voltage"], "--columns: not understood"),
        (["identify", "stage.csv", "-o", "m.yaml", "--rate", "fast"], "'--rate': "),
        (
            ["identify", "stage.csv", "-o", "m.yaml", "--topics", "voltage=/v"],
            "topics are for rosbag2 folders",
        ),
        (["diagnose", "none.csv", "-o", "result"], "none.csv: no such file"),
        (["diagnose", "drive.csv", "-o", "result"], "drive.csv: no displacement recorded"),
        (["diagnose", "stage.csv", "-o", "stage.csv"], "--output: folder cannot be made"),
        (["diagnose", "stage.csv", "-o", "result", "--model", "none.yaml"], "none.yaml: no such file"),
        (["compare", "stage.csv", "-o", "result"], "Missing option '--test'"),
        (["compare", "stage.csv", "--test", "none.csv", "-o", "result"], "none.csv: no such file"),
        (
            ["compare", "stage.csv", "--test", "stage.csv", "-o", "r", "--models", "neural"],
            "--models: no such model, got",
        ),
        (
            ["compare", "stage.csv", "--test", "stage.csv", "-o", "r", "--models", "preisach,"],
            "--models: no such model, got",
        ),
        (["reproduce", "-o", "stage.csv"], "--output: folder cannot be made"),
        (["excite"], "Usage: fomrc excite"),
        (["excite", "square", "-o", "x.csv"], "No such command"),
        (["excite", "triangle", "-o", "x.csv", "--slope", "0"], "slope_v_per_s: out of range, got 0.0"),
        (["excite", "triangle", "-o", "x.csv", "--slope", "steep"], "got 'steep'"),
        (["excite", "triangle", "-o", "x.csv", "--slope=steep"], "got 'steep'"),
        (
            ["excite", "steps", "-o", "x.csv", "--levels", "1,two"],
            "--levels: not a list of numbers, got '1,two'",
        ),
        (["data", "pea_2hz"], "no such data set, got 'pea_2hz'"),
    ],
)
def test_bad_input_is_one_line_and_exit_status_2(
    measured: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], expected: str
) -> None:
    (measured.parent / "broken.csv").write_text("time_s,voltage_v\n0,1\n1,volt\n")
    (measured.parent / "short.csv").write_text("time_s,voltage_v,displacement_um\n0,1,2\n1,2,3\n2,3,4\n")
    write_recording(triangle(slope_v_per_s=10.0).to_recording(), measured.parent / "drive.csv")
    before = set(os.listdir(measured.parent))
    assert run([str(_TABLE_1) if argument == "TABLE" else argument for argument in arguments]) == 2
    told = capsys.readouterr()
    if expected.startswith("Usage"):
        assert expected in told.out + told.err
        return
    assert expected in told.err
    *read, line = told.err.splitlines()
    assert line.startswith("fomrc: ")
    assert all(shown.startswith("read ") for shown in read)
    assert told.out == ""
    assert set(os.listdir(measured.parent)) - before <= {"result"}


def test_results_go_to_standard_output_and_talk_to_standard_error(measured: Path) -> None:
    command = [sys.executable, "-m", "fomrc_core.cli", "simulate", "-m", str(_TABLE_1), "-i", "stage.csv"]
    environment = os.environ | {"PYTHONPATH": str(_ROOT)}
    environment.pop("_ROS_WHEELS_BOOTSTRAP_COMPLETE", None)
    done = subprocess.run(
        [*command, "-o", "/dev/stdout"],
        capture_output=True,
        text=True,
        cwd=measured.parent,
        env=environment,
        check=False,
    )
    assert done.returncode == 0
    assert done.stdout.splitlines()[0] == "time_s,voltage_v,simulated_um,displacement_um,residual_um"
    assert "initial state" in done.stderr
    refused = subprocess.run(
        [*command, "-o", "no/out.csv"],
        capture_output=True,
        text=True,
        cwd=measured.parent,
        env=environment,
        check=False,
    )
    assert refused.returncode == 2
    assert refused.stderr.endswith("no: no such folder (allowed: an existing folder)\n")
    # A machine so busy that to load takes seconds is told that it loads; nothing else stands beside the line.
    assert len([line for line in refused.stderr.splitlines() if not line.startswith("loading: ")]) == 1


def test_help_imports_no_numerics() -> None:
    # What makes a command line slow to start is what it imports: nothing heavy before a command asks for it.
    script = (
        "import sys; from fomrc_core.cli.application import run; run(['--help']);"
        "print(sorted({'numpy', 'scipy', 'matplotlib', 'numba', 'yaml', 'pooch', 'rich'} & set(sys.modules)))"
    )
    environment = os.environ | {"PYTHONPATH": str(_ROOT)}
    environment.pop("_ROS_WHEELS_BOOTSTRAP_COMPLETE", None)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_the_demo_says_what_it_needs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert run(["demo"]) == 2
    assert capsys.readouterr().err.startswith("fomrc: demo needs fomrc_ros and rclpy")


def test_the_demo_runs_in_place_with_a_domain_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[tuple[list[str], dict[str, str]]] = []
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: object())
    monkeypatch.setattr(os, "execve", lambda _path, arguments, environment: started.append((arguments, environment)))
    monkeypatch.setenv("_ROS_WHEELS_BOOTSTRAP_COMPLETE", "1")
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    assert run(["demo", "--output", "folder"]) == 0
    ((arguments, environment),) = started
    assert arguments[1:] == ["-m", "fomrc_ros.demo", "--output", "folder"]
    assert 1 <= int(environment["ROS_DOMAIN_ID"]) <= 100
    assert environment["ROS_AUTOMATIC_DISCOVERY_RANGE"]
    assert "_ROS_WHEELS_BOOTSTRAP_COMPLETE" not in environment


def test_data_without_data_is_one_line(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "pea_1hz").mkdir()
    (here / "pea_1hz" / "model.dat").write_text("not this")
    monkeypatch.setenv("FOMRC_DATA", str(here))
    assert run(["data", "pea_1hz"]) == 2
    told = capsys.readouterr().err
    assert "not the known record" in told
    assert told.count("\n") == 1


def test_an_interrupt_is_no_error(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted(_: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(data_sources, "locate", interrupted)
    assert run(["data"]) == 130
    assert "Traceback" not in capsys.readouterr().err


def test_an_interrupt_that_a_module_being_loaded_made_an_import_error_of_is_none(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def loaded(_: str) -> None:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as interrupt:
            raise ImportError("initialization failed") from interrupt

    monkeypatch.setattr(data_sources, "locate", loaded)
    assert run(["data"]) == 130
    assert capsys.readouterr().err == ""

    def broken(_: str) -> None:
        raise ImportError("initialization failed")

    monkeypatch.setattr(data_sources, "locate", broken)
    with pytest.raises(ImportError, match="initialization failed"):
        run(["data"])


def test_progress_is_a_line_per_stage_where_there_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_shown("fit") as progress:
        for share, text in ((0.0, "start"), (0.5, "weights"), (0.6, "weights"), (1.0, "end")):
            progress(share, text)
    assert capsys.readouterr().err.splitlines() == [
        "fit:   0 % start",
        "fit:  50 % weights",
        "fit: 100 % end",
    ]


def test_the_doctor_says_what_is_there_and_what_is_missing(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "h5py" else found(name))
    assert run(["doctor"]) == 0
    told = capsys.readouterr().out
    assert "h5py: missing, needed for HDF5 and MATLAB 7.3 files" in told
    assert "numba: " in told

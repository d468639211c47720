"""No command writes its results over what it reads, nor learns only after the work that it cannot write them."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numpy as np
import pytest

from fomrc_core.cli.application import run
from fomrc_core.errors import StorageError
from fomrc_core.identification import convex
from fomrc_core.storage import check_outputs, files_in, write_columns

_ROOT = Path(__file__).resolve().parents[3]
_TABLE_1 = _ROOT / "config" / "pi_p753_table1.yaml"


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    time_s = np.arange(400) * 0.01
    moved = np.sin(2.0 * np.pi * time_s)
    lagging = np.sin(2.0 * np.pi * time_s - 0.1)
    columns = {"time_s": time_s, "voltage_v": moved, "displacement_um": 1.3 * lagging, "desired_um": moved}
    for name in ("good.csv", "other.csv"):
        write_columns(columns, tmp_path / name)
    (tmp_path / "model.yaml").write_bytes(_TABLE_1.read_bytes())
    (tmp_path / "link.csv").symlink_to("good.csv")
    os.link(tmp_path / "good.csv", tmp_path / "hard.csv")
    (tmp_path / "sub").mkdir()
    (tmp_path / "result").mkdir()
    (tmp_path / "result" / "extended_model.yaml").write_bytes(_TABLE_1.read_bytes())
    return tmp_path


def _contents(folder: Path) -> dict[str, str]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@pytest.mark.parametrize(
    ("command", "expected"),
    [
        ("identify good.csv -o good.csv", "--output: is an input too, got 'good.csv'"),
        ("identify good.csv -o sub/../good.csv", "--output: is an input too"),
        ("identify good.csv -o link.csv", "--output: is an input too"),
        ("identify good.csv -o hard.csv", "--output: is an input too"),
        ("identify other.csv good.csv -o good.csv", "--output: is an input too"),
        ("identify other.csv --test good.csv -o good.csv", "--output: is an input too"),
        ("identify good.csv -o m.yaml --json good.csv", "--json: is an input too"),
        ("identify good.csv -o x --json x", "--json: is the file of --output too, got 'x'"),
        ("identify good.csv -o x --json sub/../x", "--json: is the file of --output too"),
        ("identify good.csv -o none/m.yaml", "none: no such folder"),
        ("identify good.csv -o m.yaml --json none/f.json", "none: no such folder"),
        ("identify good.csv -o sub", "sub: is a folder"),
        ("simulate -m model.yaml -i good.csv -o good.csv", "--output: is an input too"),
        ("simulate -m model.yaml -i good.csv -o model.yaml", "--output: is an input too"),
        ("compensate -m model.yaml -i good.csv -o good.csv", "--output: is an input too"),
        ("compensate -m model.yaml -i good.csv -o model.yaml", "--output: is an input too"),
        (
            "diagnose good.csv -m result/extended_model.yaml -o result",
            "--output (extended_model.yaml): is an input too",
        ),
    ],
)
def test_an_output_that_would_lose_a_file_is_refused_before_any_work(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, command: str, expected: str
) -> None:
    def begun(*_: object, **__: object) -> None:
        raise AssertionError("the work began")

    monkeypatch.setattr(convex, "identify", begun)
    before = _contents(here)
    assert run(command.split()) == 2
    told = capsys.readouterr().err
    assert expected in told
    assert told.count("\n") == 1
    assert _contents(here) == before


def test_another_name_for_a_result_that_exists_is_no_obstacle(here: Path) -> None:
    (here / "out.csv").write_text("an earlier result")
    assert run(["simulate", "-m", "model.yaml", "-i", "good.csv", "-o", "out.csv"]) == 0
    assert (here / "out.csv").read_text().startswith("time_s,voltage_v,simulated_um")


def test_pipes_and_devices_may_be_written_to_by_all(here: Path) -> None:
    check_outputs({"--output": "/dev/null", "--json": "/dev/null"}, [here / "good.csv"])


def test_nothing_is_written_into_a_folder_that_is_a_recording(here: Path) -> None:
    bag = here / "bag"
    bag.mkdir()
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: {}")
    with pytest.raises(StorageError, match=r"--output: lies in a recording"):
        check_outputs({"--output": bag / "metadata.yaml"}, [bag])
    with pytest.raises(StorageError, match=r"--output \(report\.html\): lies in a recording"):
        check_outputs(files_in(bag, ["report.html"]), [bag])
    assert files_in(here / "to be made", ["report.html"]) == {}


@pytest.mark.parametrize("name", ["/dev/zero", "/dev/null", "pipe"])
def test_a_pipe_or_a_device_is_no_recording(here: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    os.mkfifo(here / "pipe")
    assert run(["identify", name, "-o", "m.yaml"]) == 2
    assert f"{name}: is a pipe or a device (allowed: a file)" in capsys.readouterr().err


def test_the_header_found_is_shown_where_a_column_is_missing(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "drive.csv").write_text("time_s,drive,sensor\n0,1,2\n1,2,3\n")
    assert run(["identify", "drive.csv", "-o", "m.yaml"]) == 2
    assert (
        "drive.csv: the file does not say the unit of voltage and displacement, got 'time_s, drive, sensor'"
        in capsys.readouterr().err
    )
    assert run(["compensate", "-m", "model.yaml", "-i", "drive.csv", "-o", "v.csv"]) == 2
    assert "no column desired_um, got 'time_s,drive,sensor'" in capsys.readouterr().err
    (here / "drive.csv").write_text("voltage_v,sensor\n1,2\n2,3\n")
    assert run(["identify", "drive.csv", "-o", "m.yaml"]) == 2
    assert "no column time_s and no rate, got 'voltage_v,sensor'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ("multisine --seed -1", "seed: "),
        ("multisine --lowest 1e308", "lowest_hz: out of range"),
        ("multisine --period 1e308", "too many samples"),
        ("multisine --amplitude 1e308", "amplitude_v: out of range"),
        ("multisine --rate 1e308", "rate_hz: out of range"),
        ("relax --rate 1e308", "rate_hz: out of range"),
        ("relax --duration 1e308", "too many samples"),
        ("relax --rest 1e308", "too many samples"),
        ("relax --amplitude 5e-324", "amplitude_v: out of range"),
        ("triangle --slope 5e-324", "slope_v_per_s: out of range"),
        ("triangle --slope 1e9", "n_cycles: cycles fall between the samples"),
        ("triangle --amplitude 1e308", "amplitude_v: out of range"),
        ("triangle --cycles 99999999", "n_cycles: "),
        (f"triangle --cycles {'9' * 400}", "n_cycles: "),
        ("triangle --cycles 20000000", "too many samples"),
        ("staircase --cycles 99999999", "n_cycles: "),
        ("staircase --dwell 1e308", "too many samples"),
        ("staircase --step 1e-9", "too many samples"),
        ("staircase --amplitude 3.7e7", "amplitude_v: out of range"),
        ("steps --dwell 1e308", "too many samples"),
        ("steps --lead-in 1e308", "too many samples"),
        ("steps --levels 1e308", "levels_v: no levels to step to"),
        ("steps --offset 1e308", "offset_v: out of range"),
    ],
)
def test_a_drive_nobody_can_make_is_one_line(
    here: Path, capsys: pytest.CaptureFixture[str], arguments: str, expected: str
) -> None:
    assert run(["excite", *arguments.split(), "-o", "drive.csv"]) == 2
    told = capsys.readouterr().err
    assert expected in told
    assert told.count("\n") == 1
    assert not (here / "drive.csv").exists()


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    from fomrc_core import __version__

    assert run(["--version"]) == 0
    assert capsys.readouterr().out == f"fomrc {__version__}\n"


def test_running_out_of_memory_is_one_line(
    here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr(convex, "identify", full)
    assert run(["identify", "good.csv", "-o", "m.yaml"]) == 2
    told = capsys.readouterr().err
    assert told.splitlines()[-1].startswith("fomrc: not enough memory")

"""Files: what is written reads back bit for bit, and whatever is wrong is told in one line."""

from __future__ import annotations

import gzip
import os
import re
import stat
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fomrc_core.errors import InputError, StorageError
from fomrc_core.records.recording import Recording
from fomrc_core.storage import (
    read_recording,
    read_target,
    write_columns,
    write_recording,
    write_text,
)

_finite = st.floats(-1e6, 1e6, allow_subnormal=False)
_shared_folder = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)


def _file(folder: Path, text: str | bytes, name: str = "stage.csv") -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def _refusal(path: Path, **options: object) -> str:
    with pytest.raises(InputError) as caught:
        read_recording(path, **options)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    return str(caught.value)


# recordings as CSV


@_shared_folder
@given(data=st.data(), n=st.integers(2, 60), suffix=st.sampled_from(["csv", "csv.gz"]))
def test_recordings_read_back_bit_for_bit(tmp_path: Path, data: st.DataObject, n: int, suffix: str) -> None:
    time_s = np.cumsum(data.draw(arrays(np.float64, n, elements=st.floats(1e-3, 1e3))))
    columns = {
        name: data.draw(st.none() | arrays(np.float64, n, elements=_finite))
        for name in (
            "displacement_um",
            "desired_um",
            "temperature_c",
            "cross_voltage_v",
            "cross_displacement_um",
        )
    }
    voltage_v = data.draw(arrays(np.float64, n, elements=_finite))
    path = tmp_path / f"round.{suffix}"
    write_recording(Recording(time_s, voltage_v, **columns), path)
    again = read_recording(path)
    np.testing.assert_array_equal(again.time_s, time_s)
    np.testing.assert_array_equal(again.voltage_v, voltage_v)
    for name, values in columns.items():
        read = getattr(again, name)
        assert (read is None) == (values is None)
        if values is not None:
            np.testing.assert_array_equal(read, values)
    assert again.name == path.name


def test_gzip_is_known_by_its_content_not_its_name(tmp_path: Path) -> None:
    path = _file(tmp_path, gzip.compress(b"time_s,voltage_v\n0,1\n1,2\n"), "plain_name.csv")
    np.testing.assert_array_equal(read_recording(path).voltage_v, [1.0, 2.0])


@pytest.mark.parametrize(
    "text",
    [
        "TIME_S, Voltage_V ,displacement_UM\n0,1,2\n1,3,4\n",
        "\ufefftime_s,voltage_v,displacement_um\r\n0,1,2\r\n1,3,4\r\n",
        '"time_s","voltage_v","displacement_um"\n"0","1","2"\n"1","3","4"\n',
        "# a remark\n\ntime_s;voltage_v;displacement_um\n0;1;2\n\n# another\n1;3;4",
        "time_s\tvoltage_v\tdisplacement_um\n0\t1\t2\n1\t3\t4\n",
        "note,displacement_um,time_s,voltage_v\nfirst,2,0,1\nsecond,4,1,3\n",
    ],
)
def test_headers_as_programs_write_them(tmp_path: Path, text: str) -> None:
    recording = read_recording(_file(tmp_path, text))
    np.testing.assert_array_equal(recording.time_s, [0.0, 1.0])
    np.testing.assert_array_equal(recording.voltage_v, [1.0, 3.0])
    np.testing.assert_array_equal(recording.measured_um, [2.0, 4.0])


@pytest.mark.parametrize("voltage", ["cross_voltage_v", "second_voltage_v", "other_voltage_v", "voltage2_v"])
@pytest.mark.parametrize("moved", ["cross_displacement_um", "second_displacement_um", "Displacement2_um"])
def test_the_second_axis_goes_by_several_names(tmp_path: Path, voltage: str, moved: str) -> None:
    path = _file(tmp_path, f"time_s,voltage_v,{voltage},{moved}\n0,1,5,7\n1,2,6,8\n")
    recording = read_recording(path)
    assert recording.cross_voltage_v is not None
    assert recording.cross_displacement_um is not None
    np.testing.assert_array_equal(recording.cross_voltage_v, [5.0, 6.0])
    np.testing.assert_array_equal(recording.cross_displacement_um, [7.0, 8.0])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "stage.csv: empty file"),
        ("# only a remark\n\n", "stage.csv: empty file"),
        ("time_s,voltage_v\n", "no rows below the header"),
        ("time_s,voltage_v\n0,1\n", "too few samples, got 1"),
        ("time_s,displacement_um\n0,1\n1,2\n", "no column voltage_v, got 'time_s,displacement_um'"),
        ("voltage_v,displacement_um\n0,1\n1,2\n", "no column time_s and no rate"),
        ("0.0,1.0\n0.1,1.1\n", "line 1: no header line naming the columns, got '0.0,1.0'"),
        ("time_s,voltage_v\n0,1\n1,x\n2,3\n", "line 3, column voltage_v: not a number, got 'x'"),
        ("time_s,voltage_v\n0,1\n1,\n2,3\n", "line 3, column voltage_v: not a number, got ''"),
        ("time_s,voltage_v\n0,1\n# pause\n1,nan\n2,3\n", "line 4, column voltage_v: not finite, got 'nan'"),
        ("time_s,voltage_v\n0,1\n1,-inf\n2,3\n", "line 3, column voltage_v: not finite, got '-inf'"),
        ("time_s;voltage_v\n0;1\n1;2,5\n2;3\n", "line 3, column voltage_v: not a number, got '2,5'"),
        ("time_s,voltage_v\n0,1\n1,1_000\n2,3\n", "line 3, column voltage_v: not a number, got '1_000'"),
        ("time_s,voltage_v\n0,1\n1,2\n1,3\n", "line 4, column time_s: time does not increase, got 1.0"),
        ("time_s,voltage_v\n0,1\n\n2,2\n1,3\n", "line 5, column time_s: time does not increase, got 1.0"),
        (
            "time_s,voltage_v\n0,1\n1\n2,3\n",
            "line 3: row has another number of cells than the first row, got 1",
        ),
        (
            "time_s,voltage_v\n0,1,2\n1,2,3\n",
            "line 2: row has another number of cells than the header, got 3",
        ),
        ("time_s,voltage_v,voltage_v\n0,1,2\n1,2,3\n", "two columns are voltage_v"),
        ("time,voltage_v\n0,1\n1,2\n", "does not say the unit of time, got 'time, voltage_v'"),
    ],
)
def test_what_is_wrong_with_a_csv_is_told_with_its_line(tmp_path: Path, text: str, expected: str) -> None:
    message = _refusal(_file(tmp_path, text))
    assert expected in message
    assert "stage.csv" in message


def test_binary_junk_is_refused(tmp_path: Path) -> None:
    assert "not a text file" in _refusal(_file(tmp_path, bytes(range(256)) * 50))
    assert "zero bytes" in _refusal(_file(tmp_path, "time_s,voltage_v\n0,1\n\0\0\0\n"))


def test_damaged_gzip_is_refused(tmp_path: Path) -> None:
    whole = gzip.compress(b"time_s,voltage_v\n" + b"0,1\n" * 5000)
    assert "damaged gzip" in _refusal(_file(tmp_path, whole[: len(whole) // 2]))
    assert "damaged gzip" in _refusal(_file(tmp_path, whole[:20] + b"\xff" * 20 + whole[40:]))
    assert "damaged gzip" in _refusal(_file(tmp_path, b"\x1f\x8b"))


def test_missing_files_folders_and_closed_files_are_refused(tmp_path: Path) -> None:
    assert _refusal(tmp_path / "none.csv").endswith("none.csv: no such file")
    assert "is a folder" in _refusal(tmp_path)
    if os.geteuid() != 0:
        closed = _file(tmp_path, "time_s,voltage_v\n0,1\n1,2\n")
        closed.chmod(0)
        assert "cannot be read" in _refusal(closed)


@_shared_folder
@given(content=st.binary(max_size=400) | st.text(alphabet='time_svolag,\n0123.-e#" ;', max_size=200))
def test_any_file_at_all_gives_a_recording_or_one_line(tmp_path: Path, content: bytes | str) -> None:
    path = _file(tmp_path, content)
    for options in ({}, {"columns": {"time": 0, "voltage": 1}}):
        try:
            n_samples, message = read_recording(path, **options).n_samples, ""  # type: ignore[arg-type]
        except InputError as error:
            n_samples, message = 2, str(error)
        assert n_samples >= 2
        assert "\n" not in message


def test_any_separator_inside_a_line_does_not_split_it(tmp_path: Path) -> None:
    # U+2028 and form feed end a line for str.splitlines, but for no program that writes tables.
    path = _file(tmp_path, "note,time_s,voltage_v\na\u2028b,0,1\nc\x0cd,1,2\n")
    np.testing.assert_array_equal(read_recording(path).voltage_v, [1.0, 2.0])


# plain columns


@pytest.mark.parametrize("separator", [" ", "\t", "   ", ",", ";", ", "])
@pytest.mark.parametrize("header", ["", "U X Y D\n".replace(" ", "\t"), "% measured\n# twice\n"])
def test_plain_columns_by_number(tmp_path: Path, separator: str, header: str) -> None:
    rows = [[0.5, 9.0, 9.0, -3.0], [0.6, 9.0, 9.0, -2.0], [0.7, 9.0, 9.0, -1.0]]
    names = header.replace("\t", separator)
    text = names + "\n".join(separator.join(map(str, row)) for row in rows) + "\n"
    path = _file(tmp_path, text, "columns.dat")
    recording = read_recording(path, columns={"time": None, "voltage": 0, "displacement": 3}, rate_hz=200.0)
    np.testing.assert_array_equal(recording.time_s, [0.0, 0.005, 0.01])
    np.testing.assert_array_equal(recording.voltage_v, [0.5, 0.6, 0.7])
    np.testing.assert_array_equal(recording.measured_um, [-3.0, -2.0, -1.0])


def test_time_may_be_a_column_too(tmp_path: Path) -> None:
    path = _file(tmp_path, "1 5\n2 6\n4 7\n", "columns.dat")
    np.testing.assert_array_equal(read_recording(path, columns={"voltage": 1, "time": 0}).time_s, [1.0, 2.0, 4.0])


@pytest.mark.parametrize(
    ("columns", "rate_hz", "expected"),
    [
        ({"voltage": 0, "displacement": 7}, 100.0, "no such column for displacement, got 7 (allowed: 0..1)"),
        ({"voltage": -1}, 100.0, "no such column for voltage, got -1"),
        ({"voltage": True}, 100.0, "no such column for voltage, got True"),
        ({"displacement": 1}, 100.0, "columns does not say which is the voltage"),
        ({"volts": 0}, 100.0, "unknown quantity in columns, got 'volts'"),
        ({"voltage": 0}, None, "no column time_s and no rate"),
        ({"voltage": 0, "time": 1}, 100.0, "rate given though the file has time_s"),
        ({"voltage": 0}, 0.0, "rate must be positive, got 0.0"),
        ({"voltage": 0}, float("nan"), "rate must be positive, got nan"),
        ({"voltage": 0}, float("inf"), "rate must be positive, got inf"),
    ],
)
def test_wrong_columns_are_told(tmp_path: Path, columns: dict, rate_hz: float | None, expected: str) -> None:
    path = _file(tmp_path, "1 5\n2 6\n4 7\n", "columns.dat")
    assert expected in _refusal(path, columns=columns, rate_hz=rate_hz)


def test_a_bad_cell_of_a_plain_file_is_told_with_its_line(tmp_path: Path) -> None:
    path = _file(tmp_path, "1 5\n2 6\n4 oops\n", "columns.dat")
    assert "line 3, column voltage_v: not a number, got 'oops'" in _refusal(path, columns={"time": 0, "voltage": 1})


# targets, columns, atomic writing


def test_targets_need_only_time_and_desired_displacement(tmp_path: Path) -> None:
    path = _file(tmp_path, "desired_um,time_s\n1.5,0\n2.5,0.1\n", "target.csv")
    time_s, desired_um = read_target(path)
    np.testing.assert_array_equal(time_s, [0.0, 0.1])
    np.testing.assert_array_equal(desired_um, [1.5, 2.5])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("time_s,voltage_v\n0,1\n1,2\n", "no column desired_um"),
        ("time_s,desired_um\n0,1\n", "too few rows"),
        ("time_s,desired_um\n0,1\n0,2\n", "line 3, column time_s: time does not increase"),
        ("time_s,desired_um\n0,1\n1,nan\n", "line 3, column desired_um: not finite"),
    ],
)
def test_wrong_targets_are_told(tmp_path: Path, text: str, expected: str) -> None:
    with pytest.raises(StorageError, match=re.escape(expected)):
        read_target(_file(tmp_path, text, "target.csv"))


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "out.csv"
    write_text("old", path)

    def full_disk(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full_disk)
    with pytest.raises(StorageError, match=r"out\.csv: cannot be written \(No space left on device\)"):
        write_text("new", path)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["out.csv"]


def test_writing_where_nothing_can_be_written_is_told(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="no such folder"):
        write_text("x", tmp_path / "none" / "out.csv")
    with pytest.raises(StorageError, match="is a folder"):
        write_text("x", tmp_path)


def test_written_files_have_the_usual_permissions_and_links_stay_links(tmp_path: Path) -> None:
    target, link = tmp_path / "target.csv", tmp_path / "link.csv"
    target.write_text("old")
    usual = stat.S_IMODE(target.stat().st_mode)
    link.symlink_to(target)
    write_text("new", link)
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert stat.S_IMODE(target.stat().st_mode) == usual


def test_columns_keep_every_digit(tmp_path: Path) -> None:
    values = np.array([0.1 + 0.2, 1e-300, -1 / 3])
    path = tmp_path / "columns.csv"
    write_columns({"time_s": np.arange(3.0), "voltage_v": values, "simulated_um": values}, path)
    np.testing.assert_array_equal(read_recording(path).voltage_v, values)
    assert path.read_text().splitlines()[0] == "time_s,voltage_v,simulated_um"

"""Long text is read in blocks, to the same numbers; notes beside recordings are no recordings."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.errors import InputError
from fomrc_core.storage import read_recording, recordings
from fomrc_core.storage.record_work import records_in


@pytest.fixture
def in_small_blocks(monkeypatch):
    monkeypatch.setattr(recordings, "_LONG_BYTES", 1)
    monkeypatch.setattr(recordings, "_BLOCK_CHARACTERS", 200)


def test_blocks_give_the_same_numbers(tmp_path, monkeypatch, in_small_blocks):
    path = tmp_path / "r.csv"
    rows = np.column_stack((np.arange(500) / 100.0, np.random.default_rng(0).normal(size=(500, 2))))
    np.savetxt(path, rows, delimiter=",", header="time_s,voltage_v,displacement_um", comments="", fmt="%.17g")
    in_blocks = read_recording(path)
    monkeypatch.setattr(recordings, "_LONG_BYTES", 2**24)
    whole = read_recording(path)
    assert np.array_equal(in_blocks.voltage_v, whole.voltage_v)
    assert np.array_equal(in_blocks.measured_um, rows[:, 2])
    assert not in_blocks.time_s.flags.writeable


def test_a_fault_far_into_a_long_file_is_named_by_its_line(tmp_path, in_small_blocks):
    path = tmp_path / "r.csv"
    lines = ["time_s,voltage_v,displacement_um", *(f"{k},{k % 7},{k % 5}" for k in range(300))]
    lines[250] = "249,oops,1"
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"line 251.*oops"):
        read_recording(path)


def test_notes_beside_recordings_are_passed_over(tmp_path):
    (tmp_path / "notes.txt").write_text("stage 3, 12 May\n\n2 um, cable replaced\n")
    (tmp_path / "run.txt").write_text("time_s voltage_v displacement_um\n" + "0.1 1.0 2.0\n" * 9)
    (tmp_path / "unit.csv").write_text("time_s,voltage_v\n")
    assert [path.name for path in records_in(tmp_path)] == ["run.txt", "unit.csv"]

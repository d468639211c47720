"""Progress: stages as they come, what is done within long ones, the time that is left."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from fomrc_core.cli.application import run
from fomrc_core.cli.progress import Shown, loading_told, progress_shown, say, sign_of_life, worker_threads
from fomrc_core.compute.pulse import beat, heard_by, heard_threads
from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.identification.convex import identify
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording


class _Clock:
    now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> _Clock:
    return _Clock()


def _shown(clock: _Clock) -> tuple[Shown, list[tuple[float, str]]]:
    written: list[tuple[float, str]] = []
    return Shown(lambda share, text: written.append((share, text)), 3.0, clock), written


def _record(n_samples: int = 3000) -> Recording:
    drive = triangle(slope_v_per_s=5.0, n_cycles=1, rate_hz=100.0).to_recording()
    moved_um = PiezoModel([0.5, 0.4, 0.2], [1.0, 2.0], 0.02).simulate(drive.steps_s, drive.voltage_v)
    moved_um += np.random.default_rng(0).normal(0.0, 1e-3, moved_um.size)
    return Recording(drive.time_s[:n_samples], drive.voltage_v[:n_samples], moved_um[:n_samples])


def test_a_long_stage_says_what_is_done_in_it_and_how_long_it_may_take(clock: _Clock) -> None:
    shown, written = _shown(clock)
    shown.tell(0.2, "refit")
    for _ in range(70):
        clock.now_s += 0.5
        shown.beat("simulations", 1)
    # each line three seconds after the last, of what was done since the stage began
    assert [text.split(",")[1].split(" (")[0] for _, text in written[1:]] == [
        f" {number} simulations" for number in range(6, 71, 6)
    ]
    assert written[0] == (0.2, "refit")
    assert written[-1] == (0.2, "refit, 66 simulations (0:33, up to about 2:12 left)")


def test_a_new_stage_counts_anew(clock: _Clock) -> None:
    shown, written = _shown(clock)
    shown.tell(0.1, "one")
    clock.now_s += 10.0
    shown.beat("rows", 1000)
    shown.tell(0.5, "two")
    clock.now_s += 10.0
    shown.beat("simulations", 1)
    shown.tell(1.0, "done")
    assert [text for _, text in written] == [
        "one",
        "one, 1000 rows (0:10, up to about 1:30 left)",
        "two (0:10, up to about 0:10 left)",
        "two, 1 simulations (0:20, up to about 0:20 left)",
        "done",
    ]


def test_nothing_is_foreseen_from_hardly_anything(clock: _Clock) -> None:
    shown, written = _shown(clock)
    shown.tell(0.01, "start")
    clock.now_s += 65.0
    shown.beat("simulations", 1)
    assert written[-1] == (0.01, "start, 1 simulations (1:05)")


def test_work_without_stages_is_silent_where_it_is_short(capsys: pytest.CaptureFixture[str]) -> None:
    with sign_of_life("read"):
        beat("rows", 5)
    assert capsys.readouterr().err == ""


def test_threads_are_heard_and_nobody_listens_afterwards() -> None:
    heard: list[tuple[str, int]] = []
    with heard_by(lambda what, n: heard.append((what, n))), heard_threads(2) as threads:
        assert list(threads.map(lambda k: beat("pieces", k), range(1, 5))) == [None] * 4
    beat("pieces", 100)
    assert sorted(heard) == [("pieces", k) for k in range(1, 5)]


def test_fits_and_searches_are_heard_in_all_their_threads_and_come_to_the_same() -> None:
    heard: list[str] = []
    record = _record()
    with heard_by(lambda what, n: heard.append(what)):
        fit = identify(record, n_elements=4)
        n_of_fit = len(heard)
        with worker_threads() as executor:
            found = diagnose(record, executor=executor)
    assert n_of_fit > 5
    assert heard.count("simulations") > 50
    assert heard.count("steps of fits") > 10
    unheard = identify(record, n_elements=4)
    np.testing.assert_array_equal(unheard.model.kappa_um_per_v, fit.model.kappa_um_per_v)
    assert diagnose(record).final_test_percent == found.final_test_percent


def test_the_lines_of_a_log_have_the_share_first(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_shown("fit") as progress:
        progress(-1.0, "before")
        progress(2.0, "after")
    assert capsys.readouterr().err.splitlines() == ["fit:   0 % before", "fit: 100 % after"]


def _load(folder: Path, name: str, text: str = "") -> None:
    (folder / f"{name}.py").write_text(text)
    importlib.invalidate_caches()
    try:
        importlib.import_module(name)
    finally:
        sys.modules.pop(name, None)


def test_loading_is_told_where_nothing_else_is_and_only_where_it_is_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], clock: _Clock
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("fomrc_core.cli.progress._said_s", 0.0)
    before = list(sys.meta_path)
    with loading_told(clock):
        _load(tmp_path, "loaded_at_once")
        clock.now_s += 4.0
        beat("rows")  # not what is told of
        assert capsys.readouterr().err == ""
        _load(tmp_path, "loaded_late")
        assert capsys.readouterr().err == "loading: 2 modules so far\n"
        monkeypatch.setattr("fomrc_core.cli.progress._said_s", clock.now_s)
        clock.now_s += 2.0
        _load(tmp_path, "loaded_soon_after")
        assert capsys.readouterr().err == ""
    assert sys.meta_path == before


def test_what_is_loaded_within_a_work_is_counted_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, clock: _Clock
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    shown, written = _shown(clock)
    with loading_told(clock), heard_by(shown.beat):
        shown.tell(0.0, "start")
        clock.now_s += 4.0
        _load(tmp_path, "loaded_within")
    assert [text for _, text in written] == ["start", "start, 1 modules loaded"]


def test_writing_may_load_a_module_that_is_heard(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    written = []

    def write(_share: float, text: str) -> None:
        written.append(text)
        if len(written) == 1:
            _load(tmp_path, "loaded_by_writing")

    shown = Shown(write, 0.0)
    with loading_told(), heard_by(shown.beat):
        beat("simulations")
    assert written == ["1 simulations", "1 simulations, 1 modules loaded"]


def test_a_module_that_breaks_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    before = list(sys.meta_path)
    with pytest.raises(ZeroDivisionError), loading_told():
        _load(tmp_path, "broken", "1 / 0")
    with pytest.raises(ModuleNotFoundError), loading_told():
        importlib.import_module("there_is_none_of_this_name")
    assert run(["identify"]) == 2
    assert sys.meta_path == before


def test_what_is_said_is_remembered(capsys: pytest.CaptureFixture[str]) -> None:
    from fomrc_core.cli import progress

    progress._said_s = 0.0
    say("done")
    assert progress._said_s > 0.0
    assert capsys.readouterr().err == "done\n"

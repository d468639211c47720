"""What workers do is told in words: what is at work, how far it is, and that it stands still where it does."""

from __future__ import annotations

import re
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from fomrc_core.compute.pulse import beat
from fomrc_core.errors import FomrcError, ParameterError
from fomrc_core.storage import record_work
from fomrc_core.storage.record_work import RecordWork, work_on
from fomrc_core.storage.work_account import WorkAccount, at_work

_PATIENCE_S = 120.0  # on however busy a machine


class _Clock:
    now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def test_steps_are_told_of_each_recording_at_work() -> None:
    account = WorkAccount(["a.csv", "b.csv", "c.csv"])
    with at_work(account.entries, 0):
        beat("kernels compiled", 0)
        beat("simulations", 3)
        with at_work(account.entries, 2):
            assert account.told() == "at work: a.csv (2 steps, simulations), c.csv (begun)"
            beat("rows", 500)
            assert account.told() == "at work: a.csv (2 steps, simulations), c.csv (1 steps, rows)"
        assert account.told() == "at work: a.csv (2 steps, simulations)"


def test_who_works_on_many_names_some() -> None:
    account = WorkAccount([f"{number}.csv" for number in range(5)])
    for entry in account.entries:
        entry.state = 1
    assert account.told() == "at work: 0.csv (begun), 1.csv (begun), 2.csv (begun), 2 more"


def test_what_stands_still_is_said_to() -> None:
    clock = _Clock()
    account = WorkAccount(["a.csv"], clock)
    clock.now_s = 4.0
    assert account.told() == "no recording at work for 4 s: workers start or end"
    with at_work(account.entries, 0):
        assert account.told() == "at work: a.csv (begun)"
        clock.now_s = 6.0
        beat("simulations", 0)
        assert account.told() == "at work: a.csv (1 steps, simulations)"
        clock.now_s = 8.0
        assert account.told() == "at work: a.csv (1 steps, simulations)"
        clock.now_s = 66.0
        assert account.told() == "at work: a.csv (1 steps, simulations); no step for 60 s"
        beat("simulations")
        assert account.told() == "at work: a.csv (2 steps, simulations)"
    assert account.told() == "no recording at work: workers start or end"


def test_a_long_or_odd_name_of_what_is_done_is_cut() -> None:
    account = WorkAccount(["a.csv"])
    with at_work(account.entries, 0):
        beat("Ω" * 100)
        assert "(1 steps, ΩΩΩ" in account.told()


def test_a_recording_that_fails_is_at_work_no_longer_and_heard_no_longer() -> None:
    account = WorkAccount(["a.csv"])
    with pytest.raises(FomrcError), at_work(account.entries, 0):
        raise FomrcError("broken")
    beat("simulations")
    assert account.entries[0].n_steps == 0
    assert "no recording at work" in account.told()


def _waited_for(path: Path, _folder: Path, release: str) -> dict[str, str]:
    """Do one step, then wait until it was told of."""
    beat("pieces")
    deadline_s = time.monotonic() + _PATIENCE_S
    while not Path(release).is_file():
        # what is never told fails the test and does not hang it
        assert time.monotonic() < deadline_s, "was not told of"
        time.sleep(0.01)
    return {"reason": f"{path.stem} seen"}


def _told_while(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, until: str, **how: object) -> list[str]:
    """Return what is told of a work that ends no sooner than a text has been told."""
    monkeypatch.setattr(record_work, "_LOOK_S", 0.02)
    monkeypatch.setattr(record_work, "_TELL_S", 0.05)
    (tmp_path / "a.csv").write_text("0,1,2\n")
    release, told = tmp_path / "release", []

    def tell(share: float, text: str) -> None:
        assert share == (1.0 if "done:" in text else 0.0)
        told.append(text)
        if until in text:
            release.touch()

    work = RecordWork(_waited_for, ".json", (), str(release))
    outcomes = work_on([tmp_path / "a.csv"], tmp_path / "out", work, progress=tell, **how)  # type: ignore[arg-type]
    assert [outcome.reason for outcome in outcomes] == ["a seen"]
    return told


def test_a_worker_is_heard_while_it_works_and_until_it_has_begun(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    told = _told_while(monkeypatch, tmp_path, "1 steps", n_workers=1)
    assert told[0] == "0 of 1 already done"
    assert re.fullmatch(r"no recording at work( for \d+ s)?: workers start or end", told[1])
    assert "at work: a.csv (1 steps, pieces)" in told
    assert told[-1] == "a.csv: done: a seen"


def test_an_executor_of_others_is_said_to_have_what_is_left(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with ThreadPoolExecutor(1) as executor:
        told = _told_while(monkeypatch, tmp_path, "with the executor", executor=executor)
    # how long that took is the machine's
    assert re.fullmatch(r"1 with the executor, none done for \d+ s", told[1])
    assert told[-1] == "a.csv: done: a seen"


def test_who_breaks_off_leaves_no_worker(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def break_off(_share: float, text: str) -> None:
        if "at work: a.csv" in text:
            (tmp_path / "release").touch()
            raise ParameterError("enough", where="here", allowed="nothing")

    monkeypatch.setattr(record_work, "_LOOK_S", 0.02)
    monkeypatch.setattr(record_work, "_TELL_S", 0.05)
    (tmp_path / "a.csv").write_text("0,1,2\n")
    work = RecordWork(_waited_for, ".json", (), str(tmp_path / "release"))
    with pytest.raises(ParameterError, match="enough"):
        work_on([tmp_path / "a.csv"], tmp_path / "out", work, n_workers=1, progress=break_off)
    # the pool has been waited for: the recording it had begun is done
    assert (tmp_path / "out" / "a.csv.json").is_file()

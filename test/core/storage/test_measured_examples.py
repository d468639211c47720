"""Measured examples: found by their content, fetched where missing, one line where neither is possible."""

from __future__ import annotations

import functools
import hashlib
import http.server
import os
import shutil
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fomrc_core.errors import DataUnavailableError, ParameterError
from fomrc_core.storage import measured_examples as data_sources
from fomrc_core.storage.measured_examples import FSM, PEA_1HZ, MeasuredFile, MeasuredSet, fsm, locate, pea_1hz

_SHARED = Path(os.environ.get("FOMRC_DATA") or Path(__file__).resolve().parents[3].parent / "shared" / "data")


def _needs(measured: MeasuredSet) -> pytest.MarkDecorator:
    is_there = all((_SHARED / file.name).is_file() for file in measured.files)
    return pytest.mark.skipif(not is_there, reason=f"{measured.name} is not in {_SHARED}")


@_needs(PEA_1HZ)
def test_the_piezo_stack_is_read_as_its_readme_says() -> None:
    train, test = pea_1hz()
    assert (train.n_samples, test.n_samples) == (8027, 5000)
    assert train.sample_period_s == test.sample_period_s == pytest.approx(0.005)
    assert train.voltage_v[0] == 1.8
    assert train.measured_um[0] == -123.059139
    assert np.ptp(train.voltage_v) == pytest.approx(3.6, abs=0.01)
    assert (train.name, test.name) == ("pea_1hz model.dat", "pea_1hz test_first_25s.dat")


@_needs(PEA_1HZ)
def test_whole_and_cut_test_record_give_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "pea_1hz"
    shutil.copytree(_SHARED / "pea_1hz", folder)
    cut = pea_1hz()[1]
    name = folder / "test_first_25s.dat"
    name.chmod(0o644)
    name.write_text(name.read_text() + "\t".join(["0.5"] * 11) + "\n")
    file = PEA_1HZ.files[1]
    longer = replace(file, url_sha256=hashlib.sha256(name.read_bytes()).hexdigest())
    monkeypatch.setitem(data_sources.DATA_SETS, "pea_1hz", replace(PEA_1HZ, files=(PEA_1HZ.files[0], longer)))
    monkeypatch.setenv("FOMRC_DATA", str(tmp_path))
    whole = pea_1hz()[1]
    assert whole.n_samples == 5000
    np.testing.assert_array_equal(whole.measured_um, cut.measured_um)


@_needs(FSM)
def test_the_mirror_is_read_axis_by_axis() -> None:
    record = fsm(amplitude_mv=300, realisation=2, axis=1, cross_axis=0)
    drive_v = np.load(_SHARED / "fsm" / "u_300mV_train.npy")
    moved_m = np.load(_SHARED / "fsm" / "y_300mV_train.npy")
    assert record.n_samples == 2 * 8192
    assert record.sample_period_s == pytest.approx(1 / 6400)
    np.testing.assert_array_equal(record.voltage_v[:8192], drive_v[:, 1, 2, 0])
    np.testing.assert_array_equal(record.measured_um[8192:], moved_m[:, 1, 2, 1] * 1e6)
    assert record.cross_voltage_v is not None
    np.testing.assert_array_equal(record.cross_voltage_v[8192:], drive_v[:, 0, 2, 1])


def test_a_record_of_other_content_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "pea_1hz").mkdir()
    (tmp_path / "pea_1hz" / "model.dat").write_text("1 2 3\n")
    monkeypatch.setenv("FOMRC_DATA", str(tmp_path))
    with pytest.raises(DataUnavailableError, match=r"model\.dat: not the known record") as caught:
        locate("pea_1hz")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "options",
    [
        {"amplitude_mv": 200},
        {"realisation": 6},
        {"axis": 3},
        {"axis": 1, "cross_axis": 1},
        {"cross_axis": -1},
    ],
)
def test_arguments_are_checked_before_anything_is_fetched(options: dict[str, int]) -> None:
    with pytest.raises(ParameterError, match="allowed"):
        fsm(**options)


def test_unknown_sets_are_named() -> None:
    with pytest.raises(ParameterError, match=r"no such data set, got 'pea_2hz' \(allowed: pea_1hz, fsm\)"):
        locate("pea_2hz")


class _Published:
    """A web server of one folder on this machine, standing in for where the authors published."""

    def __init__(self, folder: Path) -> None:
        class Handler(http.server.SimpleHTTPRequestHandler):
            def log_message(self, *_: object) -> None:
                pass

        self.server = http.server.ThreadingHTTPServer(
            ("127.0.0.1", 0), functools.partial(Handler, directory=str(folder))
        )
        self.url = f"http://127.0.0.1:{self.server.server_port}/"
        self.thread = threading.Thread(target=self.server.serve_forever)
        self.thread.start()

    def close(self) -> None:
        self.server.shutdown()
        self.thread.join()
        self.server.server_close()


@pytest.fixture
def published(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[_Published]:
    pytest.importorskip("pooch")
    monkeypatch.setenv("FOMRC_DATA", str(tmp_path / "nothing_here"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for proxy in ("http_proxy", "HTTP_PROXY", "all_proxy", "ALL_PROXY"):
        monkeypatch.delenv(proxy, raising=False)
    (tmp_path / "site").mkdir()
    server = _Published(tmp_path / "site")
    yield server
    server.close()


def _publish(monkeypatch: pytest.MonkeyPatch, url: str, sha256: str) -> None:
    file = MeasuredFile("tiny/record.dat", "0" * 64, url, sha256)
    monkeypatch.setitem(data_sources.DATA_SETS, "tiny", MeasuredSet("tiny", "", "", (file,)))


def test_what_is_missing_is_fetched_once(
    published: _Published, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = b"1 2\n3 4\n"
    (tmp_path / "site" / "whole.dat").write_bytes(content)
    _publish(monkeypatch, published.url + "whole.dat", hashlib.sha256(content).hexdigest())
    (path,) = locate("tiny")
    assert path.read_bytes() == content
    assert tmp_path / "cache" in path.parents
    (tmp_path / "site" / "whole.dat").unlink()
    assert locate("tiny") == (path,)


def test_fetched_content_must_be_the_known_one(
    published: _Published, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "site" / "whole.dat").write_bytes(b"something else")
    _publish(monkeypatch, published.url + "whole.dat", "1" * 64)
    with pytest.raises(DataUnavailableError, match=r"tiny/record\.dat is neither in") as caught:
        locate("tiny")
    assert "\n" not in str(caught.value)
    assert not list((tmp_path / "cache").rglob("*.dat"))


def test_no_network_is_told_in_one_line(published: _Published, monkeypatch: pytest.MonkeyPatch) -> None:
    url = published.url
    published.close()
    _publish(monkeypatch, url + "whole.dat", "1" * 64)
    with pytest.raises(DataUnavailableError, match=r"neither in .*nothing_here, nor to be had from http://") as caught:
        locate("tiny")
    assert "\n" not in str(caught.value)

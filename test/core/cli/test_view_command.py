"""``fomrc view``: a page for each kind of file, none of which is ever written over."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from fomrc_core.cli.application import run
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.recording import Recording
from fomrc_core.report.linked_figure import Curve
from fomrc_core.report.residual_panels import residual_figure
from fomrc_core.report.sample_table import SampledRecord, sample_table
from fomrc_core.storage import write_model, write_recording

_MODEL = PiezoModel([1.0, 2.0], [0.3], 0.015)
_LAGGING = PiezoModel([1.0, 2.0], [0.3], 0.015, (AmplifierBandwidth(41.2),))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in, with a recording and two models."""
    monkeypatch.chdir(tmp_path)
    time_s = np.arange(2000) * 2e-3
    voltage_v = np.sin(2.0 * np.pi * 1.5 * time_s) * np.exp(-0.3 * time_s)
    moved_um = _LAGGING.simulate(np.full(2000, 2e-3), voltage_v) + np.random.default_rng(3).normal(0.0, 1e-3, 2000)
    write_recording(Recording(time_s, voltage_v, moved_um), "rec.csv")
    write_model(_MODEL, "a.yaml")
    write_model(_LAGGING, "b.yaml")
    return tmp_path


@pytest.mark.parametrize(
    ("files", "name", "said"),
    [
        (["rec.csv"], "rec_view.html", ["Recording rec.csv", "500 Hz", "Nonlinearity against drive"]),
        (["b.yaml"], "b_view.html", ["Model b.yaml", "41.2 Hz", "inverted: the voltage leads", "up to ±1.2 V"]),
        (["a.yaml", "b.yaml"], "a_and_b_view.html", ["b.yaml less a.yaml", "Difference against rate"]),
        (["a.yaml", "rec.csv", "b.yaml"], "a_and_rec_and_b_view.html", ["% of the range", "Residual against drive"]),
    ],
)
def test_each_kind_has_a_page(
    folder: Path, capsys: pytest.CaptureFixture[str], files: list[str], name: str, said: list[str]
) -> None:
    assert run(["view", *files, "--no-open"]) == 0
    assert capsys.readouterr().out == f"{name}\n"
    content = (folder / name).read_text("utf-8")
    assert len(content) < 3e6
    markup = re.sub(r"<script.*?</script>", "", content, flags=re.DOTALL)
    for text in (*said, f"fomrc view {' '.join(files)} --no-open", "SHA-256"):
        assert text in markup, text
    assert not re.search(r"\d um\b|μ", markup)


def test_what_models_leave_is_said(folder: Path) -> None:
    assert run(["view", "a.yaml", "b.yaml", "rec.csv", "--no-open", "-o", "page.html"]) == 0
    content = (folder / "page.html").read_text("utf-8")
    a_nm, b_nm = (float(re.search(rf"{name}.yaml</code></td><td>([\d.]+) nm", content)[1]) for name in "ab")  # type: ignore[index]
    assert 0.95 < b_nm < 1.05
    assert a_nm > 10.0 * b_nm


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["a.yaml", "b.yaml", "a.yaml"], "too many files"),
        (["rec.csv", "rec.csv"], "up to 2 models (.yaml) and 1 recording"),
        (["a.yaml", "-o", "a.yaml"], "is an input too"),
        (["rec.csv", "-o", "rec.csv"], "is an input too"),
        (["none.csv"], "no such file"),
        (["a.yaml", "--max-voltage", "-1"], "--max-voltage: out of range"),
    ],
)
def test_bad_input_is_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert run(["view", *arguments, "--no-open"]) == 2
    told = capsys.readouterr().err.strip()
    assert said in told
    assert "\n" not in told
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_a_million_samples_are_thinned_to_their_extremes_and_said_so() -> None:
    n = 1_000_000
    time_s = np.arange(n) * 1e-4
    left_um = np.random.default_rng(0).normal(0.0, 1e-3, n)
    left_um[123_456], left_um[654_321] = 0.05, -0.06
    record = SampledRecord("long", time_s, np.sin(time_s), np.sin(time_s), {"left": left_um})
    table = sample_table([record])
    assert table.n_shown <= 8000
    assert (table.columns["left"].max(), table.columns["left"].min()) == (0.05, -0.06)
    page = residual_figure([record], (Curve("left", "left", "after"),), "residual", 0)
    assert len(page) < 2e6
    assert f"Of 1000000 samples {table.n_shown} are shown" in page
    config = json.loads(re.search(r"id='linked-figure'>(.*?)</script>", page)[1])  # type: ignore[index]
    powers = np.mean(config["spectra"][0]["power"]["left"], axis=0)
    # white noise of 1 nm, in nm^2/Hz, with two spikes that add to it
    assert np.median(powers) == pytest.approx(2e-4, rel=0.1)


def test_without_bokeh_the_page_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fomrc_core.report.linked_figure._bundle", lambda: None)
    line = np.linspace(0.0, 1.0, 100)
    record = SampledRecord("short", line, line, None, {"left": line})
    assert "Bokeh is not installed" in residual_figure([record], (Curve("left", "left", "after"),), "residual", 0)

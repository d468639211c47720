"""The report: JSON as agreed, a model that runs, a page that needs nothing else."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fomrc_core.cli.application import run
from fomrc_core.diagnosis.constancy import ParameterTwice
from fomrc_core.diagnosis.diagnosis import Diagnosis, Status
from fomrc_core.diagnosis.findings import Finding
from fomrc_core.diagnosis.judgement import judge
from fomrc_core.diagnosis.record_view import RecordView
from fomrc_core.diagnosis.remainder import Dependence
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.mains_hum import MainsHum
from fomrc_core.errors import StorageError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.noise import NoiseFloor
from fomrc_core.records.recording import Recording
from fomrc_core.report.diagnosis_figures import quoted_words, records_figure, simulation_figure, where_figure
from fomrc_core.report.diagnosis_files import diagnosis_results, write_report
from fomrc_core.report.diagnosis_page import page
from fomrc_core.report.provenance import Provenance
from fomrc_core.storage import read_model, write_recording

_FILES = {"diagnosis.json", "extended_model.yaml", "report.html", "where_it_is_wrong.png"}
_FINDING = Finding(
    "amplifier_bandwidth",
    {"cutoff_hz": 41.237},
    {"cutoff_hz": 0.12},
    2.5,
    0.061,
    0.97,
    3e-9,
    "held-out error 90 -> 2 nm rms",
    "so the drive lags",
    probability=0.97,
    twice=(ParameterTwice("amplifier_bandwidth", "cutoff_hz", 41.237, 41.31, 0.02, 0.4),),
)
_MODEL = PiezoModel([1.0, 2.0], [0.3], 0.015, (AmplifierBandwidth(41.237), MainsHum(50.0, 0.01, 0.0)))


def _view(name: str, role: str, seed: int, lag_um: float = 0.09) -> RecordView:
    generator = np.random.default_rng(seed)
    time_s = np.arange(4000) * 1e-3
    voltage_v = np.where(time_s < 3.0, 2.0 * np.sin(2.0 * np.pi * time_s), 1.0)
    noise_um = generator.normal(0.0, 0.002, time_s.size)
    left_um = noise_um + lag_um * np.where(time_s < 3.0, np.cos(2.0 * np.pi * time_s), 0.0)
    return RecordView(name, role, time_s, voltage_v, 1.2 * voltage_v + left_um, left_um, noise_um, time_s >= 0.0)


def _diagnosis(**changes: Any) -> Diagnosis:
    diagnosis = Diagnosis(
        status=Status.EXPLAINED,
        judgement=judge(0.002, True, 0.09, 0.0021, 0.0021, (Dependence("rate", 0.01, 0.4),)),
        probability_of_unknown=0.03,
        noise=NoiseFloor(0.002, float("nan")),
        noise_floor_um=0.002,
        baseline_train_percent=2.4,
        baseline_test_percent=2.5,
        final_test_percent=0.061,
        findings=(_FINDING,),
        ambiguous_with=(),
        unexplained_percent=0.1,
        smallest_detectable={"transport_delay": {"delay_s": 2e-5}, "mains_hum": {"amplitude_um": 3e-4}},
        next_experiment="to confirm run `fomrc excite steps --levels 1,0`",
        extended_model=_MODEL,
        records=(_view("train", "train", 0), _view("<held> & out", "test", 1)),
        quoted_on="<held> & out",
    )
    return replace(diagnosis, **changes)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the report of the diagnosis above."""
    folder = tmp_path_factory.mktemp("report")
    write_report(_diagnosis(), folder)
    return folder


def _no_constant(name: str) -> float:
    raise AssertionError(f"{name} is not JSON")


class _Page(HTMLParser):
    """What a page shows as text, and what it loads."""

    def __init__(self, content: str) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.loaded: list[str] = []
        self.open: list[str] = []
        self.feed(content)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        self.loaded += [value or "" for name, value in attrs if name in ("src", "href", "data", "action")]

    def handle_data(self, data: str) -> None:
        if self.open[-1:] not in (["style"], ["script"]):
            self.texts.append(data)

    def handle_endtag(self, tag: str) -> None:
        while self.open and self.open.pop() != tag:
            pass

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.texts).split())


def test_the_json_is_as_agreed(written: Path) -> None:
    results = json.loads((written / "diagnosis.json").read_text(), parse_constant=_no_constant)
    assert list(results)[:8] == [
        "status",
        "noise_floor_um",
        "baseline",
        "findings",
        "ambiguous_with",
        "unexplained_percent",
        "smallest_detectable",
        "next_experiment",
    ]
    assert results["status"] == "explained"
    assert results["doubts"] == []
    assert results["baseline"] == {"nrmse_percent_train": 2.4, "nrmse_percent_test": 2.5}
    (finding,) = results["findings"]
    assert finding == {
        "cause": "amplifier_bandwidth",
        "parameters": {"cutoff_hz": 41.237},
        "standard_errors": {"cutoff_hz": 0.12},
        "nrmse_percent_test_before": 2.5,
        "nrmse_percent_test_after": 0.061,
        "gain": 0.97,
        "p_value": 3e-9,
        "probability": 0.97,
        "parameters_of_held_out_data_alone": {"cutoff_hz": {"value": 41.31, "standard_errors_apart": 0.4}},
        "evidence": "held-out error 90 -> 2 nm rms",
        "meaning": "so the drive lags",
    }
    assert results["smallest_detectable"]["transport_delay"] == {"delay_s": 2e-5}
    assert results["noise"] == {"differences_um": 0.002, "repeats_um": None}
    assert results["extended"]["not_inverted"] == {"mains_hum": MainsHum.inverse_note}
    assert [record["role"] for record in results["records"]] == ["train", "test"]
    assert results["records"][1]["rms_um_after"] == pytest.approx(0.002, rel=0.05)
    assert {path.name for path in written.iterdir()} == _FILES


def test_numbers_that_are_none_are_none() -> None:
    finding = replace(_FINDING, standard_errors={"cutoff_hz": float("inf")}, gain=float("nan"), p_value=np.float64(0.5))
    results = diagnosis_results(_diagnosis(findings=(finding,), unexplained_percent=np.float64(np.nan)))
    assert results["findings"][0]["standard_errors"] == {"cutoff_hz": None}
    assert results["findings"][0]["gain"] is None
    assert type(results["findings"][0]["p_value"]) is float
    assert results["unexplained_percent"] is None


def test_the_model_reads_back_as_it_was(written: Path) -> None:
    assert read_model(written / "extended_model.yaml").to_mapping() == _MODEL.to_mapping()


def test_the_page_needs_nothing_else_and_says_what_matters(written: Path) -> None:
    content = (written / "report.html").read_text()
    shown = _Page(content)
    assert len(shown.loaded) == 3
    for source in shown.loaded:
        kind, data = source.split(",", 1)
        assert kind == "data:image/png;base64"
        assert base64.b64decode(data, validate=True).startswith(b"\x89PNG")
    markup = re.sub(r"<script.*?</script>", "", content, flags=re.DOTALL)
    assert not re.search(r"url\(|https?:", markup)
    assert len(content) < 3e6
    for said in (
        "Diagnosis: explained",
        "amplifier_bandwidth",
        "41.24 ± 0.12 Hz",
        AmplifierBandwidth.meaning,
        "2.5 % → 0.061 %",
        "97 % of what was above the noise",
        "<held> & out",
        "delay_s above 20 µs",
        "fomrc excite steps --levels 1,0",
        MainsHum.inverse_note,
        "2 nm rms",
    ):
        assert said in shown.text, said


@pytest.mark.parametrize("status", list(Status))
def test_every_status_has_a_page(status: Status) -> None:
    found = () if status in (Status.NOTHING_FOUND, Status.UNEXPLAINED) else (_FINDING,)
    tied = ("transport_delay",) if status is Status.AMBIGUOUS else ()
    diagnosis = _diagnosis(status=status, findings=found, ambiguous_with=tied)
    text = _Page(page(diagnosis, {"simulation": b"", "where": b""})).text
    assert f"Diagnosis: {status.value.replace('_', ' ')}" in text
    assert ("No cause was accepted" in text) is not bool(found)
    assert ("It could as well be transport_delay" in text) is bool(tied)


def test_the_same_diagnosis_gives_the_same_files(written: Path, tmp_path: Path) -> None:
    write_report(_diagnosis(), tmp_path)
    for name in _FILES:
        assert (tmp_path / name).read_bytes() == (written / name).read_bytes()


def test_page_and_json_say_where_they_come_from(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    record = tmp_path / "a record.csv"
    record.write_bytes(b"time_s,voltage_v\n")
    origin = Provenance.of(("fomrc", "diagnose", "a record.csv", "--output", "."), [("recording", record)])
    write_report(_diagnosis(), tmp_path, origin)
    results = json.loads((tmp_path / "diagnosis.json").read_text())["provenance"]
    assert (results["made_at"], results["command"]) == (
        "1970-01-02T00:00:00Z",
        "fomrc diagnose 'a record.csv' --output .",
    )
    assert results["versions"]["numpy"] == np.__version__
    sums = {file["role"]: file["sha256"] for file in results["files"]}
    model = (tmp_path / "extended_model.yaml").read_bytes()
    assert sums == {
        "recording": hashlib.sha256(record.read_bytes()).hexdigest(),
        "extended model": hashlib.sha256(model).hexdigest(),
    }
    text = _Page((tmp_path / "report.html").read_text()).text
    for said in (results["command"], results["made_at"], *sums.values(), f"numpy {np.__version__}"):
        assert said in text


def test_held_out_is_said_of_what_is_held_out() -> None:
    apart, alone = _diagnosis(), _diagnosis(records=(_view("alone", "train", 0),), quoted_on="alone")
    assert quoted_words(apart).startswith("<held> & out, held out of every fit")
    assert quoted_words(alone) == "blocks held out of alone"
    assert "held out" not in simulation_figure(replace(apart, quoted_on="train")).axes[0].get_title()
    assert simulation_figure(alone).axes[0].get_title().endswith("but for blocks that were held out)")


def test_results_show_themselves_in_a_notebook() -> None:
    diagnosis = _diagnosis()
    for result in (diagnosis, _MODEL):
        shown = _Page(result._repr_html_()).text
        assert " ".join(str(result).split()) in shown
    figure = diagnosis.plot()
    assert [axes.get_title() for axes in figure.axes] == ["<held> & out", "what is left"]
    before_nm, after_nm = (line.get_ydata() for line in figure.axes[1].get_lines())
    assert np.std(before_nm) > 20.0 * np.std(after_nm)
    loop, over_time = _MODEL.plot(2.0).axes
    assert np.max(loop.get_lines()[0].get_xdata()) == pytest.approx(2.0, rel=0.01)
    assert (loop.get_xlabel(), over_time.get_xlabel()) == ("voltage [V]", "time [s]")


def test_a_missing_folder_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="no such folder"):
        write_report(_diagnosis(), tmp_path / "none")


@pytest.mark.parametrize("make", [simulation_figure, where_figure, records_figure])
def test_axes_carry_units(make: Callable[[Diagnosis], Any]) -> None:
    figure = make(_diagnosis())
    figure.draw_without_rendering()
    for axes in figure.axes:
        assert axes.get_title()
        if axes.get_yticks().size:
            assert re.search(r"\[.+\]", axes.get_ylabel()), axes.get_title()
    assert all(re.search(r"\[.+\]", axes.get_xlabel()) for axes in figure.axes[-1:])


def test_figures_show_what_is_there() -> None:
    found, nothing = _diagnosis(), _diagnosis(findings=(), status=Status.NOTHING_FOUND)
    assert [len(f.axes) for f in (simulation_figure(found), simulation_figure(nothing))] == [3, 2]
    assert records_figure(_diagnosis(records=(_view("alone", "train", 0),), quoted_on="alone")) is None
    by_rate = where_figure(found).axes[1]
    before, after = (line.get_ydata() for line in by_rate.get_lines())
    # the lag of 90 nm is seen against the rate, and gone with what was found
    assert np.max(np.abs(before)) > 70.0
    assert np.max(np.abs(after)) < 1.0
    moving = replace(_view("moving", "train", 0), voltage_v=np.sin(np.arange(4000) * 0.01))
    by_rest = where_figure(_diagnosis(records=(moving,), quoted_on="moving")).axes[3]
    assert [text.get_text() for text in by_rest.texts] == ["nothing in these records"]


def test_the_command_writes_all_of_it_and_the_model_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    time_s = np.arange(1500) * 4e-3
    voltage_v = 2.0 * np.sin(2.0 * np.pi * 1.5 * time_s) * np.exp(-0.3 * time_s)
    moved_um = _MODEL.with_effects().simulate(np.full(1500, 4e-3), voltage_v)
    moved_um = moved_um + np.random.default_rng(3).normal(0.0, 1e-3, 1500)
    write_recording(Recording(time_s, voltage_v, moved_um), tmp_path / "record.csv")
    assert run(["diagnose", "record.csv", "--output", "result"]) == 0
    told = capsys.readouterr()
    assert told.out.startswith("status: ")
    assert str(Path("result") / "report.html") in told.err
    assert {path.name for path in (tmp_path / "result").iterdir()} == _FILES
    results = json.loads((tmp_path / "result" / "diagnosis.json").read_text(), parse_constant=_no_constant)
    assert f"status: {results['status']};" in told.out
    model = ["--model", "result/extended_model.yaml"]
    assert run(["simulate", *model, "--input", "record.csv", "--output", "simulated.csv"]) == 0
    (tmp_path / "target.csv").write_text("time_s,desired_um\n0,0\n0.01,0.1\n0.02,0.15\n")
    assert run(["compensate", *model, "--input", "target.csv", "--output", "voltage.csv"]) == 0


def test_what_an_answer_leaves_in_doubt_is_said(tmp_path: Path) -> None:
    given = _diagnosis(status=Status.SUSPECT, findings=(replace(_FINDING, probability=0.7),))
    write_report(given, tmp_path)
    (doubt,) = json.loads((tmp_path / "diagnosis.json").read_text())["doubts"]
    assert "right with a probability of 70 %" in doubt
    assert f"Doubt: {doubt}." in _Page((tmp_path / "report.html").read_text()).text
    assert doubt in str(given)


def test_one_more_term_of_a_finding_is_shown_and_is_no_name(tmp_path: Path) -> None:
    law, term = (replace(_FINDING, cause=cause, parameters={}) for cause in ("creep_law", "slow_relaxation"))
    given = _diagnosis(status=Status.EXPLAINED, findings=(law,), further_terms=(term,))
    write_report(given, tmp_path)
    results = json.loads((tmp_path / "diagnosis.json").read_text())
    assert [finding["cause"] for finding in results["findings"]] == ["creep_law"]
    assert [(form["cause"], form["of"]) for form in results["further_terms"]] == [("slow_relaxation", "creep_law")]
    shown = _Page((tmp_path / "report.html").read_text()).text
    assert "one more term of creep_law" in shown
    assert "one more term of creep_law" in str(given)


def test_a_form_that_stands_in_is_shown_and_is_no_name(tmp_path: Path) -> None:
    given = _diagnosis(status=Status.UNEXPLAINED, findings=(), stand_ins=(_FINDING,))
    write_report(given, tmp_path)
    results = json.loads((tmp_path / "diagnosis.json").read_text())
    assert results["findings"] == []
    assert [form["cause"] for form in results["stand_ins"]] == ["amplifier_bandwidth"]
    shown = _Page((tmp_path / "report.html").read_text()).text
    assert "not named: the form of amplifier_bandwidth" in shown
    assert "No cause was accepted" not in shown
    assert "Named:" not in shown
    assert "not named: the form of amplifier_bandwidth" in str(given)


def test_gains_stand_in_the_order_in_which_they_were_found() -> None:
    named = replace(_FINDING, nrmse_percent_test_before=1.2, nrmse_percent_test_after=0.4)
    form = replace(_FINDING, cause="mains_hum", nrmse_percent_test_before=2.5, nrmse_percent_test_after=1.2)
    given = _diagnosis(status=Status.SUSPECT, findings=(named,), stand_ins=(form,))
    figure = where_figure(given)
    told = [text.get_text() for axes in figure.axes for text in axes.texts if "%" in text.get_text()]
    assert [words.split(":")[0] for words in told[1:]] == ["+ form of mains_hum", "+ amplifier_bandwidth"]

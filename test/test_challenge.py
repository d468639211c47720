"""The challenge: what it writes tells no answers, what it scores it scores right, and it is nobody's own."""

from __future__ import annotations

import ast
import csv
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from challenge.__main__ import main
from challenge.answers import Answer
from challenge.composition import CAUSES, UNKNOWN, compose, plan
from challenge.files import Truth
from challenge.scoring import score

_ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("challenge") / "records"
    assert main(["make", str(folder), "--n", "6", "--seed", "78", "--samples", "300", "500"]) == 0
    return folder


def _key(folder: Path) -> dict[str, dict[str, object]]:
    content = json.loads(folder.with_name("records.key.json").read_text(encoding="utf-8"))
    return dict(content["cases"])


def _answers(folder: Path, content: object) -> str:
    path = folder.with_name("answers.json")
    path.write_text(json.dumps(content), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("path", sorted((_ROOT / "challenge").glob("*.py")), ids=lambda p: p.name)
def test_the_challenge_knows_nothing_of_the_product(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = [node.module or "."] if isinstance(node, ast.ImportFrom) else []
        names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        for name in names:
            is_own = name.startswith(("challenge.", "test.hidden.second."))
            assert is_own or name.split(".")[0] in sys.stdlib_module_names - {"test"} | {"numpy", "scipy"}, name


def test_records_have_their_columns_and_no_answers(made: Path) -> None:
    key = _key(made)
    assert sorted(p.name for p in made.iterdir()) == sorted([*key, "README.md", "seal.txt"])
    for name in key:
        assert sorted(p.name for p in (made / name).iterdir()) == ["report.csv", "test.csv", "train.csv"]
        with (made / name / "train.csv").open(encoding="utf-8") as file:
            rows = list(csv.reader(file))
        assert rows[0][:3] == ["time_s", "voltage_v", "displacement_um"]
        values = np.array(rows[1:], dtype=float)
        assert 300 <= values.shape[0] <= 500
        assert np.all(np.diff(values[:, 0]) > 0.0)
        assert np.all(np.isfinite(values))
    assert not any("seed" in p.read_text(encoding="utf-8") for p in (made / "README.md", made / "seal.txt"))


def test_a_key_to_everything_scores_everything(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answers = {}
    for name, told in _key(made).items():
        causes = told["causes"]
        assert isinstance(causes, list)
        answers[name] = {"detected": bool(causes), "probabilities": {c: 1.0 / len(causes) for c in causes}}
    assert main(["score", str(made), _answers(made, answers)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split() == ["detection", "5/5", "(100.0", "%)"]
    assert lines[2].split() == ["false", "alarms", "0/1", "(0.0", "%)"]
    assert "100.0 % on average" in lines[3]


def test_a_changed_key_is_refused(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    key = made.with_name("records.key.json")
    forged = made.with_name("forged.json")
    forged.write_text(key.read_text(encoding="utf-8").replace("case_0001", "case_9999"), encoding="utf-8")
    assert main(["score", str(made), _answers(made, {}), "--key", str(forged)]) == 2
    assert "seal" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ({"case_0099": {"detected": True}}, "case_0099"),
        ({"case_0001": {"detected": "yes"}}, "detected"),
        ({"case_0001": {"detected": True, "probabilities": {"gremlins": 0.5}}}, "gremlins"),
        ({"case_0001": {"detected": True, "probabilities": {"mains_hum": 1.5}}}, "1.5"),
        ({"case_0001": {"detected": True, "probabilities": {"mains_hum": 0.7, "gain_drift": 0.7}}}, "1.4"),
        ({"case_0001": {"detected": True, "cause": "mains_hum"}}, "cause"),
        ([], "object"),
    ],
)
def test_bad_answers_are_named_in_a_line(
    made: Path, content: object, named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["score", str(made), _answers(made, content)]) == 2
    error = capsys.readouterr().err
    assert named in error
    assert error.count("\n") == 1


def test_a_folder_in_use_and_a_key_inside_are_refused(made: Path, tmp_path: Path) -> None:
    assert main(["make", str(made), "--n", "1", "--seed", "1"]) == 2
    inside = tmp_path / "new" / "key.json"
    assert main(["make", str(tmp_path / "new"), "--n", "1", "--seed", "1", "--key", str(inside)]) == 2
    assert main(["make", str(tmp_path / "other"), "--n", "0", "--seed", "1"]) == 2


def test_where_nothing_can_be_written_is_told_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert main(["make", str(tmp_path / "file" / "new"), "--n", "1", "--seed", "1"]) == 2
    nowhere = str(tmp_path / "none" / "key.json")
    assert main(["make", str(tmp_path / "new"), "--n", "1", "--seed", "1", "--key", nowhere]) == 2
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2
    assert all("allowed" in line for line in told)
    assert not (tmp_path / "new").exists()


def test_score_counts_by_hand() -> None:
    truths = {
        "a": Truth(("mains_hum",), {}),
        "b": Truth(("gain_drift", "mains_hum"), {}),
        "c": Truth((), {}),
        "d": Truth((), {}),
        "e": Truth(("clock_skew",), {}),
    }
    answers = {
        "a": Answer(True, {"mains_hum": 0.6, "clock_skew": 0.4}),
        "b": Answer(True, {"gain_drift": 0.3, "mains_hum": 0.2, "transport_delay": 0.5}),
        "c": Answer(True, {UNKNOWN: 1.0}),
        "e": Answer(False, {"clock_skew": 1.0}),  # nothing detected is nothing given
    }
    found = score(truths, answers)
    assert (found.n_cases, found.n_answered, found.n_hidden, found.n_empty) == (5, 4, 3, 2)
    assert (found.n_detected, found.n_false_alarms, found.n_first) == (2, 1, 1)
    assert found.true_probability == pytest.approx((0.6 + 0.5 + 0.0) / 3)
    assert found.by_cause["mains_hum"].true_probability == pytest.approx(0.55)
    assert found.by_cause["clock_skew"].n_detected == 0


def test_a_challenge_has_cases_of_each_kind() -> None:
    plans = plan(100, 5)
    kinds = [p.kind for p in plans]
    assert {kind: kinds.count(kind) for kind in kinds} == {"nothing": 20, "one": 50, "two": 15, "three": 5, UNKNOWN: 10}
    assert all(p.answer == (UNKNOWN,) for p in plans if p.kind == UNKNOWN)
    causes = [c for p in plans for c in p.causes]
    times = [causes.count(c) for c in CAUSES if c != UNKNOWN]
    assert len(causes) == 50 + 30 + 15
    assert max(times) - min(times) <= 1  # every cause before any comes again
    assert all(len(set(p.causes)) == len(p.causes) for p in plans)


def test_a_seed_gives_one_challenge() -> None:
    first, second = (next(iter(compose(3, 9, (300, 400)))) for _ in range(2))
    assert np.array_equal(first.case.train.measured_um, second.case.train.measured_um)
    assert first.causes == second.causes
    assert plan(30, 1) == plan(30, 1) != plan(30, 2)


@pytest.mark.parametrize("words", [["make", "DIR", "--n", "many", "--seed", "1"], ["make", "DIR"], ["judge"]])
def test_a_word_that_is_no_argument_is_told_in_one_line(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert said[0].startswith("challenge: ")

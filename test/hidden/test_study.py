"""The study counts right: made-up diagnoses against real cases."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("numba")

from test.hidden.effects import CAUSES
from test.hidden.study_cases import PARTS, diagnosis_outcome, plan
from test.hidden.study_confusion import confusion
from test.hidden.study_parameters import parameter_error
from test.hidden.study_report import bars, write
from test.hidden.study_scores import answer, is_exact, is_first, is_misled, n_false
from test.hidden.truth import HiddenCase, draw_case


@dataclass
class _Found:
    cause: str
    parameters: dict[str, Any]
    standard_errors: dict[str, Any] = field(default_factory=dict)
    gain: float = 0.9
    p_value: float = 1e-9
    nrmse_percent_test_before: float = 1.0
    nrmse_percent_test_after: float = 0.02


def _outcome(case: HiddenCase, status: str, *found: _Found, part: str = "single") -> dict[str, Any]:
    diagnosis = SimpleNamespace(
        status=SimpleNamespace(value=status),
        findings=found,
        baseline_test_percent=1.0,
        final_test_percent=0.02,
        ambiguous_with=(),
        noise_floor_um=1e-3,
        unexplained_percent=0.0,
        next_experiment="steps",
    )
    spec = {
        "part": part,
        "causes": list(case.causes),
        "noise_um": 1e-3,
        "excitation": "short",
        "seed": case.seed,
    }
    truth = {"visible_rms_um": case.visible_rms_um}
    return {"spec": spec, "source": "x", "truth": truth, "wall_s": 1.0, **diagnosis_outcome(diagnosis, case)}


@pytest.fixture(scope="module")
def slow() -> HiddenCase:
    return draw_case(5, ("slow_relaxation",), excitation="short")


def _relaxation(case: HiddenCase, factor: float = 1.0) -> _Found:
    true = case.parameters["slow_relaxation"]
    return _Found("slow_relaxation", {**true, "amplitude": factor * true["amplitude"]})


def test_scores(slow: HiddenCase) -> None:
    right = _outcome(slow, "explained", _relaxation(slow, 1.05))
    assert is_first(right)
    assert is_exact(right)
    assert right["findings"][0]["parameter_error"] == pytest.approx(0.05)
    more = _outcome(slow, "explained", _relaxation(slow), _Found("mains_hum", {"frequency_hz": 50.0}))
    assert is_first(more)
    assert not is_exact(more)
    assert n_false(more) == 1
    wrong = _outcome(slow, "explained", _Found("mains_hum", {"frequency_hz": 50.0}))
    assert not is_first(wrong)
    assert is_misled(wrong)
    assert not is_misled(wrong | {"status": "ambiguous", "ambiguous_with": ["slow_relaxation"]})
    assert answer(_outcome(slow, "nothing_found")) == "nothing_found"


def test_page_tells_what_is_not_met_and_what_broke_off(slow: HiddenCase, tmp_path: Path) -> None:
    right = _outcome(slow, "explained", _relaxation(slow))
    wrong = _outcome(slow, "explained", _Found("mains_hum", {"frequency_hz": 50.0}))
    broken = {**right, "status": "error", "findings": [], "error": "x"}
    first_row = [row for row in bars({"single": [right]}) if "named first" in row]
    assert first_row[0].endswith("| yes |")
    for group in ([right, wrong], [right] * 99 + [broken]):
        assert next(row for row in bars({"single": group}) if "named first" in row).endswith("**no** |")
    rows, columns, counts = confusion([right, wrong])
    line = counts[rows.index("slow_relaxation")]
    assert line[columns.index("slow_relaxation")] == line[columns.index("mains_hum")] == 1
    page = write([right, wrong], tmp_path).read_text(encoding="utf-8")
    assert "1/2 (50 %)" in page
    assert (tmp_path / "confusion_matrix.png").stat().st_size > 10_000


def test_plan_covers_every_cause() -> None:
    assert {s.causes[0] for s in plan("single")} == set(CAUSES)
    assert len(plan("null")) == 50
    assert len(plan("single")) == 10 * len(CAUSES)
    assert len(plan("pairs")) == 40
    assert all(s.excluded == s.causes for s in plan("removed"))
    keys = [s.key for part in PARTS for s in plan(part)]
    assert len(keys) == len(set(keys))


def test_sensor_is_judged_by_its_curve() -> None:
    case = draw_case(6, ("sensor_nonlinearity",), excitation="short")
    true = case.parameters["sensor_nonlinearity"]
    assert parameter_error("sensor_nonlinearity", true, true, case) == pytest.approx(0.0, abs=1e-12)
    twice = {name: 2.0 * value for name, value in true.items()}
    assert parameter_error("sensor_nonlinearity", true, twice, case) == pytest.approx(1.0)

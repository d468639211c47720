"""The second world's study counts right: made-up outcomes against its bars."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from test.hidden.second.coarse_model import CoarseModel
from test.hidden.second.hidden_causes import KNOWN_CAUSES, NEW_CAUSES
from test.hidden.second.second_case import SecondCase, draw
from test.hidden.second.surrogate import Trace
from test.hidden.study_recording import recording_of
from test.hidden.study_second import FIRST_SEED, GROUPS, model_of, plan, truth_of
from test.hidden.study_second_parameters import second_parameter_error
from test.hidden.study_second_report import second_page, write_second
from test.hidden.study_second_scores import (
    accepted,
    calibrated,
    is_clean_null,
    is_first_or_open,
    is_first_right,
    is_halved,
    is_right_and_complete,
    is_worse,
    is_wrong_and_explained,
)

_SEED = FIRST_SEED["development"]


def _outcome(
    causes: tuple[str, ...], names: tuple[str, ...], status: str = "explained", group: str = "known", **more: Any
) -> dict[str, Any]:
    spec = {"group": group, "part": f"second_{group}", "seed": _SEED, "causes": list(causes), "form": "representable"}
    found = [
        {"cause": name, "probability": 0.95, "parameter_error": 0.01 if name in causes else None} for name in names
    ]
    truth = {
        "is_representable": True,
        "noise_kind": "white",
        "visible_over_noise": {c: [9.0, 11.0] for c in causes},
        "scale": {"rate_hz": 3.0},
        "n_samples": [500, 300, 300],
        "drive_kinds": {"test": ["chirp"]},
    }
    return {
        "spec": {**spec, "noise": None, "faults": []},
        "source": "x",
        "status": status,
        "findings": found,
        "truth": truth,
        "cpu_s": 3.0,
        "report_over_noise_before": 10.0,
        "report_over_noise_after": 1.1,
        **more,
    }


def test_scores() -> None:
    right = _outcome(("mains_hum",), ("mains_hum",))
    assert is_first_right(right)
    assert is_right_and_complete(right)
    assert not is_wrong_and_explained(right)
    wrong = _outcome(("mains_hum",), ("clock_skew",))
    assert is_wrong_and_explained(wrong)
    assert not is_wrong_and_explained(wrong | {"status": "ambiguous"})
    assert not is_right_and_complete(_outcome(("mains_hum", "gain_drift"), ("mains_hum",)))
    assert is_clean_null(_outcome((), (), "nothing_found"))
    assert not is_clean_null(_outcome((), (), "unexplained"))
    assert is_halved(right)
    assert not is_halved(right | {"report_over_noise_after": 6.0})
    assert is_worse(right | {"report_over_noise_after": 10.6})
    assert calibrated([right, wrong]) == [(0.95, True), (0.95, False)]
    assert accepted(_outcome(("second_mode",), ())) == {"second_mode", "mechanical_resonance"}


def test_a_cause_may_be_left_open_only_where_no_drive_tells_it_from_another() -> None:
    told = _outcome(("transport_delay",), ("sensor_bandwidth",), "ambiguous", ambiguous_with=["transport_delay"])
    near = {**told["truth"], "rival": {"cause": "sensor_bandwidth", "distinct_over_noise": 0.1}}
    far = {**told["truth"], "rival": {"cause": "sensor_bandwidth", "distinct_over_noise": 3.0}}
    assert is_first_or_open(told | {"truth": near})
    assert not is_first_or_open(told | {"truth": far})
    assert not is_first_or_open(told | {"truth": near, "ambiguous_with": []})
    assert not is_first_or_open(told | {"truth": near, "status": "explained"})


def test_a_name_of_form_is_not_wrong_where_plays_cannot_be_the_truth() -> None:
    named = _outcome((), ("asymmetric_hysteresis",))
    assert is_wrong_and_explained(named)
    bent = {**named["truth"], "is_representable": False, "form_error_over_noise": 8.0}
    assert not is_wrong_and_explained(named | {"truth": bent})
    assert is_wrong_and_explained(named | {"truth": {**bent, "form_error_over_noise": 0.2}})


def test_page_tells_what_is_not_met(tmp_path: Path) -> None:
    good = [_outcome((c,), (c,)) for c in KNOWN_CAUSES]
    bad = _outcome(("mains_hum",), ("clock_skew",), "explained")
    nulls = [_outcome((), (), "nothing_found", "null") for _ in range(9)]
    broken = _outcome((), (), "error", "scales", error="RecordingError('x')")
    page = write_second([*good, bad, *nulls, broken], "development", tmp_path).read_text(encoding="utf-8")
    rows = {line.split("|")[1].strip(): line for line in page.splitlines() if line.count("|") == 5}
    assert rows["wrong name and `explained`"].endswith("**no** |")
    assert "1/29" in rows["wrong name and `explained`"]
    assert rows["known single effects: first"].endswith("**no** |")
    assert "18/19" in rows["known single effects: first"]
    assert rows["nothing hidden, noise of six kinds and spikes"].endswith("yes |")
    assert rows["aborts over 1 random scales"].endswith("**no** |")
    assert rows["calibration: names with p >= 0.9"].endswith("yes |")
    assert "1x clock_skew" in page
    assert "RecordingError" in page
    assert "from 0 cases" in second_page([*good], "reporting")


@pytest.mark.parametrize("seeds", ["development", "reporting"])
def test_plan_keeps_seeds_apart_and_covers_everything(seeds: str) -> None:
    specs = [s for group in GROUPS for s in plan(group, seeds)]
    assert len({s.key for s in specs}) == len({s.seed for s in specs}) == len(specs)
    low = FIRST_SEED[seeds]
    assert all(low <= s.seed < low + 10_000 for s in specs)
    single = [s.causes[0] for s in specs if s.group in ("known", "new")]
    assert {c: single.count(c) for c in single} == dict.fromkeys((*KNOWN_CAUSES, *NEW_CAUSES), 5)
    assert sum(s.group == "scales" for s in specs) == 300
    assert sum(s.group != "scales" for s in specs) >= 200


@pytest.fixture(scope="module")
def case() -> SecondCase:
    return draw(10_999, ("sensor_nonlinearity",), noise="white", n_samples=(300, 600))


def test_records_are_handed_over_as_they_are(case: SecondCase) -> None:
    recording = recording_of(case.train)
    assert np.array_equal(recording.voltage_v, case.train.voltage_v)
    assert recording.displacement_um is not None
    assert np.array_equal(recording.displacement_um, case.train.measured_um)
    told = truth_of(case)
    assert told["visible_over_noise"]["sensor_nonlinearity"][1] >= 5.0
    assert told["n_samples"][0] == case.train.time_s.size


def test_sensor_is_judged_by_its_curve(case: SecondCase) -> None:
    true = case.parameters["sensor_nonlinearity"]
    assert second_parameter_error("sensor_nonlinearity", true, true, case) == pytest.approx(0.0, abs=1e-12)
    twice = {name: 2.0 * value for name, value in true.items()}
    assert second_parameter_error("sensor_nonlinearity", true, twice, case) == pytest.approx(1.0)


def test_coarse_model_is_the_same_to_the_product() -> None:
    case = draw(10_998, ("missing_hysteresis",), noise="white", n_samples=(600, 900))
    model = model_of(case)
    assert model is not None
    assert isinstance(case.coarse, CoarseModel)
    step_s = float(case.train.time_s[1])
    found = model.simulate(np.full(case.train.time_s.size, step_s), case.train.voltage_v)
    expected = case.coarse.displacement_um(Trace(case.train.voltage_v, step_s))
    assert np.std(found - expected) < 2e-4 * case.scale.stroke_um

"""The third world's cases: as promised in size, the same for one seed, and of nobody else's code."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import numpy as np
import pytest

from test.hidden.study_third import FIRST_SEED, GROUPS, plan
from test.hidden.study_third_report import third_page
from test.hidden.third.bench import draw_bench
from test.hidden.third.catalogue import EFFECTS, KNOWN_NAMES, UNLISTED_NAMES
from test.hidden.third.chain import readings_um
from test.hidden.third.drives import draw_kinds
from test.hidden.third.effect import STAGES
from test.hidden.third.frame import draw_frame
from test.hidden.third.sizing import VISIBLE_IN_TEST, VISIBLE_IN_TRAINING
from test.hidden.third.surrogate import Base
from test.hidden.third.third_case import Order, ThirdCase, draw

_HERE = Path(__file__).parent
_SHORT = (2000, 2400)


def _causes_of_the_page() -> set[str]:
    page = (_HERE.parents[2] / "docs" / "causes.md").read_text(encoding="utf-8")
    return set(re.findall(r"^\| \[(\w+)\]\(#", page, flags=re.MULTILINE))


def test_every_cause_of_the_page_can_be_hidden_and_the_unlisted_are_not_on_it() -> None:
    assert set(KNOWN_NAMES) == _causes_of_the_page()
    assert not set(UNLISTED_NAMES) & _causes_of_the_page()
    assert len(UNLISTED_NAMES) >= 8
    assert {stage for effect in EFFECTS.values() for stage in effect.acts} <= set(STAGES)


@pytest.mark.parametrize(
    ("seed", "order"),
    [
        (1, Order(("amplifier_bandwidth",), lengths=_SHORT)),
        (2, Order(("gain_drift", "slow_relaxation"), noise="flicker", lengths=_SHORT)),
        (3, Order(form="duhem", lengths=_SHORT)),
    ],
)
def test_what_is_hidden_is_as_visible_as_promised(seed: int, order: Order) -> None:
    case = draw(seed, order)
    assert set(case.visible_um) == set(order.causes or [order.form])
    for seen in case.visible_um.values():
        assert VISIBLE_IN_TRAINING[0] <= seen.training_um / case.noise_um <= VISIBLE_IN_TRAINING[1]
        assert VISIBLE_IN_TEST[0] <= seen.test_um / case.noise_um <= VISIBLE_IN_TEST[1]
    for record in case.records:
        assert np.std(record.measured_um - record.clean_um) == pytest.approx(case.noise_um, rel=0.3)


@pytest.mark.parametrize("seed", [11, 12])
def test_a_base_that_is_right_exists_where_nothing_is_hidden(seed: int) -> None:
    case = draw(seed, Order(lengths=_SHORT))
    rng = np.random.default_rng([seed, 0])
    bench, kinds = draw_bench(rng, "masing", _SHORT, is_bipolar=False), draw_kinds(rng, is_smooth=False)
    frame = draw_frame(rng, bench, 0, kinds[0], frozenset())
    assert Base(frame).fit(readings_um(frame))[1] < 1e-3 * bench.stroke_um
    assert case.hidden == ()
    assert case.records[0].voltage_v[0] == 0.0


def _numbers(case: ThirdCase) -> np.ndarray:
    return np.concatenate([part for r in case.records for part in (r.time_s, r.voltage_v, r.measured_um)])


def test_a_seed_is_a_case() -> None:
    order = Order(("initial_state",), lengths=_SHORT)
    first, again, other = (draw(seed, order) for seed in (21, 21, 22))
    assert np.array_equal(_numbers(first), _numbers(again))
    assert first.hidden[0].values == again.hidden[0].values
    assert not np.array_equal(first.records[0].measured_um[:500], other.records[0].measured_um[:500])


def test_the_truth_is_of_nobody_elses_code() -> None:
    own = "test.hidden.third"
    for path in sorted(_HERE.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            for name in names:
                assert not name.startswith("fomrc"), path.name
                is_test_of_study = path.name == Path(__file__).name and name.startswith("test.hidden.study_third")
                assert not name.startswith("test.") or name.startswith(own) or is_test_of_study, (path.name, name)


def test_plans_are_of_their_seeds_and_no_case_is_planned_twice() -> None:
    for seeds, first in FIRST_SEED.items():
        specs = [spec for group in GROUPS for spec in plan(group, seeds)]
        assert {spec.seed for spec in specs} <= set(range(first, first + 10_000))
        assert len({spec.seed for spec in specs}) == len({spec.key for spec in specs}) == len(specs)
    assert {s.causes for s in plan("known", "development", 1)} == {(name,) for name in KNOWN_NAMES}
    with pytest.raises(ValueError, match="group"):
        plan("none")


def test_the_page_counts_what_was_said() -> None:
    def outcome(group: str, seed: int, causes: list[str], names: list[str], status: str) -> dict[str, object]:
        spec = {"group": group, "part": f"third_{group}", "seed": 30_000 + seed, "causes": causes, "form": "masing"}
        found = [{"cause": name, "probability": 0.9} for name in names]
        return {"spec": {**spec, "noise": "white"}, "status": status, "findings": found, "source": "s", "cpu_s": 2.0}

    said = [
        outcome("null", 0, [], [], "nothing_found"),
        outcome("known", 1, ["mains_hum"], ["mains_hum"], "explained"),
        outcome("known", 2, ["mains_hum"], ["gain_drift"], "explained"),
        outcome("pairs", 3, ["mains_hum", "gain_drift"], ["gain_drift", "mains_hum"], "explained"),
        outcome("unknown", 4, ["floor_tilt"], ["thermal_drift"], "partial"),
        outcome("unknown", 5, ["floor_tilt"], [], "unexplained"),
        outcome("forms", 6, [], ["asymmetric_hysteresis"], "partial"),
    ]
    page = third_page(said, "development")
    for row in (
        "wrong name and `explained`, of all | 1/7",
        "nothing hidden: `nothing_found` | 1/1",
        "single causes: first | 1/2",
        "pairs: all found | 1/1",
        "no name with p >= 0.9 | 1/2",
        "no wrong name with p >= 0.9 | 1/1",
        "| 0.9 to 0.95 | 6 | 67 % |",
    ):
        assert row in page
    assert "0 cases" in third_page(said, "reporting")

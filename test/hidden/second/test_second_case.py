"""Cases of the second world: fair, repeatable, of every scale; and nobody's copy."""

from __future__ import annotations

import ast
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from test.hidden.all_cases import some_of
from test.hidden.second.bench import draw_bench
from test.hidden.second.data_faults import FAULT_KINDS
from test.hidden.second.hidden_causes import BELONG_TO_ONE_RECORD, DRAWS, KNOWN_CAUSES, MISSING, NEW_CAUSES
from test.hidden.second.hysteresis_forms import OTHER, REPRESENTABLE
from test.hidden.second.scale import chance
from test.hidden.second.second_case import SecondCase, draw
from test.hidden.second.sensor_noise import NOISE_KINDS
from test.hidden.second.sizing import LEAST_OVER_NOISE, MOST_OVER_NOISE, Sizing

_HERE = Path(__file__).parent
_SHORT = (400, 900)


def _imports(path: Path) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}: relative import"
            found.update(f"{node.module}.{alias.name}" for alias in node.names)
    return found


@pytest.mark.parametrize(
    "path", [p for p in sorted(_HERE.glob("*.py")) if not p.name.startswith("test_")], ids=lambda p: p.name
)
def test_the_second_world_shares_no_code(path: Path) -> None:
    for module in _imports(path):
        root = module.split(".")[0]
        own = module.startswith("test.hidden.second.")
        assert own or root in sys.stdlib_module_names - {"test"} | {"numpy", "scipy"}, f"{path.name} imports {module}"


@pytest.mark.parametrize("cause", some_of((*KNOWN_CAUSES, *NEW_CAUSES), 4))
def test_every_cause_is_hidden_visible_and_nothing_else(cause: str) -> None:
    case = draw(11_000, (cause,), n_samples=_SHORT)
    assert set(case.parameters) == set(case.visible_um) == {cause}
    train, test = (v / case.noise_um for v in case.visible_um[cause])
    assert train >= 4.0
    if cause == MISSING:
        assert case.coarse is not None
        assert case.coarse.thresholds_v.size == case.parameters[cause]["n_plays_given"]
    else:
        assert case.coarse is None
        is_in_test = case.sizing.bench.befalls_all or cause not in BELONG_TO_ONE_RECORD
        judged = test if is_in_test else train
        assert LEAST_OVER_NOISE <= judged <= MOST_OVER_NOISE
    assert case.form_error_um <= 0.3 * case.noise_um


def test_a_pure_lag_has_a_near_rival_and_a_tone_has_none() -> None:
    lag = draw(11_070, ("transport_delay",), noise="white", n_samples=_SHORT)
    found = lag.nearest_rival("transport_delay")
    train, test = (v / lag.noise_um for v in lag.visible_um["transport_delay"])
    assert found.cause
    assert found.distinct_over_noise < 0.5 * max(train, test)
    tone = draw(11_071, ("mains_hum",), noise="white", n_samples=_SHORT)
    assert tone.nearest_rival("mains_hum").cause == ""
    assert tone.nearest_rival("mains_hum").distinct_over_noise >= 4.0


def test_causes_are_those_of_the_library_and_of_the_issue() -> None:
    assert len(KNOWN_CAUSES) == 18
    assert len(NEW_CAUSES) == 14
    assert set(DRAWS) | {MISSING} == {*KNOWN_CAUSES, *NEW_CAUSES}


def _arrays(case: SecondCase) -> list[np.ndarray]:
    return [values for r in case.records for values in (r.time_s, r.voltage_v, r.measured_um, r.clean_um)]


def test_a_seed_gives_one_case() -> None:
    first, second = (draw(11_001, ("gain_drift",), n_samples=_SHORT) for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(_arrays(first), _arrays(second), strict=True))
    assert first.parameters == second.parameters
    other = draw(11_002, ("gain_drift",), n_samples=_SHORT)
    assert other.parameters != first.parameters


@pytest.mark.parametrize("form", some_of((*REPRESENTABLE, *OTHER), 2))
def test_form_error_says_whether_plays_can_be_it(form: str) -> None:
    errors = [draw(seed, form=form, noise="white", n_samples=_SHORT).form_error_um for seed in (11_010, 11_011)]
    strokes = [draw(seed, form=form, noise="white", n_samples=_SHORT).scale.stroke_um for seed in (11_010, 11_011)]
    shares = np.array(errors) / np.array(strokes)
    if form in REPRESENTABLE:
        assert np.max(shares) < 1e-3
    else:
        assert np.max(shares) > 5e-4


@pytest.mark.parametrize("noise", NOISE_KINDS)
def test_noise_is_of_its_kind_and_rms(noise: str) -> None:
    case = draw(11_020, noise=noise, n_samples=(3000, 4000))
    assert case.noise_kind == noise
    error = case.train.measured_um - case.train.clean_um
    expected = case.noise_um
    # One realisation of slow noise may be well off the rms it has on average.
    assert np.std(error) == pytest.approx(expected, rel=0.6 if noise in ("walk", "flicker") else 0.1)


@pytest.mark.parametrize("fault", FAULT_KINDS)
def test_faults_are_in_the_records_and_the_key(fault: str) -> None:
    case, same = (draw(11_030, faults=f, noise="white", n_samples=_SHORT) for f in ((fault,), ()))
    for record, whole in zip(case.records, same.records, strict=True):
        assert [f.kind for f in record.faults] == [fault]
        assert whole.faults == ()
        assert np.array_equal(record.clean_um, whole.clean_um)
    assert not np.array_equal(case.train.measured_um, same.train.measured_um)


def test_scales_reach_from_nanometres_to_millimetres() -> None:
    scales = [draw_bench(chance(seed, "bench"), (), "few_plays", (200, 100_000)).scale for seed in range(200)]
    strokes = [s.stroke_um for s in scales]
    assert min(strokes) < 0.02
    assert max(strokes) > 1e4
    assert {np.sign(s.low_v) for s in scales} == {0.0, -1.0}
    rates = [s.rate_hz for s in scales]
    assert min(rates) < 0.2
    assert max(rates) > 5e4
    lengths = [s.n_samples for s in scales]
    assert min(lengths) < 250
    assert max(lengths) > 80_000


def test_drives_start_at_rest_within_the_range_and_differ() -> None:
    for seed in range(11_040, 11_046):
        bench = draw_bench(chance(seed, "bench"), (), "few_plays", (300, 20_000))
        assert not set(bench.kinds["train"]) & set(bench.kinds["test"])
        for trace in bench.traces:
            assert trace.command_v[0] == 0.0
            assert trace.command_v.min() >= bench.scale.low_v - 1e-9 * bench.scale.span_v
            assert trace.command_v.max() <= bench.scale.high_v + 1e-9 * bench.scale.span_v
        widest = [np.ptp(trace.command_v) for trace in bench.traces]
        assert widest[0] >= 0.97 * bench.scale.span_v


@pytest.mark.parametrize(
    "cause",
    some_of(
        (
            None,
            "amplifier_slew_limit",
            "unequal_lag",
            "mechanical_resonance",
            "voltage_dependent_capacitance",
            "rate_dependent_hysteresis",
            "clock_skew",
        ),
        3,
    ),
)
def test_steps_of_the_physics_are_fine_enough(cause: str | None) -> None:
    causes = () if cause is None else (cause,)
    case = draw(11_050, causes, n_samples=_SHORT, noise="white")
    bench = draw_bench(chance(11_050, f"bench {case.n_attempts - 1}"), causes, "representable", _SHORT)
    finer = replace(bench, actuator=replace(bench.actuator, oversampling=4 * bench.actuator.oversampling))
    found = [Sizing(b, 1).clean_um(0, case.parameters) for b in (bench, finer)]
    assert np.sqrt(np.mean((found[1] - found[0]) ** 2)) < 0.5 * case.noise_um


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"causes": ("gremlins",)}, "gremlins"),
        ({"causes": ("mains_hum", "mains_hum")}, "each once"),
        ({"noise": "pink"}, "pink"),
        ({"faults": ("fire",)}, "fire"),
        ({"form": "square"}, "square"),
    ],
)
def test_what_is_not_known_is_named(arguments: dict[str, object], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        draw(11_060, **arguments)  # type: ignore[arg-type]

"""The watch: its evidence is evidence, normal work is silent, changes are seen and named, memory is bounded.

The stage is that of test/hidden/watch, which shares no code with the product.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from small_model import MODEL

from fomrc_core.diagnosis.watch.change_detector import ChangeDetector, log_evidence, n_dependent
from fomrc_core.diagnosis.watch.model_watch import ModelWatch, WatchSettings, WatchState
from fomrc_core.diagnosis.watch.naming import name_case, name_change
from fomrc_core.errors import ParameterError
from fomrc_core.identification.convex import identify
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.recording import Recording
from test.hidden.watch.stage import Stage, draw_stage
from test.hidden.watch.work import calibration, motion

RATE_HZ = 100.0
SETTINGS = WatchSettings(learn_s=60.0, memory_s=90.0)
NORMAL_S = 150.0


@pytest.mark.parametrize("is_signed", [True, False])
def test_evidence_has_mean_one_at_most_in_normal_work(is_signed):
    x = np.linspace(-39.0, 39.0, 200_001)
    evidence = log_evidence(x, is_signed=is_signed)

    def mean_in(width: float) -> np.ndarray:
        log_density = -0.5 * (x / width) ** 2 - np.log(np.sqrt(2.0 * np.pi) * width)
        return np.trapezoid(np.exp(evidence + log_density[:, None]), x, axis=0)

    # Of each alternative it is one, but for what lies beyond the values that are told apart; less in a narrower normal.
    assert np.all(mean_in(1.0) <= 1.0 + 1e-9)
    assert np.all(mean_in(1.0) > 0.98)
    assert np.all(mean_in(0.7) < 1.0)


def test_dependence_is_the_sum_of_the_autocorrelation():
    rng = np.random.default_rng(1)
    correlated = np.zeros(20_000)
    for k in range(1, correlated.size):
        correlated[k] = 0.9 * correlated[k - 1] + rng.standard_normal()
    assert n_dependent(correlated) == pytest.approx(1.9 / 0.1, rel=0.25)
    assert n_dependent(rng.standard_normal(20_000)) == 4.0


def test_false_alarms_are_no_more_frequent_than_stated():
    rng = np.random.default_rng(2)
    mean_blocks = 50.0
    runs = []
    for _ in range(100):
        detector = ChangeDetector([1.0, 1.0], [True, False], mean_blocks)
        crossing = detector.add(rng.standard_normal((2_000, 2)))
        runs.append(detector.n_blocks if crossing is None else crossing.block + 1)
    print(f"mean of {np.mean(runs):.0f} blocks to a false alarm, at least {mean_blocks:.0f} stated")
    assert np.mean(runs) >= mean_blocks


def test_a_shift_is_seen_soon_and_since_when():
    rng = np.random.default_rng(3)
    values = rng.standard_normal((400, 1))
    values[300:] += 5.0
    crossing = ChangeDetector([2.0], [True], 1e6).add(values)
    assert crossing is not None
    assert 300 <= crossing.block < 310
    assert abs(crossing.since_block - 300) <= 2


@given(cuts=st.lists(st.integers(1, 299), max_size=6))
def test_blocks_may_come_in_any_parts(cuts):
    values = np.random.default_rng(4).standard_normal((300, 2))
    values[200:] += 1.5
    whole, parts = (ChangeDetector([3.0, 5.0], [True, False], 1e3) for _ in range(2))
    expected = whole.add(values)
    found = None
    for part in np.split(values, sorted(set(cuts))):
        found = found or parts.add(part)
    assert found == expected


@pytest.fixture(scope="module")
def stage() -> Stage:
    return replace(draw_stage(3), is_quasistatic=True)


@pytest.fixture(scope="module")
def fitted(stage):
    drive = calibration(stage.largest_v, RATE_HZ)
    moved = stage.measured_um(stage.displacement_um(drive, RATE_HZ), np.random.default_rng(1))
    return identify([Recording(np.arange(drive.size) / RATE_HZ, drive, moved)], n_elements=15)


def watched(fitted, stage, seed: int, spoil=lambda moved, time_s: moved, duration_s: float = 250.0):
    drive = motion(duration_s, stage.largest_v, RATE_HZ, np.random.default_rng((seed, 1)))
    clean = stage.displacement_um(drive, RATE_HZ)
    moved = stage.measured_um(spoil(clean, np.arange(drive.size) / RATE_HZ), np.random.default_rng((seed, 2)))
    watch = ModelWatch(fitted.model, 1.0 / RATE_HZ, SETTINGS, fitted.rms_um)
    alarms, case = [], None
    for start in range(0, drive.size, 730):  # in parts of no block's length
        part = slice(start, start + 730)
        alarms += watch.take(np.full(drive[part].size, 1.0 / RATE_HZ), drive[part], moved[part])
        case = case or watch.next_case()
    return watch, alarms, case or watch.next_case(is_last=True)


def test_work_other_than_the_calibration_is_silent(fitted, stage):
    watch, alarms, case = watched(fitted, stage, 1, duration_s=900.0)
    assert watch.state is WatchState.WATCHING
    assert alarms == []
    assert case is None
    assert watch.past.recording().time_s[-1] < SETTINGS.memory_s + 15.0, "what is kept of the past is bounded"


def test_lost_displacements_are_no_change(fitted, stage):
    def lost(moved, time_s):
        return np.where((time_s > NORMAL_S) & (time_s % 7.0 < 0.8), np.nan, moved)

    _, alarms, _ = watched(fitted, stage, 1, lost)
    assert alarms == []


@pytest.mark.parametrize("at_s", [NORMAL_S + 0.5, NORMAL_S + 3.3])
def test_the_moment_of_a_change_does_not_shift_its_size(fitted, stage, at_s):
    _, _, case = watched(fitted, stage, 2, lambda x, t: np.where(t > at_s, 0.8 * x, x))
    found = name_case(case)
    assert found.cause == "sensor_scale"
    assert found.named[0].parameters["relative_change"] == pytest.approx(-0.2, rel=0.01)
    assert case.began_s + found.since_s == pytest.approx(at_s, abs=0.2)


@pytest.mark.parametrize("seed", [2, 8, 15, 23])
def test_another_scale_is_no_kink_at_the_end_of_the_stroke(seed):
    """Both are the same where the kink lies above all that was reached; what a wrong moment leaves had told them."""
    rng = np.random.default_rng(seed)
    model, rate_hz, began_s = PiezoModel.from_mapping(MODEL), 250.0, 20.0 + rng.uniform(0.0, 1.0)
    time_s = np.arange(int(rate_hz * rng.uniform(29.0, 40.0))) / rate_hz
    angles = np.multiply.outer(time_s, [2.0, 5.3, 0.7]) + rng.uniform(0.0, 2.0 * np.pi, 3)
    drive = np.sin(angles) @ [0.04, 0.02, 0.015]
    moved = model.simulate(np.full(time_s.size, 1.0 / rate_hz), drive)
    factor = float(np.exp(rng.uniform(np.log(0.5), np.log(1.5))))
    read = np.where(time_s < began_s, moved, factor * moved) + 1e-4 * np.ptp(moved) * rng.standard_normal(time_s.size)
    found = name_change(model, Recording(time_s, drive, read), 20.0)
    assert found.cause == "sensor_scale", str(found)
    assert found.named[0].parameters["relative_change"] == pytest.approx(factor - 1.0, rel=0.005)
    assert found.since_s == pytest.approx(began_s, abs=2.0 / rate_hz)


@pytest.mark.parametrize("gap_s", [-1.0, 0.4, 6.0])
@pytest.mark.parametrize("seed", [2, 8, 15, 23])
def test_a_gap_near_a_change_does_not_take_its_name(seed, gap_s):
    """Stages and machines stall: a record ends just after a change or with it, and the next one begins anew."""
    rng = np.random.default_rng(seed)
    model, rate_hz, began_s = PiezoModel.from_mapping(MODEL), 250.0, 60.0 + rng.uniform(0.0, 1.0)
    time_s = np.arange(int(rate_hz * 130.0)) / rate_hz
    angles = np.multiply.outer(time_s, [2.0, 5.3, 0.7]) + rng.uniform(0.0, 2.0 * np.pi, 3)
    drive = np.sin(angles) @ [0.04, 0.02, 0.015]
    steps_s = np.full(time_s.size, 1.0 / rate_hz)
    moved = model.simulate(steps_s, drive)
    read = np.where(time_s < began_s, moved, 0.8 * moved) + 1e-4 * np.ptp(moved) * rng.standard_normal(time_s.size)
    settings = WatchSettings(learn_s=20.0, memory_s=60.0, follow_s=6.0)
    watch = ModelWatch(model, 1.0 / rate_hz, settings, 1e-4 * float(np.ptp(moved)))
    # Less than nothing: the gap holds the change, and nothing before it is there to compare with.
    last = int(rate_hz * (began_s + gap_s))
    cases = []
    for begun, ended in ((0, last), (last + int(1.5 * rate_hz), time_s.size)):
        for start in range(begun, ended, 50):
            part = slice(start, min(start + 50, ended))
            watch.take(steps_s[part], drive[part], read[part])
            if (case := watch.next_case()) is not None:
                cases.append(case)
        watch.begin_record()
    found = name_case(cases[0])
    assert found.cause == "sensor_scale", str(found)
    assert found.named[0].parameters["relative_change"] == pytest.approx(-0.2, rel=0.01)


@pytest.mark.parametrize(
    ("spoil", "cause"),
    [
        (lambda x, t: np.where(t > NORMAL_S, 1.01 * x, x), "sensor_scale"),
        (lambda x, t: x + 0.03 * (t > NORMAL_S), "external_load"),
        (lambda x, t: x + 0.02 * np.sin(2.0 * np.pi * 16.7 * t) * (t > NORMAL_S), "mains_hum"),
    ],
    ids=["scale", "load", "hum"],
)
def test_a_change_is_seen_and_named(fitted, stage, spoil, cause):
    _, alarms, case = watched(fitted, stage, 2, spoil)
    assert len(alarms) == 1
    assert NORMAL_S < alarms[0].time_s < NORMAL_S + 40.0
    found = name_case(case)
    print(found)
    assert found.cause == cause
    assert abs(case.began_s + found.since_s - NORMAL_S) < 20.0
    if cause == "sensor_scale":
        assert found.named[0].parameters["relative_change"] == pytest.approx(0.01, rel=0.05)
        assert found.model is not None
        assert found.after_nm < 0.3 * found.before_nm


@pytest.mark.parametrize(
    ("change", "said"),
    [({"learn_s": 1.0}, "learn_s"), ({"false_alarms_per_day": 0.0}, "false_alarms_per_day")],
)
def test_settings_that_make_no_sense_are_refused(change, said):
    with pytest.raises(ParameterError, match=said):
        WatchSettings(**change)


def test_what_is_no_number_is_refused(fitted):
    watch = ModelWatch(fitted.model, 0.01)
    with pytest.raises(ParameterError, match="not finite"):
        watch.take(np.full(3, 0.01), np.zeros(3), np.array([0.0, np.inf, 0.0]))
    with pytest.raises(ParameterError, match="not finite"):
        watch.take(np.full(3, 0.01), np.array([0.0, np.nan, 0.0]), np.zeros(3))
    with pytest.raises(ParameterError, match="do not fit"):
        watch.take(np.full(3, 0.01), np.zeros(2), np.zeros(3))

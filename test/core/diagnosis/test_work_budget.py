"""The work of a search: counted alike whoever does it, pairs given up before single causes, and told in the answer."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from fomrc_core.diagnosis import work_budget
from fomrc_core.diagnosis.data_split import split_data
from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.diagnosis.judgement import Status
from fomrc_core.diagnosis.search import search
from fomrc_core.diagnosis.work_budget import CAUSES, COMPARED, PAIRS, WorkBudget, cut_short, unless_uncompared
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.base.effect import Stage
from fomrc_core.effects.sensor_bandwidth import SensorBandwidth
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.fitting.work_of_run import operations_of_run
from fomrc_core.records.recording import Recording

RATE_HZ = 100.0
PLAIN = TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([2.0]), 0.0, (), ((), ()))


def _measured(seed: int) -> Recording:
    """Return a stage with a converter's steps and an error of its sensor, made here with numpy alone."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(2000) / RATE_HZ
    lines_hz, phases = rng.uniform(0.05, 1.0, 6), rng.uniform(0.0, 2.0 * np.pi, 6)
    voltage_v = np.sum(np.sin(2.0 * np.pi * lines_hz[:, None] * time_s + phases[:, None]), axis=0)
    moved_um = 2.0 * 0.08 * np.round(voltage_v / 0.08)
    seen_um = moved_um + 0.1 * np.sin(2.0 * np.pi * moved_um / 0.9)
    return Recording(time_s, voltage_v, seen_um + rng.normal(0.0, 0.01, time_s.size))


def test_a_simulation_counts_by_its_samples_in_whatever_choice_of_them() -> None:
    split = split_data((_measured(1),), _measured(2), None, 0.01)
    budget = WorkBudget.of(split)
    record = split.train[0]
    predict(PLAIN, record, 0)
    once = budget.n_done()
    assert once >= record.time_s.size
    predict(PLAIN, record.using(np.arange(record.time_s.size) < 100), 0)
    assert budget.n_done() == 2 * once
    # a search that begins later has not done what went before
    assert WorkBudget.of(split).n_done() == 0


def test_of_a_run_that_goes_on_from_another_only_what_is_run_is_counted() -> None:
    effects = (AmplifierBandwidth(10.0), SensorBandwidth(20.0))
    whole = operations_of_run(effects, Stage.SAMPLED_DRIVE, 1000, 4000, 40, is_begun=False)
    sensor = operations_of_run(effects, Stage.SENSED, 1000, 4000, 40, is_begun=False)
    doubled = operations_of_run(effects, Stage.SAMPLED_DRIVE, 1000, 8000, 40, is_begun=False)
    # what a run costs however short it is, its samples, and the one effect on the sensor stay
    assert whole - sensor > 0.9 * (doubled - whole)
    assert operations_of_run(effects, Stage.SAMPLED_DRIVE, 1000, 4000, 40, is_begun=True) > whole


def test_pairs_end_before_single_causes_and_what_was_left_out_is_told_once() -> None:
    n_done = 0.0
    budget = WorkBudget(lambda: n_done)
    assert budget.allows(PAIRS)
    n_done = 0.5 * (work_budget._FOR_PAIRS + work_budget._FOR_CAUSES)
    assert budget.allows(PAIRS, has_found=False), "without a pair the search would come to nothing"
    assert not budget.allows(PAIRS)
    assert budget.allows(CAUSES)
    assert not budget.allows(PAIRS)
    assert budget.left_out == [PAIRS]
    n_done = work_budget._FOR_CAUSES
    assert not budget.allows(PAIRS, has_found=False)
    assert not budget.allows(CAUSES)
    assert budget.allows(COMPARED), "what was found is compared where no more is sought"
    assert budget.left_out == [PAIRS, CAUSES]


def test_of_longer_records_as_many_questions_are_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    few = WorkBudget(lambda: 1.5 * work_budget._FOR_CAUSES)
    assert not few.allows(CAUSES)
    twice = WorkBudget(lambda: 1.5 * work_budget._FOR_CAUSES, size=2.0)
    assert twice.allows(CAUSES)
    split = split_data((_measured(1),), _measured(2), None, 0.01)
    assert WorkBudget.of(split).size == 1.0
    monkeypatch.setattr(work_budget, "_SAMPLES", 1000)  # the records have 4000, one of them held out twice
    assert WorkBudget.of(split).size == 4.0
    # what is searched once more has been searched before
    assert WorkBudget.of(split, is_once_more=True).size == 2.0
    assert WorkBudget.of(split, is_thorough=True, is_once_more=True).size == 20.0


def test_a_thorough_search_goes_on_where_another_is_cut_short(monkeypatch: pytest.MonkeyPatch) -> None:
    causes = ("dac_quantization", "cyclic_sensor_error")
    split = split_data((_measured(3),), _measured(4), None, 0.01)
    whole = WorkBudget.of(split)
    search(PLAIN, split, causes, lambda *_: None)
    for name in ("_FOR_PAIRS", "_FOR_FIRST_PAIRS", "_FOR_CAUSES", "_FOR_NAMES"):
        monkeypatch.setattr(work_budget, name, 0.2 * whole.n_done())
    assert search(PLAIN, split, causes, lambda *_: None).left_out
    assert search(PLAIN, split, causes, lambda *_: None, is_thorough=True).left_out == ()


def test_names_that_were_not_compared_explain_nothing() -> None:
    assert unless_uncompared(Status.EXPLAINED, (COMPARED,)) is Status.SUSPECT
    assert unless_uncompared(Status.EXPLAINED, (PAIRS,)) is Status.EXPLAINED
    assert unless_uncompared(Status.UNEXPLAINED, (COMPARED,)) is Status.UNEXPLAINED
    assert cut_short(()) == ()


def test_threads_do_as_much_work_as_one_after_the_other() -> None:
    causes = ("dac_quantization", "cyclic_sensor_error", "transport_delay", "thermal_drift")
    counts = []
    with ThreadPoolExecutor(3) as threads:
        for executor in (None, threads):
            split = split_data((_measured(3),), _measured(4), None, 0.01)
            budget = WorkBudget.of(split)
            found = search(PLAIN, split, causes, lambda *_: None, executor)
            assert found.left_out == ()
            counts.append(budget.n_done())
    assert counts[0] == counts[1]


def test_a_search_that_is_cut_short_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(work_budget, "_FOR_PAIRS", 1.0)
    monkeypatch.setattr(work_budget, "_FOR_CAUSES", 1.0)
    found = diagnose((_measured(5),), test=_measured(6))
    assert CAUSES in found.left_out
    assert not found.findings
    assert found.status is Status.UNEXPLAINED
    assert any(CAUSES in doubt for doubt in found.doubts)
    assert str(found).count("cut short") == 1

"""Two causes at once: which are tried as the first of a pair, and how a pair is scored in data it was not learned from.

The truth of these records is a straight line, a converter's steps and a drift, made here with numpy alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.diagnosis import pair_search
from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.diagnosis import Diagnosis, diagnose
from fomrc_core.diagnosis.held_out_score import HeldOutScore
from fomrc_core.diagnosis.joint_screening import LikelyPair
from fomrc_core.diagnosis.pair_fits import FittedPair
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import Screened
from fomrc_core.diagnosis.search_state import SearchState
from fomrc_core.diagnosis.step import Step
from fomrc_core.effects import Effect
from fomrc_core.effects.dac_quantization import DacQuantization
from fomrc_core.effects.gain_drift import GainDrift
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
from fomrc_core.effects.thermal_drift import ThermalDrift
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.fitting.joint_fit import Refit, refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.recording import Recording

RATE_HZ = 100.0
STEP_V = 0.08
NOISE_UM = 0.01
UM_PER_V = 2.0
PLAIN = TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([UM_PER_V]), 0.0, (), ((), ()))


def _measured(seed: int, warmed_um: float) -> Recording:
    """Return a stage behind a coarse converter that warms up while it is measured."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(3000) / RATE_HZ
    lines_hz, phases = rng.uniform(0.05, 1.0, 6), rng.uniform(0.0, 2.0 * np.pi, 6)
    voltage_v = np.sum(np.sin(2.0 * np.pi * lines_hz[:, None] * time_s + phases[:, None]), axis=0)
    reached_v = STEP_V * np.round(voltage_v / STEP_V)
    drift_um = warmed_um * (1.0 - np.exp(-time_s / 12.0))
    return Recording(time_s, voltage_v, UM_PER_V * reached_v + drift_um + rng.normal(0.0, NOISE_UM, time_s.size))


@pytest.fixture(scope="module")
def split() -> DataSplit:
    return split_data((_measured(1, 0.6),), _measured(2, -0.4), None, NOISE_UM)


def test_a_drift_hides_nothing_of_what_acts_beside_it_in_held_out_data(split: DataSplit) -> None:
    drift = ThermalDrift(warm_up_um=0.6, warm_up_s=12.0)
    alone = refit(PLAIN.with_cause(drift, 0), split.train).model
    both = alone.with_cause(DacQuantization(STEP_V))
    score = pair_search.score_of_pair(PLAIN, both, split)
    print(score)
    # the held-out record drifts the other way: the pair is judged by its own drift there
    assert score.rms_after_um == pytest.approx(NOISE_UM, rel=0.1)
    assert score.rms_before_um > 5.0 * NOISE_UM
    # beside the drift the converter is all that is left, and has a say of its own
    beside = pair_search.score_of_pair(PLAIN, alone, split)
    steps_um = UM_PER_V * STEP_V / np.sqrt(12.0)
    assert beside.rms_after_um == pytest.approx(np.hypot(NOISE_UM, steps_um), rel=0.1)


@pytest.fixture(scope="module")
def answer() -> Diagnosis:
    return diagnose((_measured(3, 0.6),), test=_measured(4, -0.4), report=_measured(5, 0.3))


def test_a_converter_and_a_drift_are_both_found_and_both_compared(answer: Diagnosis) -> None:
    print(answer)
    found = {finding.cause: finding for finding in answer.findings}
    assert set(found) == {"dac_quantization", "thermal_drift"}
    assert found["dac_quantization"].parameters["step_v"] == pytest.approx(STEP_V, rel=0.01)
    # neither is unsure for want of a comparison
    assert not any(np.isnan(finding.margin) for finding in answer.findings)


def _candidate(split: DataSplit, cause: str, train_gain: float) -> Candidate:
    fitted = refit(PLAIN, split.train)
    fitted = replace(fitted, squared_error=fitted.squared_error * float(np.exp(-train_gain)))
    return Candidate(cause, fitted, HeldOutScore(0.5, 0.0, 1e-9, 1.0, 0.8), train_gain, (), 2)


def test_a_first_with_plays_of_its_own_is_asked_after_those_without(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Candidate, "brings_plays", property(lambda self: self.cause == "asymmetric_hysteresis"))
    accepted = _candidate(split, "slow_relaxation", 0.9)
    rich = _candidate(split, "asymmetric_hysteresis", 2.2)
    kink, clinging = _candidate(split, "lost_preload", 1.1), _candidate(split, "intermittent_contact", 1.1)
    poor = _candidate(split, "gain_drift", 0.2)

    def firsts(*candidates: Candidate) -> list[str]:
        return [c.cause for c in pair_search._firsts_beside(accepted, [accepted, *candidates], split)]

    assert firsts(rich, kink, poor) == ["lost_preload", "asymmetric_hysteresis"]
    # a contact that does not cling is the kink again
    assert firsts(rich, clinging, kink, poor) == ["lost_preload", "asymmetric_hysteresis"]
    # one that explains hardly more than what was accepted is no reason to ask
    assert firsts(kink, poor) == []


def test_what_was_refused_as_wander_is_a_first_as_well(split: DataSplit, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr(pair_search, "nothing_is_left", lambda *_: False)
    monkeypatch.setattr(pair_search, "_with_pair", lambda _, first: asked.append(first.cause))
    likeliest = replace(_candidate(split, "external_load", 1.5), is_bound=True, is_plausible=False)
    # a warm-up by which training gains little while a load hides it, sure on held-out data all the same
    warm = _candidate(split, "thermal_drift", 0.27)
    unsure = replace(_candidate(split, "creep_law", 0.2), score=HeldOutScore(0.5, 0.0, 0.1, 1.0, 0.8))
    state = SearchState(PLAIN, (), likeliest.fitted, frozenset())
    among = pair_search.Round(state, [likeliest, warm, unsure], split, (), 31, None)
    assert pair_search.any_pair(among) is None
    assert asked == ["external_load", "thermal_drift"]


def test_what_explains_most_in_training_is_a_first_although_it_loses_held_out(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(pair_search, "nothing_is_left", lambda *_: False)
    monkeypatch.setattr(pair_search, "_with_pair", lambda _, first: asked.append(first.cause))
    mode = replace(_candidate(split, "second_mode", 3.9), score=HeldOutScore(-0.4, 0.0, 0.9, 1.0, 1.2))
    poor = replace(_candidate(split, "creep_law", 0.1), score=HeldOutScore(-0.4, 0.0, 0.9, 1.0, 1.2))
    among = pair_search.Round(SearchState(PLAIN, (), mode.fitted, frozenset()), [mode, poor], split, (), 31, None)
    assert pair_search.any_pair(among) is None
    assert asked == ["second_mode"]


def test_a_drift_that_only_wander_speaks_against_is_asked_with_a_second_before_a_lesser_cause_is_taken(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(pair_search, "_with_pair", lambda _, first: asked.append(first.cause))
    leak = _candidate(split, "charge_leak", 1.0)
    drift = replace(_candidate(split, "thermal_drift", 1.2), is_bound=True, is_plausible=False, is_unconfirmed=True)
    backwards = replace(_candidate(split, "external_load", 1.2), is_bound=True, is_plausible=False)
    among = pair_search.Round(
        SearchState(PLAIN, (), leak.fitted, frozenset()), [drift, backwards, leak], split, (), 31, None
    )
    assert pair_search.or_pair((among.state, leak), among) == (among.state, leak)
    assert asked == ["thermal_drift"]


def _with_converter(fitted: Refit, effect: Effect, left: float) -> FittedPair:
    model = PLAIN.with_cause(effect).with_cause(DacQuantization(STEP_V))
    trials = tuple((Screened(cause, None, 1.0, 1.0, 1.0),) for cause in model.effects)
    return FittedPair(LikelyPair(trials[0], trials[1], left), replace(fitted, model=model, squared_error=left))


def test_where_the_pair_that_leaves_least_is_no_finding_the_next_is_asked(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch
) -> None:
    fitted = refit(PLAIN, split.train)
    first, second = _with_converter(fitted, GainDrift(1e-3), 1.0), _with_converter(fitted, TransportDelay(0.004), 1.1)
    state = SearchState(PLAIN, (), fitted, frozenset())
    answer = state, _candidate(split, "transport_delay", 0.9)
    monkeypatch.setattr(pair_search, "fitted_pairs", lambda *_: [first, second])
    monkeypatch.setattr(pair_search, "_in_order", lambda _, asked, *__: answer if asked is second.fitted else None)
    among = pair_search.Round(state, [], split, (), 31, None, present=PresentModel.of(PLAIN, split))
    assert pair_search._told_by_signatures(among, None) is answer
    # beside what was chosen alone it must leave less than half of what that leaves
    chosen = _candidate(split, "slow_relaxation", 0.9)
    chosen = replace(chosen, fitted=replace(chosen.fitted, squared_error=1.9))
    assert pair_search._told_by_signatures(among, chosen) is None


@pytest.mark.parametrize(
    ("left_with_its_second", "left_of_pair", "of_pair", "chosen"),
    [
        (3.0, 60.0, "transport_delay", "slow_relaxation"),
        (59.9, 60.0, "transport_delay", "transport_delay"),
        # what the pair holds already needs no second, and less than noise nothing leaves
        (3.0, 60.0, "slow_relaxation", "slow_relaxation"),
        (1.0, 2.0, "transport_delay", "transport_delay"),
    ],
)
def test_what_was_chosen_gets_a_second_before_two_others_take_its_place(
    split: DataSplit,
    monkeypatch: pytest.MonkeyPatch,
    left_with_its_second: float,
    left_of_pair: float,
    of_pair: str,
    chosen: str,
) -> None:
    def leaving(cause: str, left: float) -> Candidate:
        candidate = _candidate(split, cause, 1.0)
        return replace(candidate, fitted=replace(candidate.fitted, squared_error=left * split.noise_um2))

    accepted, pair = leaving("slow_relaxation", 200.0), leaving(of_pair, left_of_pair)
    state = SearchState(PLAIN, (), accepted.fitted, frozenset())
    first = Step(PLAIN, leaving("gain_drift", 150.0), (), ())
    asked: list[str] = []

    def beside(one: Candidate, *_: object) -> Candidate:
        asked.append(one.cause)
        return leaving("lost_preload", left_with_its_second)

    monkeypatch.setattr(pair_search, "_told_by_signatures", lambda *_: (replace(state, steps=(first,)), pair))
    monkeypatch.setattr(pair_search, "best_beside", beside)
    among = pair_search.Round(state, [], split, (), 31, None, present=PresentModel.of(PLAIN, split))
    assert pair_search.or_pair((state, accepted), among)[1].cause == chosen
    is_asked = of_pair != accepted.cause and left_of_pair > 4.0
    assert asked == (["slow_relaxation"] if is_asked else [])


def test_beside_a_contact_at_one_place_pairs_are_asked_and_not_beside_openings_whose_times_are_still_moved(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(pair_search, "fitted_pairs", lambda *_: asked.append("pairs") or [])
    fitted = refit(PLAIN, split.train)
    among = pair_search.Round(
        SearchState(PLAIN, (), fitted, frozenset()), [], split, (), 31, None, present=PresentModel.of(PLAIN, split)
    )
    contact = _candidate(split, "intermittent_contact", 0.3)
    pair_search._told_by_signatures(among, replace(contact, is_bound=True))
    assert asked == []
    pair_search._told_by_signatures(among, contact)
    assert asked == ["pairs"]


def test_a_pair_with_a_cause_that_no_record_shows_is_passed_over(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch
) -> None:
    fitted = refit(PLAIN, split.train)
    # faster than half the sampling, so that a lag is all that is left of it
    ringing = _with_converter(fitted, MechanicalResonance(0.8 * RATE_HZ, 0.7), 1.0)
    late = _with_converter(fitted, TransportDelay(0.004), 1.1)
    asked: list[Refit] = []
    monkeypatch.setattr(pair_search, "fitted_pairs", lambda *_: [ringing, late])
    monkeypatch.setattr(pair_search, "_in_order", lambda _, fitted, *__: asked.append(fitted))
    state = SearchState(PLAIN, (), fitted, frozenset())
    among = pair_search.Round(state, [], split, (), 31, None, present=PresentModel.of(PLAIN, split))
    assert pair_search._told_by_signatures(among, None) is None
    assert asked == [late.fitted, late.fitted], "in either order"

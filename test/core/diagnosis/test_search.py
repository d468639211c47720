"""Which of several candidates is taken: held-out data first, but not against what the training data surely say."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fomrc_core.diagnosis import acceptance, decision, pair_search, search, worth_a_refit
from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import MUCH_LEFT, DataSplit, split_data
from fomrc_core.diagnosis.held_out_score import HeldOutScore
from fomrc_core.diagnosis.search_state import SearchState
from fomrc_core.diagnosis.work_budget import WorkBudget
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.intermittent_contact import IntermittentContact
from fomrc_core.effects.thermal_drift import ThermalDrift
from fomrc_core.fitting.joint_fit import Refit, refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes
from test.core.diagnosis.contenders import contender, split_of_triangles


@pytest.fixture(scope="module")
def split() -> DataSplit:
    return split_of_triangles()


def _named(split: DataSplit, first: Candidate, *others: Candidate) -> str:
    return decision.likelier(first, [first, *others], split, 18).cause


def test_after_a_poor_drive_what_reaches_the_noise_in_training_is_taken(split: DataSplit) -> None:
    delay = contender(split, "transport_delay", 4.27, 4.99)
    assert _named(split, delay, contender(split, "amplifier_bandwidth", 5.58, 4.08)) == "amplifier_bandwidth"
    # a gain in training smaller than the loss held out is none
    assert _named(split, delay, contender(split, "amplifier_bandwidth", 4.8, 4.08)) == "transport_delay"


def test_blocks_of_its_own_record_are_an_easier_test_than_another_record(split: DataSplit) -> None:
    drift = contender(split, "thermal_drift", 0.36, 0.82)
    relaxation = contender(split, "slow_relaxation", 0.65, 0.11)
    assert _named(split, replace(drift, is_bound=True), relaxation) == "slow_relaxation"
    assert _named(split, drift, relaxation) == "thermal_drift"


def test_what_leaves_surely_less_than_events_of_a_record_is_likelier_than_they_are(split: DataSplit) -> None:
    """A record's own blocks are an easy test, and each time of an event is a parameter."""
    opened = contender(split, "intermittent_contact", 2.1, 2.3, n_free=0)
    lead = IntermittentContact(opens_s=(0.1, 0.3), closes_s=(0.2, 0.4))
    opened = replace(
        opened, is_bound=True, fitted=replace(opened.fitted, model=opened.fitted.model.with_cause(lead, 0))
    )
    assert opened.n_parameters == 4
    ends = contender(split, "amplifier_saturation", 2.9, 0.5, n_free=2)
    assert _named(split, opened, ends) == "amplifier_saturation"
    assert _named(split, opened, replace(ends, is_plausible=False)) == "intermittent_contact"
    # as much by four parameters more than the times are is chance
    assert _named(split, opened, contender(split, "creep_law", 2.101, 0.5, n_free=8)) == "intermittent_contact"
    assert _named(split, opened, contender(split, "amplifier_saturation", 1.9, 2.2)) == "intermittent_contact"


def test_an_exchange_that_ends_worse_in_training_and_held_out_is_none(split: DataSplit) -> None:
    base = TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([2.0]), 0.0, (), ((),))
    before = refit(base, split.train)
    off = replace(base, weights=0.9 * before.model.weights)
    left_um = tuple(9.0 * values for values in before.residual)
    worse = replace(before, model=off, squared_error=81.0 * before.squared_error, residual=left_um)

    def state(model: TrialModel, fitted: Refit) -> SearchState:
        return SearchState(model, (), fitted, frozenset())

    was = state(before.model, before)
    assert search._ends_worse(state(off, worse), was, split)
    assert not search._ends_worse(was, state(off, worse), split)
    # where either record speaks for it, it is made
    assert not search._ends_worse(state(off, before), was, split)
    assert not search._ends_worse(state(before.model, worse), state(off, before), split)


def test_more_parameters_are_no_likelier_cause(split: DataSplit) -> None:
    lag = contender(split, "amplifier_bandwidth", 4.0, 4.0)
    assert _named(split, lag, contender(split, "mechanical_resonance", 5.0, 4.0, n_free=2)) == "amplifier_bandwidth"
    assert _named(split, lag, contender(split, "asymmetric_hysteresis", 6.0, 4.0)) == "amplifier_bandwidth"


def test_of_two_that_held_out_data_hardly_tell_apart_the_likelier_is_taken(split: DataSplit) -> None:
    ringing = contender(split, "mechanical_resonance", 6.80, 6.59, n_free=2)
    assert _named(split, ringing, contender(split, "transport_delay", 6.82, 6.53)) == "transport_delay"
    # as likely as the first: nothing to choose by
    assert _named(split, ringing, contender(split, "transport_delay", 6.80, 6.53)) == "mechanical_resonance"


def test_a_special_case_that_leaves_twice_as_much_in_training_does_not_do_as_well(split: DataSplit) -> None:
    # a hum that nobody follows in the held-out record hides there what a capacitance adds to a plain lag
    hum_um = 0.05 * np.sin(0.3 * np.arange(4000))
    noise_um = np.random.default_rng(5).normal(0.0, 1e-3, (2, 4000))
    plain = replace(contender(split, "amplifier_bandwidth", 2.0, 2.30), held=(hum_um + 3e-3 + noise_um[0],))
    wider = replace(contender(split, "voltage_dependent_capacitance", 5.5, 2.31), held=(hum_um + noise_um[1],))
    assert decision.held_out_score(list(plain.held), list(wider.held)).log_gain < 0.08
    assert decision.is_surely_better(wider, plain)
    assert decision.simplest(wider, [wider, plain], split, 18) is wider
    # less than half of what is left is what one more parameter takes of what something else does
    assert not decision.is_surely_better(replace(wider, fitted=contender(split, "x", 2.6, 2.3).fitted), plain)
    # and held-out data must not speak against it
    assert not decision.is_surely_better(replace(wider, held=(1.01 * plain.held[0],)), plain)


def test_rivals_are_those_that_did_nearly_as_well(split: DataSplit) -> None:
    first = contender(split, "mechanical_resonance", 4.15, 2.77, n_free=2)
    near = contender(split, "transport_delay", 4.16, 2.76)
    far = contender(split, "amplifier_bandwidth", 2.99, 2.03)
    assert [c.cause for c in decision.rivals_of(first, [first, near, far])] == ["transport_delay"]


def test_beside_a_cause_only_those_are_asked_that_its_model_has_not(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = contender(split, "transport_delay", 3.0, 3.0)
    model = first.fitted.model.with_cause(AmplifierBandwidth(112.0))
    first = replace(first, fitted=replace(first.fitted, model=model))
    asked: list[tuple[str, ...]] = []
    monkeypatch.setattr(pair_search, "screen", lambda _present, names, *_: asked.append(names))
    monkeypatch.setattr(pair_search, "candidates_for", lambda *_: [])
    names = ("amplifier_bandwidth", "dead_zone", "transport_delay")
    assert pair_search.best_beside(first, split, names, None) is None
    assert asked == [("dead_zone",)]


def test_where_training_and_held_out_data_speak_for_different_causes_a_pair_is_asked(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch
) -> None:
    # a slew limit beside a resonance: held out are triangles, which tell of neither as a dense record does
    accepted = contender(split, "rate_dependent_hysteresis", 0.09, 0.41)
    slewing = contender(split, "amplifier_slew_limit", 0.42, 0.15)
    state = SearchState(accepted.fitted.model, (), accepted.fitted, frozenset())
    both = replace(state, tried=frozenset({"amplifier_slew_limit"}))

    def asked(second: Candidate | None, *candidates: Candidate, own: Candidate | None = None) -> str:
        def pair_with(_: object, first: Candidate, *__: object) -> tuple[object, Candidate] | None:
            found = own if first is accepted else second
            return None if found is None else (both, found)

        monkeypatch.setattr(pair_search, "_with_pair", pair_with)
        among = pair_search.Round(state, [accepted, *candidates], split, (), 18, None)
        return pair_search.or_pair((state, accepted), among)[1].cause

    ringing = contender(split, "mechanical_resonance", 10.0, 4.6)
    assert asked(ringing, slewing) == "mechanical_resonance"
    assert asked(contender(split, "mechanical_resonance", 10.0, 0.3), slewing) == "rate_dependent_hysteresis"
    assert asked(contender(split, "mechanical_resonance", 0.05, 4.6), slewing) == "rate_dependent_hysteresis"
    assert asked(None, slewing) == "rate_dependent_hysteresis"
    # two explain more than one: what was chosen gets a second as well
    assert asked(ringing, slewing, own=contender(split, "dead_zone", 12.0, 4.0)) == "rate_dependent_hysteresis"
    assert asked(ringing, slewing, own=contender(split, "dead_zone", 9.0, 4.0)) == "mechanical_resonance"
    # another that training data hardly prefer is no reason to ask
    assert asked(ringing, contender(split, "amplifier_slew_limit", 0.3, 0.15)) == "rate_dependent_hysteresis"


def test_what_a_repeated_loop_cannot_tell_is_not_accepted(split: DataSplit) -> None:
    bent = contender(split, "asymmetric_hysteresis", 2.7, 2.1)
    assert acceptance.is_accepted(bent, 18)
    assert not acceptance.is_accepted(replace(bent, is_distinguishable=False), 18)


def test_a_tie_with_what_belongs_to_one_record_is_asked_on_another(split: DataSplit) -> None:
    record = split.train[0].recording
    apart = split_data((record,), record, None, 1e-3)
    chain = TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([2.0]), 0.0, (), ((), ()))
    n = record.time_s.size
    alike, far = (np.random.default_rng(4).normal(0.0, size_um, n) for size_um in (1e-3, 5e-3))
    tied = [replace(contender(split, c, 4.0, 4.0), held=(v,)) for c, v in (("dead_zone", alike), ("clock_skew", far))]
    assert [c.cause for c in decision.still_tied(chain, tied, apart)] == ["dead_zone"]
    # blocks of its own record are no other record
    assert decision.still_tied(chain, tied, split) == tied


def test_what_befell_a_record_is_asked_beside_those_that_screen_alike() -> None:
    alike = [name for name, kind in cause_classes().items() if not kind.is_record_bound][:12]
    screened = {name: 1.0 - 0.01 * k for k, name in enumerate(alike)}
    asked = worth_a_refit._likely({**screened, "mains_hum": 0.35, "external_load": 0.1})
    assert asked == [*alike[:8], "mains_hum"]
    # one of the eight it takes nobody's place
    assert worth_a_refit._likely({**screened, "mains_hum": 2.0})[0] == "mains_hum"


@pytest.mark.parametrize(
    ("p_value", "likelier_by", "is_found"),
    [(1e-5, 11.0, True), (1e-5, 9.0, False), (5e-3, 11.0, False), (5e-3, 13.0, True), (2e-2, 1e3, False)],
)
def test_the_surer_of_score_and_likelihood_pays_for_the_number_of_causes(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, p_value: float, likelier_by: float, is_found: bool
) -> None:
    hum = contender(split, "mains_hum", 2.0, 2.0)
    hum = replace(hum, score=replace(hum.score, p_value=p_value))
    monkeypatch.setattr(acceptance, "gain_beyond_wander", lambda _model, _cause, _split: likelier_by)
    assert acceptance.is_finding(hum, split, 18) is is_found


@pytest.mark.parametrize(
    ("held_gain", "is_bound", "is_apart", "is_found"),
    [(0.8, False, True, True), (0.6, False, True, False), (0.8, True, True, False), (0.8, False, False, False)],
)
def test_noise_of_one_record_foresees_nothing_of_another(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, held_gain: float, is_bound: bool, is_apart: bool, is_found: bool
) -> None:
    """A drift after a recorded temperature is as slow as noise that wanders, and leaves half of another record."""
    record = split.train[0].recording
    asked = split_data((record,), record, None, 1e-3) if is_apart else split
    drift = replace(contender(split, "thermal_drift", 3.0, held_gain), is_bound=is_bound)
    monkeypatch.setattr(acceptance, "gain_beyond_wander", lambda _model, _cause, _split: 0.0)
    assert acceptance.is_finding(drift, asked, 18) is is_found


@pytest.mark.parametrize("left", [100.0, 1.0])
def test_what_looks_less_likely_is_asked_where_the_likeliest_is_no_finding_and_much_is_left(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, left: float
) -> None:
    load = replace(contender(split, "external_load", 5.0, 5.0), is_plausible=False)
    leak = contender(split, "charge_leak", 2.0, 2.0)
    tiers = {("external_load", "charge_leak"): [load], ("charge_leak",): [leak], (): []}
    trials = tuple(SimpleNamespace(name=c.cause) for c in (load, leak))
    monkeypatch.setattr(search, "worth_a_refit", lambda _present, _split, screened: [[t] for t in screened[:1]])
    monkeypatch.setattr(search, "refitted", lambda _p, _s, by_cause, _e: tiers[names_from(by_cause[0][0].name)])
    monkeypatch.setattr(search, "is_finding", lambda c, _split, n: acceptance.is_accepted(c, n))  # made up, not fitted

    def names_from(first: str) -> tuple[str, ...]:
        names = tuple(t.name for t in trials)
        return names[names.index(first) :]

    final = replace(leak.fitted, squared_error=left * split.noise_um**2 * split.n_used)
    state = SearchState(final.model, (), final, frozenset())
    budget = WorkBudget.unlimited()
    candidates, chosen = search._asked(state, None, split, trials, ("a",) * 18, None, budget)  # type: ignore[arg-type]
    if left > MUCH_LEFT:
        assert chosen is not None
        assert chosen[1].cause == "charge_leak"
        assert [c.cause for c in candidates] == ["external_load", "charge_leak"]
    else:
        assert chosen is None
        assert candidates == [load]


def test_a_cause_that_does_better_in_anothers_place_leaves_the_others_standing(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(search, "AS_NOISE", 0.0)  # something is left, else what was found first is compared at once
    first, second, rival = (contender(split, c, 4.0, 4.0) for c in ("unequal_lag", "dead_zone", "transport_delay"))
    start = first.fitted.model
    steps = tuple(search.Step(start, c, (), ()) for c in (first, second))
    answers = iter([search.LastLook(steps, (0, rival)), search.LastLook((), None)])
    seen: list[tuple[str, ...]] = []

    def look(state: SearchState, *_: object) -> search.LastLook:
        seen.append(tuple(step.accepted.cause for step in state.steps))
        return replace(next(answers), steps=state.steps)

    monkeypatch.setattr(search, "_last_look", look)
    monkeypatch.setattr(search, "screen", lambda *_: ())
    found = iter([(first, "unequal_lag"), (second, "dead_zone")])

    def asked(state: SearchState, *_: object) -> tuple[list[Candidate], object]:
        candidate = next(found, (None, ""))[0]
        return [], None if candidate is None else (state, candidate)

    monkeypatch.setattr(search, "_asked", asked)
    # a wrong name is put right before a pair is asked for
    monkeypatch.setattr(search, "any_pair", lambda *_: seen.append(("a pair",)))
    monkeypatch.setattr(
        search,
        "with_finding",
        lambda state, accepted, *_: replace(state, steps=(*state.steps, steps[len(state.steps)])),
    )
    result = search.search(start, split, ("unequal_lag", "dead_zone", "transport_delay"), lambda *_: None)
    assert seen == [("unequal_lag", "dead_zone"), ("transport_delay", "dead_zone"), ("a pair",)]
    assert [step.accepted.cause for step in result.steps] == ["transport_delay", "dead_zone"]


def test_the_last_look_sees_held_out_records_with_what_is_their_own(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = contender(split, "transport_delay", 4.0, 4.0)
    followed = replace(found.fitted.model, record_effects=((), (ThermalDrift(um_per_s=1e-3),)))
    state = SearchState(followed, (search.Step(found.fitted.model, found, (), ()),), found.fitted, frozenset())
    seen: list[TrialModel] = []

    def look(steps: object, final: Refit, *_: object, **__: object) -> search.LastLook:
        seen.append(final.model)
        return search.LastLook((), None)

    monkeypatch.setattr(search, "looked_at_last", look)
    monkeypatch.setattr(DataSplit, "is_telling", True)
    search._last_look(state, split, (), None, WorkBudget.unlimited())
    assert seen == [followed]


def _beside_nothing(split: DataSplit, effect_um: np.ndarray, noise_um: np.ndarray) -> tuple[float, float]:
    """Return both margins of a candidate that leaves the noise, where the model before it leaves an effect as well."""
    before = noise_um + effect_um
    left = replace(contender(split, "transport_delay", 0.0, 0.0).fitted, residual=(noise_um,))
    gain = math.log(float(before @ before) / float(noise_um @ noise_um))
    score = HeldOutScore(gain, 0.0, 1e-20, 1.0, 1.0)
    found = Candidate("transport_delay", left, score, gain, (), 1, before=(before,))
    return decision.margin_of(found, [found], split), decision.whitened_margin_of(found, [found], split)


def test_a_cause_is_no_rival_of_its_own(split: DataSplit) -> None:
    """As a past that took the place of plays, among the candidates as it was before its plays were chosen anew."""
    past, before = contender(split, "initial_state", 3.0, 2.5, 3), contender(split, "initial_state", 2.9, 3.6, 3)
    other = contender(split, "lost_preload", 0.5, 0.4, 2)
    assert decision.margin_of(past, [before, other], split) == decision.margin_of(past, [other], split) > 100.0
    assert decision.ties_of(past, [before], split) == []
    assert decision.rivals_of(past, [contender(split, "initial_state", 3.0, 2.5, 3)]) == ()


def test_where_only_training_compares_two_each_parameter_costs(split: DataSplit) -> None:
    past = replace(contender(split, "initial_state", 4.0, 4.0), is_bound=True, held=(np.ones(100),))
    few = contender(split, "slow_relaxation", 4.01, 4.0, n_free=1)
    many = contender(split, "asymmetric_hysteresis", 4.01, 4.0, n_free=40)
    margins = [decision.margin_of(past, [past, other], split) for other in (few, many)]
    per_parameter = 0.5 * math.log(split.n_used)
    assert margins[0] < 0.0 < margins[1]
    assert margins[1] - margins[0] == pytest.approx(39 * per_parameter, rel=0.05)
    # scored on the same data they are compared there
    same = [replace(other, held=(np.ones(100),)) for other in (few, many)]
    assert decision.margin_of(past, [past, same[0]], split) == decision.margin_of(past, [past, same[1]], split)


def test_noise_that_wanders_hides_nothing_of_what_is_quick(split: DataSplit) -> None:
    n = split.train[0].time_s.size
    rng = np.random.default_rng(4)
    wander = np.cumsum(rng.normal(0.0, 1e-3, n))
    plain, whitened = _beside_nothing(split, 5e-3 * np.sign(np.sin(np.arange(n) / 3.0)), wander - np.mean(wander))
    assert whitened > 10.0 * max(plain, 1.0)
    # and what moves as slowly as it does is no surer for it, though as large as the noise
    drift = 3.0 * float(np.std(wander)) * np.linspace(-1.0, 1.0, n) ** 2
    plain, alike = _beside_nothing(split, drift - np.mean(drift), wander - np.mean(wander))
    assert alike < 0.05 * whitened
    white = rng.normal(0.0, 1e-3, n)
    plain, whitened = _beside_nothing(split, 1e-3 * np.sin(np.arange(n) / 300.0), white)
    assert whitened == pytest.approx(plain, rel=0.1)

"""What was found is compared once more with its near rivals, beside all that was found since."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.diagnosis import better_rival
from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.search_state import SearchState
from fomrc_core.diagnosis.step import Step
from fomrc_core.diagnosis.work_budget import WorkBudget
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.fitting.joint_fit import Refit
from fomrc_core.fitting.trial_model import TrialModel
from test.core.diagnosis.contenders import contender, split_of_triangles


@pytest.fixture(scope="module")
def split() -> DataSplit:
    return split_of_triangles()


def test_a_finding_is_asked_again_once_its_rival_has_been_found_too(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch
) -> None:
    # a resonance beyond its damping stood in for a delay until the amplifier beside it was known
    first = contender(split, "mechanical_resonance", 3.91, 3.20, n_free=2)
    rival = contender(split, "amplifier_bandwidth", 3.66, 3.19)
    none_yet = first.fitted.model.with_cause(MechanicalResonance(433.0, 0.68))
    steps = [Step(first.fitted.model, first, (), (), (rival,)), Step(none_yet, rival, (), ())]
    both = none_yet.with_cause(AmplifierBandwidth(112.0))
    plain = first.fitted.model
    poor, good = (replace(rival.fitted, squared_error=rival.fitted.squared_error * share) for share in (1.0, 0.5))

    def better(beside: Candidate, settled: Refit) -> tuple[int, Candidate] | None:
        monkeypatch.setattr(better_rival, "best_beside", lambda *_: beside)
        monkeypatch.setattr(better_rival, "fit_until_still", lambda *_: settled)
        gains = iter((np.full(200, 2e-3), np.random.default_rng(3).normal(0.0, 1e-3, 200)))
        monkeypatch.setattr(better_rival, "held_residuals", lambda *_: [next(gains)])
        state = SearchState(both, tuple(steps), poor, frozenset())
        return better_rival._better_rival(state, split, (), None, WorkBudget.unlimited())

    delay = contender(split, "transport_delay", 6.0, 6.0)
    assert better(delay, replace(good, model=plain)) == (0, rival)
    assert better(delay, replace(poor, model=plain)) is None
    # the same two in another order: nothing gained
    assert better(first, replace(good, model=plain)) is None


def test_what_takes_a_finding_s_place_stands_beside_all_that_was_found_since(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch
) -> None:
    # the load that was found behind a sensor's pole is right behind the amplifier's as well: it is not sought again
    first = contender(split, "mechanical_resonance", 3.91, 3.20)
    plain = first.fitted.model
    delay = plain.with_cause(TransportDelay(2e-3))
    rival = contender(split, "transport_delay", 3.66, 3.19)
    rival = replace(rival, fitted=replace(rival.fitted, model=delay))
    since = Step(plain.with_cause(MechanicalResonance(433.0, 0.68)), contender(split, "x", 1.0, 1.0), (), ())
    ringing = plain.with_cause(MechanicalResonance(433.0, 0.68)).with_cause(AmplifierBandwidth(112.0))
    settled = replace(rival.fitted, model=delay.with_cause(AmplifierBandwidth(112.0)))
    begun: list[TrialModel] = []

    def still(start: TrialModel, *_: object) -> Refit:
        begun.append(start)
        return replace(settled, squared_error=0.5 * settled.squared_error)

    monkeypatch.setattr(better_rival, "fit_until_still", still)
    gains = iter((np.full(200, 2e-3), np.random.default_rng(3).normal(0.0, 1e-3, 200)))
    monkeypatch.setattr(better_rival, "held_residuals", lambda *_: [next(gains)])
    state = SearchState(ringing, (Step(plain, first, (), (), (rival,)), since), settled, frozenset())
    better = better_rival._better_rival(state, split, (), None, WorkBudget.unlimited())
    assert better is not None
    assert {effect.name for effect in begun[0].effects} == {"transport_delay", "amplifier_bandwidth"}
    assert better[1].fitted.model is settled.model

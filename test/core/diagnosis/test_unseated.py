"""What stood in for a part of a hidden cause gives way to it, where beside it it is what no record can show.

The truth is a straight line seen late by a bent sensor, made here with numpy alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.diagnosis.candidate import Candidate, candidate_of, implausible_in
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.search_state import SearchState
from fomrc_core.diagnosis.step import Step
from fomrc_core.diagnosis.unseated import with_unseating
from fomrc_core.effects.drive_resonance import DriveResonance
from fomrc_core.effects.sensor_nonlinearity import SensorNonlinearity
from fomrc_core.fitting.joint_fit import fit_until_still, refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.recording import Recording

_RATE_HZ = 1000.0
_DELAY_S = 0.45e-3  # less than half a sample
_BEND_PER_UM = 0.02
_NOISE_UM = 2e-3
_PLAIN = TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([2.0]), 0.0, (), ((),))
_SEEN_HZ = 300.0  # as a search may have told it while the sensor was hidden


def _measured(seed: int) -> Recording:
    rng = np.random.default_rng(seed)
    time_s = np.arange(3000) / _RATE_HZ
    lines_hz, phases = rng.uniform(1.0, 40.0, 6), rng.uniform(0.0, 2.0 * np.pi, 6)

    def voltage(at_s: np.ndarray) -> np.ndarray:
        return np.sum(np.sin(2.0 * np.pi * lines_hz[:, None] * at_s + phases[:, None]), axis=0)

    moved_um = 2.0 * voltage(time_s - _DELAY_S)
    read_um = moved_um + _BEND_PER_UM * moved_um**2
    return Recording(time_s, voltage(time_s), read_um + rng.normal(0.0, _NOISE_UM, time_s.size))


@pytest.fixture(scope="module")
def split() -> DataSplit:
    return split_data((_measured(1),), _measured(2), None, _NOISE_UM)


@pytest.fixture(scope="module")
def state(split: DataSplit) -> SearchState:
    """A search that has named a ringing amplifier, at a frequency that samples show."""
    told = _PLAIN.with_cause(DriveResonance(_SEEN_HZ, 0.5))
    fitted = replace(refit(told, split.train, n_iterations=1), model=told)
    accepted = candidate_of(PresentModel.of(_PLAIN, split), split, "drive_resonance", fitted, bound=False)
    assert accepted.is_plausible
    return SearchState(told, (Step(_PLAIN, accepted, (), ()),), fitted, frozenset({"drive_resonance"}))


@pytest.fixture(scope="module")
def bend(split: DataSplit, state: SearchState) -> Candidate:
    """The sensor beside it, both fitted until still."""
    fitted = fit_until_still(state.model.with_cause(SensorNonlinearity(0.001, 0.0)), split.train)
    return candidate_of(PresentModel.of(state.model, split), split, "sensor_nonlinearity", fitted, bound=False)


def test_beside_the_hidden_cause_the_one_before_is_nothing_that_samples_show(
    split: DataSplit, state: SearchState, bend: Candidate
) -> None:
    print(bend.fitted.model.effects)
    assert implausible_in(state.model, split) == frozenset()
    assert implausible_in(bend.fitted.model, split) == bend.unseats == {"drive_resonance"}
    assert not bend.is_plausible, "the two together are no finding"


def test_the_younger_takes_the_place_and_what_the_older_did_may_be_asked_anew(
    split: DataSplit, state: SearchState, bend: Candidate
) -> None:
    changed = with_unseating(state, [bend], None, split, 30, None)
    assert changed is not None
    assert [step.accepted.cause for step in changed.steps] == ["sensor_nonlinearity"]
    assert "drive_resonance" not in changed.tried
    assert np.isnan(changed.steps[0].margin), "it is compared in the end"
    found = next(effect for effect in changed.model.effects if effect.name == "sensor_nonlinearity")
    assert found.to_mapping()["quadratic_per_um"] == pytest.approx(_BEND_PER_UM, rel=0.1)


def test_as_good_with_fewer_parameters_unseats_as_well(split: DataSplit, state: SearchState, bend: Candidate) -> None:
    richer = replace(bend, cause="second_mode", is_plausible=True, unseats=frozenset(), n_free=bend.n_free + 2)
    assert with_unseating(state, [richer, bend], richer, split, 30, None) is not None


def test_only_what_is_surely_better_than_all_that_refutes_nothing_unseats(
    split: DataSplit, state: SearchState, bend: Candidate
) -> None:
    as_good = replace(bend, cause="lost_preload", is_plausible=True, unseats=frozenset(), n_free=bend.n_free - 1)
    assert with_unseating(state, [bend, as_good], as_good, split, 30, None) is None
    worse = replace(
        as_good,
        fitted=replace(as_good.fitted, squared_error=9.0 * bend.fitted.squared_error),
        score=replace(bend.score, log_gain=bend.score.log_gain - 2.0),
    )
    assert with_unseating(state, [worse, bend], worse, split, 30, None) is not None
    assert with_unseating(state, [replace(bend, unseats=frozenset())], None, split, 30, None) is None
    by_chance = replace(bend, score=replace(bend.score, p_value=0.5, log_gain=0.001))
    assert with_unseating(state, [by_chance], None, split, 30, None) is None

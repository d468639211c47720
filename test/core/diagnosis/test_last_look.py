"""The last look: who else does as well in the place of one that was found, beside all that was found since."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.diagnosis import last_look
from fomrc_core.diagnosis.candidate import Candidate
from fomrc_core.diagnosis.candidate_fits import Begun, gone_on
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.decision import margin_of
from fomrc_core.diagnosis.held_out_score import HeldOutScore
from fomrc_core.diagnosis.last_look import LastLook, looked_at_last
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.step import Step
from fomrc_core.effects.dead_zone import DeadZone
from fomrc_core.effects.voltage_dependent_capacitance import VoltageDependentCapacitance
from fomrc_core.fitting.joint_fit import Refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording

_NOISE_UM = 1e-3


@pytest.fixture(scope="module")
def split() -> DataSplit:
    drive = triangle(1.0, slope_v_per_s=2.0, n_cycles=3, rate_hz=500.0)
    rng = np.random.default_rng(1)
    train, test = (
        Recording(
            drive.time_s, drive.voltage_v, 2.0 * drive.voltage_v + rng.normal(0.0, _NOISE_UM, drive.voltage_v.size)
        )
        for _ in range(2)
    )
    return split_data((train,), test, None, _NOISE_UM)


def _candidate(split: DataSplit, cause: str, left: float, n_free: int) -> Candidate:
    """Return a candidate that leaves white noise of so many times the noise's size, in training and held out."""
    n = split.train[0].time_s.size
    residual_um = np.random.default_rng(2).normal(0.0, left * _NOISE_UM, n)
    held_um = np.random.default_rng(3).normal(0.0, left * _NOISE_UM, n)
    model = TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([2.0]), 0.0, (), ((),))
    model = model.with_cause(VoltageDependentCapacitance(0.01, 1e-9)).with_cause(DeadZone(0.1))
    squared_error = float(np.sum(residual_um[split.train[0].is_used] ** 2))
    fitted = Refit(model, squared_error, (), (np.zeros((n, 0)),), (residual_um,), True)
    gain = 2.0 * math.log(20.0 / left)
    score = HeldOutScore(gain, 0.0, 1e-20, 20.0 * _NOISE_UM, left * _NOISE_UM)
    before = (20.0 / left * residual_um,), (20.0 / left * held_um,)
    return Candidate(cause, fitted, score, gain, (held_um,), n_free, before=before[0], held_before=before[1])


def _with_plays(candidate: Candidate) -> Candidate:
    """Return a candidate whose plays are its own."""
    owned = ColumnKinds.plays(np.array([0.0]))
    owned = replace(owned, owners=("asymmetric_hysteresis",))
    model = replace(candidate.fitted.model, columns=owned)
    return replace(candidate, cause="asymmetric_hysteresis", fitted=replace(candidate.fitted, model=model))


def _four_times_the_noise(candidate: Candidate) -> Candidate:
    residual_um, held_um = (tuple(4.0 * v for v in left) for left in (candidate.fitted.residual, candidate.held))
    fitted = replace(candidate.fitted, residual=residual_um, squared_error=16.0 * candidate.fitted.squared_error)
    return replace(candidate, fitted=fitted, held=held_um)


def _spoken_for(split: DataSplit) -> tuple[Candidate, Candidate]:
    """Return what stands, for which training speaks, and one for which held-out data do."""
    in_training, held_out = (_candidate(split, "transport_delay", left, 1) for left in (8.0, 2.0))
    other = replace(in_training, held=held_out.held, score=held_out.score)
    return _candidate(split, "voltage_dependent_capacitance", 5.0, 1), other


def _look(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, own: Candidate, *others: Candidate, margin: float = 0.4
) -> LastLook:
    monkeypatch.setattr(last_look, "_in_place_of", lambda *_: (own, list(others), ()))
    monkeypatch.setattr(last_look, "held_residuals", lambda *_: list(own.held))
    hidden = Step(own.fitted.model, own, (), (), margin=margin)
    since = Step(own.fitted.model, _candidate(split, "dead_zone", 1.0, 1), (), (), margin=50.0)
    return looked_at_last((hidden, since), own.fitted, split, ("amplifier_bandwidth", "transport_delay"), None)


# also of one that was sure while others were hidden
@pytest.mark.parametrize("margin", [0.4, 80.0])
def test_what_does_as_well_with_fewer_parameters_takes_the_place(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, margin: float
) -> None:
    own = _candidate(split, "voltage_dependent_capacitance", 1.0, 2)
    simpler = _candidate(split, "amplifier_bandwidth", 1.0, 1)
    assert _look(split, monkeypatch, own, simpler, margin=margin).better == (0, simpler)


@pytest.mark.parametrize(("left_with_second", "takes_it"), [(1.0, True), (9.0, False)])
def test_what_held_out_data_speak_for_takes_the_place_if_a_second_beside_it_leaves_less(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, left_with_second: float, takes_it: bool
) -> None:
    own, other = _spoken_for(split)
    second = _candidate(split, "zero_order_hold", left_with_second, 1)
    monkeypatch.setattr(last_look, "best_beside", lambda first, *_: second if first is other else None)
    assert _look(split, monkeypatch, own, other).better == ((0, other) if takes_it else None)


@pytest.mark.parametrize(("gain_followed", "takes_it"), [(0.5, True), (-0.5, False)])
def test_a_second_that_befell_a_record_is_scored_where_it_is_followed(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, gain_followed: float, takes_it: bool
) -> None:
    own, other = _spoken_for(split)
    second = _candidate(split, "thermal_drift", 1.0, 1)
    # as it was scored: on blocks of the record it belongs to, of which there are fewer samples
    second = replace(second, is_bound=True, held=(second.held[0][::3],))
    monkeypatch.setattr(last_look, "best_beside", lambda *_: second)
    followed = replace(second.score, log_gain=gain_followed)
    monkeypatch.setattr(last_look, "score_of_pair", lambda *_: followed)
    assert _look(split, monkeypatch, own, other).better == ((0, other) if takes_it else None)


def test_no_second_is_sought_where_noise_is_left(split: DataSplit, monkeypatch: pytest.MonkeyPatch) -> None:
    own = _candidate(split, "voltage_dependent_capacitance", 1.0, 1)
    monkeypatch.setattr(last_look, "best_beside", lambda *_: pytest.fail("sought all the same"))
    other = replace(_candidate(split, "transport_delay", 1.5, 1), held=(0.5 * own.held[0],))
    assert _look(split, monkeypatch, own, other).better is None


def test_what_does_as_well_with_as_many_is_a_tie(split: DataSplit, monkeypatch: pytest.MonkeyPatch) -> None:
    own = _candidate(split, "voltage_dependent_capacitance", 1.0, 1)
    look = _look(split, monkeypatch, own, _candidate(split, "transport_delay", 1.0, 1))
    assert look.better is None
    assert look.steps[0].tied == ("transport_delay",)


def test_what_leaves_noise_and_is_surely_likelier_takes_the_place(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch
) -> None:
    # 2 % of the power: less than one held-out stretch differs from another, and far more than white noise does
    own = _candidate(split, "voltage_dependent_capacitance", 1.01, 1)
    other = _candidate(split, "clock_skew", 1.0, 2)
    assert _look(split, monkeypatch, own, other).better == (0, other)
    assert _look(split, monkeypatch, own, _with_plays(other)).better is None, "plays bend to whatever is wrong"
    assert _look(split, monkeypatch, *(_four_times_the_noise(c) for c in (own, other))).better is None
    # twice and more of the power left of data that neither was fitted to is no noise
    carried = replace(own, held=tuple(0.6 * values for values in own.held))
    assert _look(split, monkeypatch, carried, other).better is None


def test_of_two_as_simple_that_nothing_tells_apart_the_likelier_is_taken(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, behind = (_candidate(split, "voltage_dependent_capacitance", left, 1) for left in (1.0, 1.001))
    other, ahead = (_candidate(split, "transport_delay", left, 1) for left in (1.0, 0.999))
    assert _look(split, monkeypatch, behind, other).better == (0, other)
    assert _look(split, monkeypatch, own, ahead).better == (0, ahead)
    assert _look(split, monkeypatch, own, replace(behind, cause="transport_delay")).better is None
    # the weights of plays are not among the parameters counted
    assert _look(split, monkeypatch, own, _with_plays(ahead)).better is None


def test_the_margin_is_that_beside_all_others(split: DataSplit, monkeypatch: pytest.MonkeyPatch) -> None:
    own = _candidate(split, "voltage_dependent_capacitance", 1.0, 1)
    far = _candidate(split, "transport_delay", 3.0, 1)
    steps = _look(split, monkeypatch, own, far).steps
    n_samples = np.count_nonzero(split.train[0].is_used) + far.held[0].size
    assert steps[0].margin == pytest.approx(n_samples * math.log(3.0), rel=0.5), "it was 0.4 when it was accepted"
    assert steps[1].margin == 50.0, "the last was accepted beside all the others"


@pytest.mark.parametrize(
    ("margin", "whitened", "is_asked"), [(7.0, -800.0, True), (80.0, -800.0, True), (80.0, 90.0, False)]
)
def test_a_load_that_was_not_sure_while_others_were_hidden_is_compared_again_and_nothing_takes_its_place(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, margin: float, whitened: float, is_asked: bool
) -> None:
    own = replace(_candidate(split, "voltage_dependent_capacitance", 1.0, 1), is_bound=True)
    far, same = _candidate(split, "transport_delay", 3.0, 1), _candidate(split, "amplifier_bandwidth", 1.0, 1)
    monkeypatch.setattr(last_look, "_in_place_of", lambda *_: (own, [far], (same,)))
    first = Step(own.fitted.model, own, (), (), margin=margin, whitened_margin=whitened)
    last = Step(own.fitted.model, _candidate(split, "dead_zone", 1.0, 1), (), (), margin=50.0)
    look = looked_at_last((first, last), own.fitted, split, (), None)
    assert look.better is None
    told = look.steps[0].margin, look.steps[0].whitened_margin
    assert told == ((margin, whitened) if not is_asked else pytest.approx((0.0, 0.0), abs=1e-9))


def _bound(candidate: Candidate, cause: str = "external_load") -> Candidate:
    return replace(candidate, cause=cause, is_bound=True)


@pytest.mark.parametrize(("held_gain", "left", "takes_it"), [(0.5, 1.0, True), (-0.1, 1.0, False), (0.5, 3.0, False)])
def test_what_befell_a_record_takes_the_place_of_what_stood_in_for_it(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, held_gain: float, left: float, takes_it: bool
) -> None:
    own, load = _candidate(split, "voltage_dependent_capacitance", 3.0, 2), _bound(_candidate(split, "", left, 3))
    # followed in the held-out record it gains there too, or not
    score = replace(load.score, log_gain=held_gain)
    monkeypatch.setattr(last_look, "score_of_pair", lambda *_: score)
    assert _look(split, monkeypatch, own, load).better == ((0, load) if takes_it else None)


@pytest.mark.parametrize(
    ("left", "gain_followed", "takes_it"), [(1.0, 0.5, True), (1.0, -0.1, False), (2.999, 0.5, False)]
)
def test_of_what_befell_records_that_which_surely_does_better_takes_the_place(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, left: float, gain_followed: float, takes_it: bool
) -> None:
    own = _bound(_candidate(split, "", 3.0, 3), "voltage_dependent_capacitance")
    drift = _bound(_candidate(split, "", left, 2), "thermal_drift")
    monkeypatch.setattr(last_look, "score_of_pair", lambda *_: replace(drift.score, log_gain=gain_followed))
    # what belongs to the actuator was scored on other data, and takes no such place for what held-out data say
    look = _look(split, monkeypatch, own, _candidate(split, "amplifier_bandwidth", 2.999, 1), drift)
    assert look.better == ((0, drift) if takes_it else None)


@pytest.mark.parametrize(("left", "n_free", "takes_it"), [(1.0, 1, True), (2.999, 3, False), (2.0, 9999, False)])
def test_what_the_actuator_does_explains_events_that_training_surely_knows_it_by(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, left: float, n_free: int, takes_it: bool
) -> None:
    own = _bound(_candidate(split, "", 3.0, 3), "voltage_dependent_capacitance")
    other = _candidate(split, "amplifier_saturation", left, n_free)
    assert _look(split, monkeypatch, own, other).better == ((0, other) if takes_it else None)
    # plays bend to anything
    assert _look(split, monkeypatch, own, _with_plays(other)).better is None


@pytest.mark.parametrize(("gain", "is_shown", "place"), [(0.08, False, 0), (0.08, True, None), (2.0, False, None)])
def test_what_no_record_shows_any_more_and_mends_little_is_told(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, gain: float, is_shown: bool, place: int | None
) -> None:
    own = _bound(_candidate(split, "", 1.0, 3), "voltage_dependent_capacitance")
    own = replace(own, train_log_gain=gain, is_plausible=is_shown)
    assert _look(split, monkeypatch, own).unshown == place


@pytest.mark.parametrize(("left", "left_held", "takes_it"), [(1.05, 0.3, True), (1.05, 0.9, False), (1.3, 0.3, False)])
def test_what_held_out_data_surely_tell_takes_the_place_where_training_says_little(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, left: float, left_held: float, takes_it: bool
) -> None:
    own = _candidate(split, "voltage_dependent_capacitance", 1.0, 1)
    other = _candidate(split, "zero_order_hold", left, 1)
    other = replace(other, held=(left_held * own.held[0],))
    assert _look(split, monkeypatch, own, other).better == ((0, other) if takes_it else None)


@pytest.mark.parametrize(("left", "takes_it"), [(1.0, True), (1.3, False)])
def test_a_past_begun_anew_beside_what_was_found_since_takes_its_own_place(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, left: float, takes_it: bool
) -> None:
    own = _bound(_candidate(split, "", 1.3, 3), "voltage_dependent_capacitance")
    anew = replace(own, fitted=_candidate(split, "", left, 3).fitted)
    look = _look(split, monkeypatch, own, anew)
    assert look.better == ((0, anew) if takes_it else None)
    # it is no rival of itself
    assert look.steps[0].tied == ()


def test_what_may_not_be_compared_any_more_has_no_margin(split: DataSplit, monkeypatch: pytest.MonkeyPatch) -> None:
    own = _candidate(split, "voltage_dependent_capacitance", 1.0, 1)
    monkeypatch.setattr(last_look, "_in_place_of", lambda *_: pytest.fail("asked all the same"))
    hidden = Step(own.fitted.model, own, (), (), margin=0.4)
    last = Step(own.fitted.model, _candidate(split, "dead_zone", 1.0, 1), (), (), margin=50.0)
    look = looked_at_last((hidden, last), own.fitted, split, (), None, may_ask=lambda: False)
    assert math.isnan(look.steps[0].margin)
    assert look.steps[1].margin == 50.0
    assert look.better is None


def test_beside_nobody_a_margin_is_what_the_cause_gains(split: DataSplit) -> None:
    own = _candidate(split, "cyclic_sensor_error", 18.0, 1)
    n_samples = np.count_nonzero(split.train[0].is_used) + own.held[0].size
    assert margin_of(own, [own], split) == pytest.approx(n_samples * math.log(20.0 / 18.0), rel=0.5)
    assert margin_of(own, [_candidate(split, "dead_zone", 18.0, 1)], split) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("last_log_gain", "is_followed"), [(2.0, True), (0.01, False)])
def test_a_fit_that_still_falls_fast_is_followed_where_it_stands_far_behind(
    split: DataSplit, monkeypatch: pytest.MonkeyPatch, last_log_gain: float, is_followed: bool
) -> None:
    far = replace(_candidate(split, "transport_delay", 6.0, 1).fitted, last_log_gain=last_log_gain, is_converged=False)
    present = PresentModel.of(TrialModel(ColumnKinds.plays(np.array([0.0])), np.array([1.9]), 0.0, (), ((),)), split)
    followed: list[Refit] = []

    def further(*_: object) -> list[Refit]:
        followed.append(far)
        return [replace(far, is_converged=True)]

    monkeypatch.setattr("fomrc_core.diagnosis.candidate_fits._further", further)
    monkeypatch.setattr("fomrc_core.diagnosis.candidate_fits._followed", lambda fit, *_: fit)
    at_rest_um2 = _candidate(split, "amplifier_bandwidth", 1.0, 1).fitted.squared_error
    found = gone_on(present, split, Begun("transport_delay", False, ((far, None),)), at_rest_um2)
    assert found is not None, "where it has come to is told in any case"
    assert bool(followed) == is_followed

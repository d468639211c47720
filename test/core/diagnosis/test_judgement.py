"""What is left is noise, or it is not: with noise known apart from the model, and without."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.diagnosis.belief import asked_of
from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.diagnosis.judgement import Status, judge
from fomrc_core.diagnosis.remainder import Dependence
from fomrc_core.records.recording import Recording

_NOTHING = (Dependence("rate", 0.0, 0.4), Dependence("displacement", 0.01, 0.2))
_RATE = (Dependence("rate", 0.3, 1e-6), Dependence("displacement", 0.01, 0.2))


def test_what_is_as_small_as_the_noise_and_follows_nothing_is_noise():
    found = judge(1.0, True, 5.0, 1.05, 1.1, _NOTHING)
    assert found.is_noise
    assert found.reasons == ()
    assert found.status([0.9], False) is Status.EXPLAINED
    assert found.status([0.96, 0.95], False) is Status.EXPLAINED
    assert found.status([0.86, 0.86], False) is Status.SUSPECT, "each is sure, and both are not"
    assert found.status([0.9, 0.59], False) is Status.SUSPECT, "a name as likely wrong as right explains nothing"
    assert found.status([0.84], False) is Status.SUSPECT
    assert found.status([0.89], False) is Status.EXPLAINED
    asked = asked_of(["thermal_drift"])
    assert found.status([0.89], False, asked=asked) is Status.SUSPECT, "near kin of what is not known leaves as little"
    assert found.status([0.9], True) is Status.AMBIGUOUS
    assert found.status([], False) is Status.NOTHING_FOUND
    # a form that stands in for what has no name explains nothing
    assert found.status([0.9], False, True) is Status.SUSPECT
    assert found.status([], False, True) is Status.UNEXPLAINED


def test_a_suspect_answer_says_why_it_explains_nothing():
    found = judge(1.0, True, 5.0, 1.05, 1.1, _NOTHING)
    assert found.doubts([0.96, 0.95]) == ()
    (doubt,) = found.doubts([0.86, 0.86])
    assert "all right with a probability of 73 %" in doubt
    (doubt,) = found.doubts([0.86, 0.8999], asked=asked_of(["transport_delay", "thermal_drift"]))
    assert "one of the names is right with a probability of 89 %, and an explanation asks for 90 %" in doubt
    (doubt,) = found.doubts([0.7499])
    assert "the name is right with a probability of 74 %, and an explanation asks for 75 %" in doubt
    (doubt,) = found.doubts([0.95], has_stand_ins=True)
    assert "no name" in doubt
    assert found.doubts([]) == ()
    (doubt,) = judge(1.0, True, 1.3, 1.19, 1.19, _NOTHING).doubts([0.95])
    assert doubt.startswith("60 % of the power the base missed the data by is left")
    of_rest = judge(1.0, True, 5.0, 1.3, 1.3, _NOTHING)
    assert of_rest.doubts([]) == (f"what is left is not noise: {of_rest.reasons[0]}",)


def test_a_cause_that_bends_to_much_else_leaves_what_is_known_or_carries_all_it_learned():
    def flexible(sees_slow_noise: bool, after_um: float, learned_um: float) -> bool:
        of = judge(1.0, sees_slow_noise, 9.0, after_um, after_um, _NOTHING, learned_um=learned_um, is_flexible=True)
        return of.is_noise

    assert flexible(True, 1.05, 1.0)
    assert not flexible(True, 1.15, 1.1), "more than the noise that is known"
    # a floor that sees no slow noise is no measure of it: there it is asked to carry
    assert flexible(False, 3.0, 2.8)
    assert not flexible(False, 3.0, 2.3)


@pytest.mark.parametrize(
    ("after_um", "worst_um", "tests", "said"),
    [
        (1.3, 1.3, _NOTHING, "1.30 times the noise"),
        (1.1, 1.6, _NOTHING, "1.60 times that noise in one"),
        (1.1, 1.1, _RATE, "30 % of its power follows from rate"),
    ],
)
def test_each_thing_that_speaks_against_noise_is_said(after_um, worst_um, tests, said):
    found = judge(1.0, True, 5.0, after_um, worst_um, tests)
    assert not found.is_noise
    assert any(said in reason for reason in found.reasons)
    assert found.status([0.9], False) is Status.SUSPECT
    assert found.status([], False) is Status.UNEXPLAINED


def test_what_is_left_of_one_record_and_not_of_another_is_no_noise():
    assert judge(0.3, False, 5.0, 1.0, 1.5, _NOTHING, learned_um=0.9).is_noise
    # a record that only chose among causes
    found = judge(0.3, False, 5.0, 1.0, 2.7, _NOTHING, learned_um=0.9)
    assert not found.is_noise
    assert "3.00 times what is left of the data it was learned from" in found.reasons[0]


def test_slow_noise_that_no_repeat_shows_is_noise_all_the_same():
    # fourth differences see a third of it; nothing of the rest follows the drive
    found = judge(0.3, False, 1.02, 1.0, 1.0, _NOTHING)
    assert found.status([], False) is Status.NOTHING_FOUND
    assert found.noise_um == pytest.approx(1.0)
    # and where a third of its power follows the rate, two thirds are noise
    found = judge(0.3, False, 5.0, 1.0, 1.0, _RATE)
    assert found.noise_um == pytest.approx(0.7**0.5)
    assert found.status([0.9], False) is Status.SUSPECT


def test_little_explained_is_never_explained():
    found = judge(1.0, True, 1.3, 1.19, 1.19, _NOTHING)
    assert found.is_noise
    assert found.unexplained_share == pytest.approx((1.19**2 - 1.0) / (1.3**2 - 1.0))
    assert found.status([0.9], False) is Status.SUSPECT


def test_what_weights_learned_from_noise_err_is_no_cause():
    assert not judge(1.0, True, 9.0, 1.3, 1.3, _NOTHING).is_noise
    assert judge(1.0, True, 9.0, 1.3, 1.3, _NOTHING, learning_excess=0.6).is_noise
    # however little the records determine: twice the noise is not noise
    assert not judge(1.0, True, 9.0, 2.0, 2.0, _NOTHING, learning_excess=50.0).is_noise


def test_what_weights_err_excuses_what_follows_the_drive_only_where_no_more_is_left():
    def left(after_um: float) -> bool:
        tests = (Dependence("rate", 0.25, 1e-6), *_NOTHING)
        return judge(0.5, False, 9.0, after_um, after_um, tests, learning_excess=0.25, learned_um=1.0).is_noise

    assert left(1.5)
    assert not left(1.6), "more than such weights leave where they were not learned"


def test_a_record_without_any_noise_is_answered() -> None:
    # a straight line of a simulation: what is left is rounding, and the noise between its samples nothing at all
    time_s = np.arange(300) * 0.01
    voltage_v = np.sin(5.0 * time_s)
    found = diagnose(Recording(time_s, voltage_v, 2.0 * voltage_v))
    assert found.findings == ()
    assert found.noise_floor_um > 0.0


def test_what_nobody_has_shown_to_be_noise_is_unexplained() -> None:
    found = judge(1.0, False, 50.0, 40.0, 40.0, _NOTHING)
    assert any("40.0 times the noise from sample to sample" in reason for reason in found.reasons)
    assert found.unexplained_share == pytest.approx((40.0**2 - 1.0) / (50.0**2 - 1.0))

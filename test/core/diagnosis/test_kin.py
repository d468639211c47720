"""A lag that is alike both ways is an amplifier's, wherever the fit of that one came to rest."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fomrc_core.diagnosis.candidate import Candidate, candidate_of
from fomrc_core.diagnosis.data_split import DataSplit, split_data
from fomrc_core.diagnosis.decision import likelier, margin_of
from fomrc_core.diagnosis.kin import kin_left_out, with_kin
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.effects import Effect, effect_classes
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.creep_law import CreepLaw
from fomrc_core.effects.drive_resonance import DriveResonance
from fomrc_core.effects.intermittent_contact import IntermittentContact
from fomrc_core.effects.lost_preload import LostPreload
from fomrc_core.effects.sensor_bandwidth import SensorBandwidth
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.effects.unequal_lag import UnequalLag
from fomrc_core.effects.voltage_dependent_capacitance import VoltageDependentCapacitance
from fomrc_core.effects.zero_order_hold import ZeroOrderHold
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording

_PLAIN = TrialModel(ColumnKinds.plays(np.linspace(0.0, 1.8, 10)), np.linspace(1.0, 0.1, 10), 0.02, (), ((),))
_CUTOFF_HZ = 1.3
_ASKED = ("unequal_lag", "amplifier_bandwidth", "drive_resonance", "voltage_dependent_capacitance")


def _recorded(seed: int) -> Recording:
    drive = triangle(2.0, slope_v_per_s=8.0, n_cycles=12, rate_hz=50.0)
    blank = Recording(drive.time_s, drive.voltage_v, drive.voltage_v)
    moved_um = predict(_PLAIN.with_cause(AmplifierBandwidth(_CUTOFF_HZ)), FitRecord.of(blank), 0)
    noise_um = np.random.default_rng(seed).normal(0.0, 2e-3, drive.time_s.size)
    return Recording(drive.time_s, drive.voltage_v, moved_um + noise_um)


@pytest.fixture(name="split")
def _split() -> DataSplit:
    return split_data((_recorded(1),), _recorded(2), None, 2e-3)


def test_the_special_case_is_begun_where_the_general_one_has_come_to(split: DataSplit) -> None:
    present = PresentModel.of(_PLAIN, split)
    fitted = refit(_PLAIN.with_cause(UnequalLag(0.12, 0.12)), split.train)
    winner = candidate_of(present, split, "unequal_lag", fitted, bound=False)
    far = refit(_PLAIN.with_cause(AmplifierBandwidth(900.0)), split.train, free=())
    stuck = candidate_of(present, split, "amplifier_bandwidth", far, bound=False)
    found = {c.cause: c for c in with_kin(winner, [winner, stuck], present, split, _ASKED)}
    (lag,) = (e for e in found["amplifier_bandwidth"].fitted.model.effects if e.name == "amplifier_bandwidth")
    assert isinstance(lag, AmplifierBandwidth)
    assert lag.cutoff_hz == pytest.approx(_CUTOFF_HZ, rel=0.02)
    assert found["amplifier_bandwidth"].fitted.squared_error < 1.01 * winner.fitted.squared_error
    assert with_kin(winner, [winner], present, split, ("unequal_lag",)) == [winner], "nobody asked for it"
    # one that has come further is left as it is, and so is all where the simpler one acts already
    own = found["amplifier_bandwidth"]
    assert with_kin(winner, [winner, own], present, split, _ASKED) == [winner, own]
    beside = PresentModel.of(own.fitted.model, split)
    assert with_kin(winner, [winner], beside, split, _ASKED) == [winner]


def test_of_two_forms_that_leave_alike_in_training_held_out_data_say_which(split: DataSplit) -> None:
    present = PresentModel.of(_PLAIN, split)
    fitted = refit(_PLAIN.with_cause(UnequalLag(0.12, 0.12)), split.train)
    winner = candidate_of(present, split, "unequal_lag", fitted, bound=False)
    own = next(c for c in with_kin(winner, [winner], present, split, _ASKED) if c.cause == "amplifier_bandwidth")

    def changed(held_log_gain: float, train_log_gain: float) -> Candidate:
        error = own.fitted.squared_error * math.exp(-train_log_gain)
        return replace(
            own,
            fitted=replace(own.fitted, squared_error=error),
            score=replace(own.score, log_gain=own.score.log_gain + held_log_gain),
            train_log_gain=own.train_log_gain + train_log_gain,
        )

    wrong_form = changed(-1.0, 1e-4)
    found = with_kin(winner, [winner, wrong_form], present, split, _ASKED)
    assert wrong_form not in found
    assert own.score == next(c for c in found if c.cause == own.cause).score
    # the same of two causes: twice as much left of data that neither was fitted to is no noise
    for held, train, is_told in ((-1.0, -1e-5, True), (-0.3, -1e-5, False), (-1.0, 1e-5, False)):
        other_first = replace(changed(held, train), cause="transport_delay")
        assert likelier(other_first, [other_first, own], split, 10) is (own if is_told else other_first)


def test_what_does_no_better_than_its_kin_is_not_sure_because_that_was_not_asked_for(split: DataSplit) -> None:
    present = PresentModel.of(_PLAIN, split)
    fitted = refit(_PLAIN.with_cause(UnequalLag(0.12, 0.12)), split.train)
    winner = candidate_of(present, split, "unequal_lag", fitted, bound=False)
    assert kin_left_out(winner, present, split, _ASKED) == ()
    left_out = kin_left_out(winner, present, split, ("unequal_lag",))
    assert "amplifier_bandwidth" in {c.cause for c in left_out}
    assert margin_of(winner, [winner], split) > 100.0, "likelier than nothing at all"
    assert margin_of(winner, [winner, *left_out], split) < 3.0, "no likelier than the lag it holds"


def test_a_contact_that_lets_go_where_it_was_made_is_a_kink_to_the_eye() -> None:
    displacement_um = np.linspace(-1.0, 3.0, 400)
    steps_s = np.full(400, 0.1)
    contact = IntermittentContact(contact_um=1.2, stiffness_share=0.3)
    touched_um = contact.run(contact.initial_state(), displacement_um, steps_s)
    kink = LostPreload(**contact.special_case())
    # the same motion of a stage that is as much less elastic throughout
    bent_um = kink.run(kink.initial_state(), 0.7 * displacement_um, steps_s)
    assert np.ptp(touched_um - bent_um) < 1e-12
    assert IntermittentContact(opens_s=(1.0,), closes_s=(2.0,)).special_case() == {}, "a lead is no kink"


def test_a_cause_that_holds_no_other_has_no_special_case(split: DataSplit) -> None:
    present = PresentModel.of(_PLAIN, split)
    fitted = refit(_PLAIN.with_cause(AmplifierBandwidth(_CUTOFF_HZ)), split.train)
    winner = candidate_of(present, split, "amplifier_bandwidth", fitted, bound=False)
    assert with_kin(winner, [winner], present, split, _ASKED) == [winner]


def test_special_cases_lag_as_the_general_one_does() -> None:
    assert UnequalLag(0.1, 0.4).special_case()["cutoff_hz"] == pytest.approx(1.0 / (2.0 * math.pi * 0.2))
    lag = VoltageDependentCapacitance(time_constant_s=0.3, per_v=0.01)
    assert lag.special_case()["cutoff_hz"] == pytest.approx(1.0 / (2.0 * math.pi * 0.3))


@pytest.mark.parametrize(("damping_ratio", "is_plausible"), [(0.001, False), (0.02, True), (0.5, False)])
def test_beyond_half_the_rate_a_resonance_must_be_damped_and_last(damping_ratio: float, is_plausible: bool) -> None:
    assert DriveResonance(580.0, damping_ratio).is_plausible(10.0, 1e-3) is is_plausible


def test_a_law_of_creep_is_near_to_its_largest_relaxation() -> None:
    law = CreepLaw(first_share=0.1, first_s=0.2, second_share=0.3, second_s=4.0)
    assert law.kin() == {"slow_relaxation": {"amplitude": 0.3, "time_constant_s": 4.0}}
    assert CreepLaw(per_decade=0.1).kin() == {}


def test_a_delay_is_near_to_the_hold_and_the_sensor_that_lag_as_much() -> None:
    delay = TransportDelay(delay_s=0.02)
    kin = delay.kin()
    assert kin["zero_order_hold"]["hold_s"] == pytest.approx(0.04)
    sensor = SensorBandwidth(**kin["sensor_bandwidth"])
    # and back again
    assert sensor.kin()["transport_delay"]["delay_s"] == pytest.approx(0.02, rel=1e-9)
    assert TransportDelay(delay_s=0.0).kin() == {}


@pytest.mark.parametrize(
    "lag",
    [TransportDelay(0.02), AmplifierBandwidth(8.0), SensorBandwidth(9.0, 3.0), SensorBandwidth(20.0, 2.0, 1.0)],
    ids=["delay", "amplifier", "sensor", "sensor of two stages"],
)
def test_lags_are_near_to_those_that_are_as_late_where_all_is_slow(lag: Effect) -> None:
    def late_s(effect: Effect) -> float:
        ramp = np.arange(1, 4001) * 1e-3
        return float(ramp[-1] - effect.run(effect.initial_state(), ramp, np.full(ramp.size, 1e-3))[-1])

    near = [kind.proposed([parameters])[0] for kind, parameters in _kin_of(lag) if kind is not ZeroOrderHold]
    assert {kind.name for kind in near} | {lag.name} == {"transport_delay", "amplifier_bandwidth", "sensor_bandwidth"}
    assert [late_s(kind) for kind in near] == pytest.approx([late_s(lag)] * len(near), rel=1e-3)


def _kin_of(effect: Effect) -> list[tuple[type[Effect], dict[str, float]]]:
    return [(effect_classes()[name], parameters) for name, parameters in effect.kin().items()]


def test_plays_that_count_no_further_from_one_voltage_on_are_near_to_an_amplifier_that_ends_there() -> None:
    plays = {"thresholds_v": (0.0, 1.0, 0.0, 0.5), "knees_v": (1.0, 2.0, -1.0, -2.5)}

    def moved_um(effect: AsymmetricHysteresis, *drive_v: float) -> np.ndarray:
        return effect.run(effect.initial_state(), np.array(drive_v), np.full(len(drive_v), 0.01))

    up = AsymmetricHysteresis(**plays, weights_um_per_v=(0.02, -1.0, -0.01, 0.1))
    assert up.kin() == {"amplifier_saturation": {"high_v": 3.0}}
    # beside a way of one um per volt they count from there on, and take what it gains
    assert moved_um(up, 0.0, 2.9, 3.0, 5.0) == pytest.approx([0.0, 0.249, 0.26, -1.52])
    down = AsymmetricHysteresis(**plays, weights_um_per_v=(0.02, -0.1, 0.2, 0.9))
    assert down.kin() == {"amplifier_saturation": {"low_v": -3.0}}
    # all there is of the way ends there
    assert moved_um(down, 0.0, -2.9, -3.0, -5.0) == pytest.approx([0.0, -2.36, -2.45, -2.45])
    assert AsymmetricHysteresis(warp_per_v=0.1).kin() == {}, "a bend that is nowhere"


def test_plays_are_compared_with_the_amplifier_that_ends_where_they_break_off() -> None:
    def recorded(seed: int) -> Recording:
        rng = np.random.default_rng(seed)
        time_s = 0.02 * np.arange(2500)
        voltage_v = np.sum(
            [
                np.sin(2.0 * np.pi * f * time_s + p)
                for f, p in zip((0.07, 0.19, 0.43), rng.uniform(0, 6, 3), strict=True)
            ],
            axis=0,
        )
        return Recording(time_s, voltage_v, 2.0 * np.minimum(voltage_v, 1.7) + rng.normal(0.0, 2e-3, time_s.size))

    split = split_data((recorded(1),), recorded(2), None, 2e-3)
    plain = TrialModel(ColumnKinds.plays(np.array([0.0, 0.5])), np.array([2.0, 0.0]), 0.0, (), ((),))
    present = PresentModel.of(plain, split)
    knees = AsymmetricHysteresis(thresholds_v=(0.0,) * 3, knees_v=(0.5, 1.6, 2.2), weights_um_per_v=(0.0, 0.0, 0.0))
    begun = replace(
        plain.with_cause(AsymmetricHysteresis()),
        columns=plain.columns.joined(ColumnKinds.plays_of(knees)),
        weights=np.concatenate((plain.weights, np.zeros(3))),
    )
    winner = candidate_of(present, split, knees.name, refit(begun, split.train), bound=False)
    (amplifier,) = kin_left_out(winner, present, split, ("asymmetric_hysteresis",))
    assert amplifier.cause == "amplifier_saturation"
    assert margin_of(winner, [winner, amplifier], split) < 0.0

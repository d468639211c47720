"""The causes that came after the first eighteen, each by its own physics."""

from __future__ import annotations

import numpy as np
import pytest
from new_effects import NEW_EFFECTS
from scipy.integrate import solve_ivp
from scipy.signal import butter, lsim

from fomrc_core.effects import Stage
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.amplitude_dependent_creep import AmplitudeDependentCreep
from fomrc_core.effects.backlash import Backlash
from fomrc_core.effects.base.linear_modes import logarithmic_modes
from fomrc_core.effects.charge_leak import ChargeLeak
from fomrc_core.effects.clock_skew import ClockSkew
from fomrc_core.effects.creep_law import CreepLaw
from fomrc_core.effects.cyclic_sensor_error import CyclicSensorError
from fomrc_core.effects.drive_resonance import DriveResonance
from fomrc_core.effects.intermittent_contact import IntermittentContact
from fomrc_core.effects.lost_preload import LostPreload
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
from fomrc_core.effects.rate_dependent_hysteresis import RateDependentHysteresis
from fomrc_core.effects.second_mode import SecondMode
from fomrc_core.effects.sensor_bandwidth import SensorBandwidth
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.effects.unequal_lag import UnequalLag
from fomrc_core.effects.voltage_dependent_capacitance import VoltageDependentCapacitance
from fomrc_core.effects.zero_order_hold import ZeroOrderHold
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.substeps import Substeps

IDS = [effect.name for effect in NEW_EFFECTS]
MODEL = PiezoModel([10.0, 4.0, 7.0, 1.5], [0.02, 0.1, 0.3], 0.02, substeps=Substeps.BENDS)


def uneven(n: int = 120, jitter: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """Return uneven steps [s] and a random input, shape (n,)."""
    rng = np.random.default_rng(23)
    return 2e-3 * (1.0 + jitter * rng.uniform(-1.0, 1.0, n)), rng.standard_normal(n)


def integrated(slope_of, n_states: int, steps_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the first state of y' = slope_of(y, u) for u linear between samples, by a fine Runge-Kutta."""
    y, before, out = np.zeros(n_states), 0.0, []
    for step, now in zip(steps_s, values, strict=True):
        solved = solve_ivp(
            lambda s, y, b=before, m=(now - before) / step: slope_of(y, b + m * s),
            (0.0, step),
            y,
            method="DOP853",
            rtol=1e-11,
            atol=1e-12,
            max_step=step / 8.0,
        )
        y, before = solved.y[:, -1], now
        out.append(y[0])
    return np.array(out)


@pytest.mark.parametrize("effect", NEW_EFFECTS, ids=IDS)
@pytest.mark.parametrize("jitter", [0.0, 0.5])
def test_batch_equals_steps_bit_for_bit(effect, jitter) -> None:
    steps_s, values = uneven(jitter=jitter)
    whole_state, step_state = effect.initial_state(), effect.initial_state()
    whole = effect.run(whole_state, values, steps_s)
    single = [effect.run(step_state, values[k : k + 1], steps_s[k : k + 1])[0] for k in range(values.size)]
    assert np.array_equal(whole, np.array(single))
    assert np.array_equal(whole_state, step_state)


NULLS = [
    ZeroOrderHold(0.0),
    RateDependentHysteresis(0.0),
    LostPreload(0.1, 0.0),
    Backlash(0.0),
    IntermittentContact(0.1, 0.0, 0.2),
    SecondMode(70.0, 0.03, 0.0),
    AmplitudeDependentCreep(0.0, 0.01),
    CyclicSensorError(0.2),
]


@pytest.mark.parametrize("effect", NULLS, ids=lambda effect: effect.name)
def test_an_effect_of_no_size_changes_no_bit(effect) -> None:
    steps_s, values = uneven()
    if effect.stage is Stage.HYSTERESIS:
        assert np.all(effect.widening(effect.initial_state(), values, steps_s) == 1.0)
        assert not np.any(effect.run(effect.initial_state(), values, steps_s))
    else:
        assert np.array_equal(effect.run(effect.initial_state(), values, steps_s), values)


@pytest.mark.parametrize("effect", [e for e in NEW_EFFECTS if e.can_invert], ids=lambda effect: effect.name)
def test_inverses_undo(effect) -> None:
    steps_s = np.full(4000, 1e-4)
    wanted = np.sin(np.arange(4000) * 2e-3) + 0.3 * np.sin(np.arange(4000) * 7e-3)
    drive = effect.invert(effect.initial_state(), wanted, steps_s)
    found = effect.run(effect.initial_state(), drive, steps_s)
    is_exact = effect.name in ("charge_leak", "creep_law", "lost_preload")
    assert np.max(np.abs(found - wanted)[200:]) < (1e-12 if is_exact else 2e-3)


# --- drive ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("jitter", [0.0, 0.5])
def test_unequal_lag_is_exact_through_its_changes_of_direction(jitter) -> None:
    steps_s, values = uneven(jitter=jitter)
    effect = UnequalLag(rising_s=1.5e-3, falling_s=4e-3)
    exact = integrated(lambda y, u: [(u - y[0]) / (1.5e-3 if u > y[0] else 4e-3)], 1, steps_s, values)
    assert np.max(np.abs(effect.run(effect.initial_state(), values, steps_s) - exact)) < 1e-5


def test_an_equal_lag_both_ways_is_that_of_the_bandwidth() -> None:
    steps_s, values = uneven()
    both, plain = UnequalLag(3e-3, 3e-3), AmplifierBandwidth(1.0 / (2.0 * np.pi * 3e-3))
    one = plain.run(plain.initial_state(), values, steps_s)
    np.testing.assert_allclose(both.run(both.initial_state(), values, steps_s), one, atol=1e-14)
    flat = VoltageDependentCapacitance(3e-3, 0.0)
    np.testing.assert_allclose(flat.run(flat.initial_state(), values, steps_s), one, atol=1e-14)
    assert UnequalLag.generalizes == VoltageDependentCapacitance.generalizes == AmplifierBandwidth.name


def test_a_contact_that_does_not_cling_is_a_bend_like_that_of_a_lost_preload() -> None:
    steps_s, values = uneven()
    contact, bend = IntermittentContact(contact_um=0.3, stiffness_share=0.2), LostPreload(0.3, 0.2 / (1.0 - 0.2))
    touched = contact.run(contact.initial_state(), values, steps_s)
    bent = bend.run(bend.initial_state(), values, steps_s)
    # but for a gain and an offset, which are the elements' and the sensor's
    slope, offset = np.polyfit(bent, touched, 1)
    np.testing.assert_allclose(touched, slope * bent + offset, atol=1e-12)
    assert IntermittentContact.generalizes == LostPreload.name


@pytest.mark.parametrize("per_v", [0.2, -0.15])
def test_capacitance_that_follows_the_voltage(per_v) -> None:
    steps_s, values = uneven()
    effect = VoltageDependentCapacitance(time_constant_s=2e-3, per_v=per_v)
    exact = integrated(lambda y, u: [(u - y[0]) / (2e-3 * (1.0 + per_v * y[0]))], 1, steps_s, values)
    assert np.max(np.abs(effect.run(effect.initial_state(), values, steps_s) - exact)) < 2e-4


@pytest.mark.parametrize("jitter", [0.0, 0.5])
def test_an_amplifier_of_second_order_overshoots(jitter) -> None:
    steps_s, values = uneven(jitter=jitter)
    w, d = 2.0 * np.pi * 60.0, 0.3
    exact = integrated(lambda y, u: [y[1], w * w * (u - y[0]) - 2.0 * d * w * y[1]], 2, steps_s, values)
    effect = DriveResonance(60.0, d)
    assert np.max(np.abs(effect.run(effect.initial_state(), values, steps_s) - exact)) < 1e-7


def test_a_leak_is_a_high_pass() -> None:
    steps_s, values = uneven()
    effect = ChargeLeak(0.03)
    leaked = integrated(lambda y, u: [(u - y[0]) / 0.03], 1, steps_s, values)
    assert np.max(np.abs(effect.run(effect.initial_state(), values, steps_s) - (values - leaked))) < 1e-9


def test_a_skewed_clock_counts_alike_at_once_and_sample_by_sample() -> None:
    rng = np.random.default_rng(4)
    steps_s, values = rng.uniform(0.5e-3, 2e-3, 3000), rng.uniform(-1.0, 1.0, 3000)
    effect = ClockSkew(ppm=-50.0)
    at_once = effect.run(effect.initial_state(), values, steps_s)
    state = effect.initial_state()
    one_by_one = [effect.run(state, values[k : k + 1], steps_s[k : k + 1])[0] for k in range(values.size)]
    assert np.array_equal(at_once, one_by_one)


# --- hysteresis ----------------------------------------------------------------------------------------------------


def test_thresholds_widen_with_the_rate() -> None:
    # on a triangle of one rate the widened loop is that of plays with the wider thresholds
    steps_s = np.full(4000, 1e-3)
    drive = np.abs((np.arange(1, 4001) / 500.0) % 4.0 - 2.0) - 2.0
    rate = 2.0
    effect = RateDependentHysteresis(0.25)
    form = MODEL.play_form
    found = np.zeros(4000)
    state = effect.initial_state()
    factor = effect.widening(state, drive, steps_s)
    assert np.allclose(factor, 1.0 + 0.25 * rate)
    wide = form.thresholds * (1.0 + 0.25 * rate)
    plays = np.zeros(wide.size)
    for k, u in enumerate(drive):
        plays = np.clip(plays, u - wide, u + wide)
        found[k] = form.slope * u + form.weights @ plays
    still = PiezoModel(MODEL.kappa_um_per_v, MODEL.saturation_v, 0.0)
    np.testing.assert_allclose(still.with_effects(effect).simulate(steps_s, drive), found, atol=1e-9)


# --- mechanics -----------------------------------------------------------------------------------------------------


def test_logarithmic_modes_add_up_to_the_logarithm() -> None:
    rates, gains = logarithmic_modes(0.1)
    t = np.geomspace(1e-3, 1e3, 40)
    np.testing.assert_allclose((1.0 - np.exp(-np.outer(t, rates))) @ gains, np.log1p(t / 0.1), atol=5e-4)


def test_creep_by_the_logarithm_and_by_relaxations() -> None:
    t = np.geomspace(1e-3, 1e2, 60)
    steps_s = np.diff(t, prepend=0.0)
    steps_s[0] = 1e-6  # the step itself
    t = np.cumsum(steps_s) - 1e-6
    ones = np.ones(60)
    law = CreepLaw(per_decade=0.02, onset_s=0.05)
    wanted = 1.0 + 0.02 * np.log10(1.0 + t / 0.05)
    np.testing.assert_allclose(law.run(law.initial_state(), ones, steps_s), wanted, atol=1e-5)
    few = CreepLaw(first_share=0.01, first_s=0.1, second_share=0.03, second_s=5.0)
    wanted = 1.0 + 0.01 * (1.0 - np.exp(-t / 0.1)) + 0.03 * (1.0 - np.exp(-t / 5.0))
    np.testing.assert_allclose(few.run(few.initial_state(), ones, steps_s), wanted, atol=1e-6)


@pytest.mark.parametrize("size", [0.5, 2.0, -2.0])
def test_a_large_step_creeps_by_more_of_itself(size) -> None:
    t = np.geomspace(1e-3, 1e2, 60)
    steps_s = np.diff(t, prepend=0.0)
    steps_s[0] = 1e-6
    effect = AmplitudeDependentCreep(0.01, 0.05)
    found = effect.run(effect.initial_state(), np.full(60, size), steps_s)
    wanted = size * (1.0 + 0.01 * abs(size) * np.log10(1.0 + (np.cumsum(steps_s) - 1e-6) / 0.05))
    np.testing.assert_allclose(found, wanted, atol=1e-5)


def test_kink_contact_and_backlash_by_hand() -> None:
    x, steps_s = np.array([0.0, 0.5, 1.0, 1.5, 0.9, 0.7, 1.1]), np.ones(7)
    kink = LostPreload(kink_um=1.0, slope_change=-0.5)
    assert kink.run(kink.initial_state(), x, steps_s) == pytest.approx([0.0, 0.25, 0.5, 1.0, 0.45, 0.35, 0.6])
    contact = IntermittentContact(contact_um=1.0, stiffness_share=0.5, adhesion_um=0.2)
    wanted = [0.0, 0.5, 1.0, 1.25, 0.95, 0.7, 1.05]  # it clings at 0.9 and has let go at 0.7
    assert contact.run(contact.initial_state(), x, steps_s) == pytest.approx(wanted)
    play = Backlash(gap_um=0.4)
    assert play.run(play.initial_state(), x, steps_s) == pytest.approx([0.0, 0.3, 0.8, 1.3, 1.1, 0.9, 0.9])


def test_what_follows_a_kink_begins_at_rest_as_the_stage_does() -> None:
    stage = PiezoModel(np.array([1.0]), np.array([]), 0.0, (LostPreload(1.0, -0.5), TransportDelay(0.25)))
    drive_v = np.concatenate((np.zeros(5), np.linspace(0.0, 3.0, 20)))
    moved_um = stage.simulate(np.full(25, 0.1), drive_v)
    np.testing.assert_array_equal(moved_um[:7], 0.0)
    assert moved_um[-1] > 1.5


def test_a_second_mode_is_a_resonance_and_an_antiresonance() -> None:
    steps_s = np.full(40_000, 1e-4)
    impulse = np.zeros(40_000)
    impulse[0] = 1.0
    effect = SecondMode(frequency_hz=100.0, damping_ratio=0.01, participation=0.19)
    response = np.abs(np.fft.rfft(effect.run(effect.initial_state(), impulse, steps_s)))
    frequency = np.fft.rfftfreq(40_000, 1e-4)
    near = frequency < 300.0
    assert frequency[near][np.argmax(response[near])] == pytest.approx(100.0, abs=0.5)
    assert frequency[near][np.argmin(response[near])] == pytest.approx(100.0 / np.sqrt(0.81), abs=0.5)


def test_two_modes_side_by_side_are_one_mode_behind_the_other() -> None:
    # s1 H1 + s2 H2 of unlike damping, by scipy, for a drive that is linear between the samples
    (f1, d1, s1), (f2, d2, s2) = (100.0, 0.012, 0.7), (170.0, 0.03, 0.3)
    w1, w2 = 2.0 * np.pi * f1, 2.0 * np.pi * f2
    values = np.random.default_rng(4).standard_normal(400)
    inputs, times = np.concatenate(([0.0], values)), np.arange(401) * 1e-3
    modes = [lsim(([w * w], [1.0, 2.0 * d * w, w * w]), inputs, times)[1][1:] for w, d in ((w1, d1), (w2, d2))]
    participation = 1.0 - (s1 + s2 * (w2 / w1) ** 2)
    rate_share = 2.0 * s2 * (w2 / w1) ** 2 * (d1 * w1 / w2 - d2)
    first = MechanicalResonance(frequency_hz=f1, damping_ratio=d1)
    second = SecondMode(f2, d2, participation, rate_share)
    frequency = np.linspace(1.0, 450.0, 60)
    swing = [1.0 / (1.0 - (frequency / f) ** 2 + 2j * d * frequency / f) for f, d in ((f1, d1), (f2, d2))]
    np.testing.assert_allclose(
        first.response(frequency) * second.response(frequency), s1 * swing[0] + s2 * swing[1], atol=1e-12
    )
    # within a step the response of the first is no line: parts of a step, as the chain takes them
    n = 200
    fine = np.interp(np.arange(1, 400 * n + 1) / n, np.arange(401), inputs)
    steps_s = np.full(fine.size, 1e-3 / n)
    moved = second.run(second.initial_state(), first.run(first.initial_state(), fine, steps_s), steps_s)[n - 1 :: n]
    np.testing.assert_allclose(moved, s1 * modes[0] + s2 * modes[1], atol=2e-5)


def test_what_resonates_is_believed_where_a_record_shows_it_ring() -> None:
    assert SecondMode(70.0, 0.03, 0.2).is_plausible(1.0, 1e-3)
    assert SecondMode(70.0, 0.03, -3.0, 0.1).is_plausible(1.0, 1e-3)
    assert not SecondMode(70.0, 0.03, 0.5).is_plausible(1.0, 1e-3), "it takes more than half: the first itself"
    assert not SecondMode(70.0, 0.75, 0.2).is_plausible(1.0, 1e-3), "no peak"
    assert not SecondMode(70.0, 0.03, 0.2).is_plausible(1.0, 1e-2), "beyond half the rate"
    assert not MechanicalResonance(70.0, 0.9).is_plausible(1.0, 1e-3), "no peak"
    assert MechanicalResonance(1200.0, 0.03).is_plausible(1.0, 1e-3), "it rings on, seen as an image"
    assert not MechanicalResonance(1200.0, 0.5).is_plausible(1.0, 1e-3), "over within a sample: a delay"


# --- sensor --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n_poles", [1, 2, 3, 4])
def test_the_sensor_is_a_butterworth_filter(n_poles) -> None:
    values = np.random.default_rng(3).standard_normal(300)
    steps_s = np.full(300, 1e-3)
    b, a = butter(n_poles, 2.0 * np.pi * 80.0, analog=True)
    exact = lsim((b, a), np.concatenate(([0.0], values)), np.arange(301) * 1e-3)[1][1:]
    effect = SensorBandwidth(cutoff_hz=80.0, n_poles=n_poles)
    np.testing.assert_allclose(effect.run(effect.initial_state(), values, steps_s), exact, atol=1e-11)


def test_a_cyclic_error_is_a_sine_of_the_displacement() -> None:
    x = np.linspace(-1.0, 3.0, 200)
    effect = CyclicSensorError(0.4, 0.01, 0.02, -0.003, 0.004)
    turned = 2.0 * np.pi * x / 0.4
    wanted = x + 0.01 * np.sin(turned) + 0.02 * np.cos(turned) - 0.003 * np.sin(2 * turned) + 0.004 * np.cos(2 * turned)
    np.testing.assert_allclose(effect.run(effect.initial_state(), x, np.ones(200)), wanted, atol=1e-15)


# --- directions of a fit -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "effect", [e for e in NEW_EFFECTS if e.stage in (Stage.MECHANICAL, Stage.SENSED)], ids=lambda e: e.name
)
def test_linearized_is_the_slope_of_the_response(effect) -> None:
    steps_s = np.full(400, 1e-3)
    x = 0.8 * np.sin(np.arange(1, 401) * 0.02) + 0.3 * np.arange(1, 401) / 400.0
    changes = np.column_stack((np.cos(np.arange(400) * 0.013), np.arange(400) / 400.0))
    size = 1e-7
    plain = effect.run(effect.initial_state(), x, steps_s)
    found = effect.linearized(changes, steps_s, x)
    for j in range(2):
        moved = (effect.run(effect.initial_state(), x + size * changes[:, j], steps_s) - plain) / size
        # a kink, a gap or a jump takes some samples' change to the other side
        assert np.mean(np.abs(moved - found[:, j]) > 1e-4) < 0.01


def test_what_has_switched_creeps_whatever_level_it_begins_at() -> None:
    effect = AmplitudeDependentCreep(0.0, 0.01, switched_per_decade=0.05, reach_um=4.0)
    time_s = 0.01 * np.arange(1, 1001)
    steps_s = np.full(1000, 0.01)
    crept = []
    for before, after in ((0.0, 2.0), (-3.0, -1.0)):
        values = np.full(1000, after)
        state = effect.initial_state()
        effect.run(state, np.full(200_000, before), np.full(200_000, 1.0))
        crept.append(effect.run(state, values, steps_s) - after)
    # the mean over thresholds 1/3, 2/3, ... 4 um; from -3 um on a play has twice its width to go
    fresh = 0.05 * sum(max(2.0 - j / 3, 0.0) for j in range(1, 13)) / 12
    turned = 0.05 * sum(max(2.0 - 2 * j / 3, 0.0) for j in range(1, 13) if j / 3 <= 3.0) / 12
    decades = np.log10(1.0 + time_s / 0.01)
    # the step itself is straight over its sample, which a decade later no longer shows
    np.testing.assert_allclose(crept[0][10:], fresh * decades[10:], rtol=0.03)
    change = crept[1][30:] - crept[1][30]
    np.testing.assert_allclose(change, turned * (decades[30:] - decades[30]), rtol=0.03, atol=1e-3 * turned)

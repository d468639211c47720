"""Maxwell elements: both forms, their inverse relation, memory, rate independence, arbitrary states."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_models import elements, relative, signals

from fomrc_core.errors import InputError
from fomrc_core.operators.hysteresis import (
    OperatorSum,
    check_elements,
    displacement_stops_to_voltage_stops,
    elements_from_play_form,
    hysteresis_block,
    maxwell_slip_force,
    move_plays,
    move_plays_batch,
    move_stops,
    move_stops_batch,
    play_form,
    play_states,
    stop_form,
    voltage_stops_to_displacement_stops,
    walk_breakpoints,
)


def stop_sum(kappa, saturation, displacement_um):
    out = np.empty(displacement_um.size)
    move_stops_batch(hysteresis_block(stop_form(kappa, saturation)), 0, displacement_um, out)
    return out


def play_sum(kappa, saturation, voltage_v):
    out = np.empty(voltage_v.size)
    move_plays_batch(hysteresis_block(play_form(kappa, saturation)), 0, voltage_v, out)
    return out


def literal_stops(kappa, saturation, displacement_um):
    """The element law itself, (15)-(17): each voltage follows the charge and is held at its limits."""
    element_v = np.zeros(saturation.size)
    before, out = 0.0, []
    for x in displacement_um:
        element_v = np.clip(element_v + (x - before) / kappa[:-1], -saturation, saturation)
        before = x
        out.append(np.sum(element_v) + x / kappa[-1])
    return np.array(out)


@settings(deadline=None, max_examples=100)
@given(elements(), signals())
def test_stop_form_is_the_element_law(sets, x):
    assert relative(stop_sum(*sets, x), literal_stops(*sets, x)) <= 1e-12


@settings(deadline=None, max_examples=150)
@given(elements(), signals())
def test_play_form_undoes_stop_form_and_back(sets, signal):
    assert relative(play_sum(*sets, stop_sum(*sets, signal)), signal) <= 1e-12
    assert relative(stop_sum(*sets, play_sum(*sets, signal)), signal) <= 1e-12


@settings(deadline=None, max_examples=60)
@given(elements(least=1))
def test_exact_ties_at_the_thresholds(sets):
    # turning points exactly at, and twice, each threshold of either form
    for form, there, back in ((stop_form(*sets), stop_sum, play_sum), (play_form(*sets), play_sum, stop_sum)):
        r = form.thresholds
        signal = np.concatenate([(a, -a, 2 * a, 0.0, -2 * a, a, a) for a in r])
        assert relative(back(*sets, there(*sets, signal)), signal) <= 1e-12


@settings(deadline=None, max_examples=60)
@given(elements(least=1), signals())
def test_elements_come_back_from_their_play_form(sets, voltage_v):
    back = elements_from_play_form(play_form(*sets))
    assert relative(play_sum(*back, voltage_v), play_sum(*sets, voltage_v)) <= 1e-11


def test_elements_come_back_one_by_one():
    kappa, saturation = np.array([10.0, 2.0, 5.0, 1.3]), np.array([0.01, 0.2, 0.3])
    kappa_back, saturation_back = elements_from_play_form(play_form(kappa, saturation))
    assert kappa_back == pytest.approx(kappa, rel=1e-13)  # their thresholds 0.1, 0.4, 1.5 um ascend already
    assert saturation_back == pytest.approx(saturation, rel=1e-13)


@settings(deadline=None, max_examples=60)
@given(elements(), signals())
def test_batch_equals_stepwise_bit_for_bit(sets, signal):
    for form, batch, one in (
        (play_form(*sets), move_plays_batch, move_plays),
        (stop_form(*sets), move_stops_batch, move_stops),
    ):
        whole, single, out = hysteresis_block(form), hysteresis_block(form), np.empty(signal.size)
        batch(whole, 0, signal, out)
        stepwise = np.array([one(single, 0, value) for value in signal])
        assert relative(out, stepwise) <= 1e-14
        assert np.array_equal(play_states(whole), play_states(single))


@settings(deadline=None, max_examples=60)
@given(elements(least=1), signals(), st.integers(2, 7))
def test_rate_independence(sets, signal, n_parts):
    # the same path walked in n parts ends at the same places
    before = np.concatenate(([0.0], signal[:-1]))
    share = np.arange(1, n_parts + 1) / n_parts
    fine = before[:, None] + (signal - before)[:, None] * share
    fine[:, -1] = signal
    assert relative(play_sum(*sets, fine.reshape(-1))[n_parts - 1 :: n_parts], play_sum(*sets, signal)) <= 1e-12


@settings(deadline=None, max_examples=60)
@given(elements(least=1), signals(most=80), st.integers(0, 2**32 - 1))
def test_return_point_memory(sets, before, seed):
    # after an excursion within the last two extremes, the loop closes and goes on as if it had not been
    low, high = float(np.min(before)) - 1.0, float(np.max(before)) + 1.0
    inside = np.random.default_rng(seed).uniform(low, high, 40)
    onward = np.linspace(high, high + 3.0, 10)
    short = play_sum(*sets, np.concatenate((before, [low, high], onward)))
    detour = play_sum(*sets, np.concatenate((before, [low, high], inside, [high], onward)))
    assert relative(detour[-10:], short[-10:]) <= 1e-12


def test_wiping_out_forgets_smaller_extremes():
    kappa, saturation = np.array([2.0, 1.0, 0.5, 1.0]), np.array([0.1, 0.4, 1.0])
    direct = play_sum(kappa, saturation, np.array([5.0, -5.0, 1.0]))
    after_small_loops = play_sum(kappa, saturation, np.array([0.5, -0.7, 1.0, -2.0, 5.0, -5.0, 1.0]))
    assert after_small_loops[-1] == pytest.approx(direct[-1], rel=1e-14)


def test_absolute_states_do_not_drift():
    rng = np.random.default_rng(3)
    kappa, saturation = 10.0 ** rng.uniform(-1, 1, 11), rng.uniform(0.01, 0.3, 10)
    loop = 2.0 * np.sin(2 * np.pi * np.arange(1000) / 1000.0)
    out = play_sum(kappa, saturation, np.tile(loop, 1000))
    assert np.array_equal(out[-1000:], out[1000:2000])


@settings(deadline=None, max_examples=100)
@given(elements(least=1), signals(most=120))
def test_walk_breakpoints_agrees_with_the_play_form(sets, voltage_v):
    stop = stop_form(*sets)
    stretches, displacement, walked = np.zeros(stop.thresholds.size), 0.0, []
    for change in np.diff(voltage_v, prepend=0.0):
        moved, stretches = walk_breakpoints(stop, stretches, float(change))
        displacement += moved
        walked.append(displacement)
    assert relative(np.array(walked), play_sum(*sets, voltage_v)) <= 1e-11


@settings(deadline=None, max_examples=100)
@given(elements(least=1), st.integers(0, 2**32 - 1), st.floats(-5.0, 5.0))
def test_walk_breakpoints_from_states_nobody_reaches(sets, seed, change_v):
    stop = stop_form(*sets)
    stretches = np.random.default_rng(seed).uniform(-1.0, 1.0, stop.thresholds.size) * stop.thresholds
    moved, after = walk_breakpoints(stop, stretches, change_v)
    # what a walk must fulfil: each stretch follows the displacement within its limits, and the voltages add up
    assert np.allclose(after, np.clip(stretches + moved, -stop.thresholds, stop.thresholds), rtol=0, atol=1e-12)
    voltage = stop.slope * moved + np.sum(stop.weights * (after - stretches))
    assert voltage == pytest.approx(change_v, rel=1e-11, abs=1e-12)


@settings(deadline=None, max_examples=100)
@given(elements(least=1), signals(most=120))
def test_passage_between_the_states_of_the_two_forms(sets, voltage_v):
    stop, play = stop_form(*sets), play_form(*sets)
    forward_block, backward_block = hysteresis_block(play), hysteresis_block(stop)
    displacement = np.empty(voltage_v.size)
    move_plays_batch(forward_block, 0, voltage_v, displacement)
    move_stops_batch(backward_block, 0, displacement, np.empty(voltage_v.size))
    stops_v = voltage_v[-1] - play_states(forward_block)
    stops_um = displacement[-1] - play_states(backward_block)
    scale_v, scale_um = np.max(np.abs(voltage_v)), np.max(np.abs(displacement))
    assert np.max(np.abs(displacement_stops_to_voltage_stops(stop, stops_um) - stops_v)) <= 1e-11 * scale_v
    assert np.max(np.abs(voltage_stops_to_displacement_stops(stop, stops_v) - stops_um)) <= 1e-11 * scale_um


def test_maxwell_slip_force_on_a_first_rise_and_a_reversal():
    stiffness, breakaway = np.array([100.0, 50.0]), np.array([1.0, 2.0])
    position = np.array([0.005, 0.01, 0.03, 0.04, 0.08, 0.07, 0.0])
    # by hand: spring 1 slips from 0.01 m on, spring 2 from 0.04 m on; the reversal unloads both
    assert maxwell_slip_force(stiffness, breakaway, position) == pytest.approx([0.75, 1.5, 2.5, 3.0, 3.0, 1.5, -3.0])


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: check_elements([1.0, 2.0], [1.0, 1.0]), "saturation_v"),
        (lambda: check_elements([1.0, -2.0], [1.0]), "kappa_um_per_v"),
        (lambda: check_elements([1.0, 2.0], [0.0]), "saturation_v"),
        (lambda: check_elements([1.0, np.nan], [1.0]), "kappa_um_per_v"),
        (lambda: check_elements([1.0, np.inf], [1.0]), "kappa_um_per_v"),
        (lambda: check_elements("ab", [1.0]), "kappa_um_per_v"),
        (lambda: check_elements(None, [1.0]), "kappa_um_per_v"),
        (lambda: check_elements([[1.0], [2.0]], [1.0]), "kappa_um_per_v"),
        (lambda: check_elements([[1.0], [2.0, 3.0]], [1.0]), "kappa_um_per_v"),
        (lambda: check_elements([], []), "kappa_um_per_v"),
        (lambda: elements_from_play_form(OperatorSum(1.0, np.array([1.0]), np.array([-1.0]))), "play form"),
        (lambda: elements_from_play_form(OperatorSum(np.nan, np.array([1.0]), np.array([1.0]))), "play form"),
        (lambda: maxwell_slip_force([1.0], [1.0, 2.0], [0.0]), "breakaway_force"),
        (lambda: maxwell_slip_force([0.0], [1.0], [0.0]), "stiffness"),
    ],
)
def test_bad_input_is_named(call, named):
    with pytest.raises(InputError) as caught:
        call()
    assert named in str(caught.value)
    assert "allowed" in str(caught.value)
    assert "\n" not in str(caught.value)

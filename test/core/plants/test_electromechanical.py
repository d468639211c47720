"""The electromechanical plant against what its equations say in closed form."""

import dataclasses
import itertools
import math

import numpy as np
import pytest

from fomrc_core.compute.pulse import heard_by
from fomrc_core.errors import ParameterError
from fomrc_core.plants import electromechanical
from fomrc_core.plants.electromechanical import ElectromechanicalPlant, table1_plant


def plain_plant(**changes):
    """A plant without saturating elements: only the branch and the mechanics."""
    values = {
        "mass_kg": 0.04,
        "damping_n_s_per_m": 800.0,
        "stiffness_n_per_m": 45e6,
        "force_ratio_n_per_v": 57.6,
        "charge_ratio_c_per_m": 2.5,
        "capacitance_f": 1.2e-5,
        "element_capacitance_f": [],
        "saturation_v": [],
        "element_order": [],
        "branch_order": 0.015,
    }
    return ElectromechanicalPlant(**{**values, **changes})


def held_step(plant, voltage_v, times_s):
    """Displacement at ``times_s`` after a step of voltage reached within 1 us."""
    every_s = np.geomspace(1e-6, times_s[-1], 4000)
    steps = np.diff(np.append(0.0, every_s))
    return np.interp(np.log(times_s), np.log(every_s), plant.simulate(steps, np.full(steps.size, voltage_v)))


def triangle(slope_v_per_s, amplitudes_v, rate_hz=1000.0):
    corners = [0.0, *(sign * a for a in amplitudes_v for sign in (1, -1)), 0.0]
    parts = [
        start + (stop - start) * np.arange(1, n + 1) / n
        for start, stop in itertools.pairwise(corners)
        for n in [max(1, round(abs(stop - start) / slope_v_per_s * rate_hz))]
    ]
    return np.concatenate(parts)


@pytest.mark.parametrize("order", [0.0, 0.015, 0.1])
def test_creep_follows_the_power_law(order):
    plant = dataclasses.replace(plain_plant(branch_order=order), substep_s=1.0)
    times_s = np.geomspace(0.1, 1e4, 25)  # from t_c on, where the mechanics have settled
    expected = 57.6 / 45e6 * 1e6 * 2.0 * times_s**order / math.gamma(1.0 + order)
    np.testing.assert_allclose(
        held_step(plant, 2.0, times_s),
        expected,
        rtol=1.5e-4 if order == 0.1 else 3e-5,
    )


def test_static_gain_without_creep_is_the_series_circuit():
    plant = plain_plant(
        element_capacitance_f=[2e-4, 5e-4],
        saturation_v=[0.02, 0.05],
        element_order=[0.0, 0.0],
        branch_order=0.0,
        damping_n_s_per_m=6000.0,  # without overshoot, which would unsaturate the elements
    )
    ratio = plant.effective_ratio_c_per_m
    kappa = np.array([2e-4, 5e-4]) / ratio * 1e6
    for voltage, expected in (
        (0.1, 0.1 / (np.sum(1.0 / kappa) + 1.0 / 1.28)),  # nothing saturated
        (2.0, (2.0 - 0.02 - 0.05) * 1.28),  # both saturated
    ):
        slow_ramp = plant.simulate(1e-3, voltage * np.append(np.linspace(0.01, 1.0, 200), np.ones(400)))
        assert slow_ramp[-1] == pytest.approx(expected, rel=1e-9)


def test_resonance_frequency_and_damping():
    damping_ratio, frequency_hz = 0.02, 800.0
    mass = 45e6 / (2 * math.pi * frequency_hz) ** 2
    plant = plain_plant(mass_kg=mass, damping_n_s_per_m=2 * damping_ratio * math.sqrt(45e6 * mass), branch_order=0.0)
    step_s = 1e-5
    free = plant.simulate(step_s, np.append(np.linspace(0, 1, 10), np.ones(4000)))[10:] - 1.28
    crossings = np.flatnonzero((free[:-1] < 0) & (free[1:] >= 0))
    at = crossings - free[crossings] / (free[crossings + 1] - free[crossings])
    damped_hz = 1.0 / (np.diff(at).mean() * step_s)
    assert damped_hz == pytest.approx(frequency_hz * math.sqrt(1 - damping_ratio**2), rel=1e-5)
    peaks = np.array([free[a:b].max() for a, b in itertools.pairwise(crossings)])
    decrement = -np.polyfit(np.arange(peaks.size), np.log(peaks), 1)[0]
    assert decrement == pytest.approx(2 * math.pi * damping_ratio / math.sqrt(1 - damping_ratio**2), rel=5e-3)


def test_external_force_stiffness_depends_on_the_circuit():
    """Held voltage: k alone without series elements, stiffer through T_F T_q with them."""
    push_n = -10.0
    loads = push_n * np.append(np.linspace(0.01, 1.0, 100), np.ones(200))

    def stiffness(plant):
        return push_n / (plant.simulate(1e-3, np.zeros(300), external_force_n=loads)[-1] * 1e-6)

    alone = plain_plant(branch_order=0.0)
    assert stiffness(alone) == pytest.approx(45e6, rel=1e-9)
    elements = dataclasses.replace(
        alone, element_capacitance_f=[2e-5, 3e-5], saturation_v=[1.0, 1.0], element_order=[0.0, 0.0]
    )
    series = 1.0 / (1 / 2e-5 + 1 / 3e-5)
    assert stiffness(elements) == pytest.approx(45e6 + 57.6 * 2.5 / (1.2e-5 + series), rel=1e-9)
    nearly_open = dataclasses.replace(alone, element_capacitance_f=[1e-12], saturation_v=[1e9], element_order=[0.0])
    assert stiffness(nearly_open) == pytest.approx(45e6 + 57.6 * 2.5 / 1.2e-5, rel=1e-6)


def test_the_two_transformer_ratios_are_distinct():
    """T_F sets the force per volt, T_q the charge per displacement: each has its own effect."""
    base = table1_plant(10)
    u = triangle(10.0, [2.0])
    reference = base.simulate(1e-3, u)
    more_force = dataclasses.replace(base, force_ratio_n_per_v=base.force_ratio_n_per_v * 1.1)
    more_charge = dataclasses.replace(base, charge_ratio_c_per_m=base.charge_ratio_c_per_m * 1.1)
    assert np.ptp(more_force.simulate(1e-3, u)) > 1.05 * np.ptp(reference)
    assert np.ptp(more_charge.simulate(1e-3, u)) < np.ptp(reference)


def test_work_done_over_a_closed_loop_is_lost_not_gained():
    plant = table1_plant(20)
    half = triangle(5.0, [2.5])
    u = np.concatenate([half, half, half])
    x = plant.simulate(1e-3, u)
    last = slice(2 * half.size - 1, None)
    area = np.sum(0.5 * (x[last][1:] + x[last][:-1]) * np.diff(u[last]))  # of x du: negative when x lags u
    assert area < -0.1 * np.ptp(x) * np.ptp(u) * 0.5


def test_stroke_and_nonlinearity_are_those_of_the_papers_stage():
    u = triangle(1.0, [2.5, 2.0, 1.5])
    x = table1_plant().simulate(1e-3, u)
    fit = np.polyfit(u, x, 1)
    width = 2.0 * np.abs(x - np.polyval(fit, u)).max() / np.ptp(x)
    assert 1.0 < fit[0] < 1.3
    assert 0.115 < width < 0.13


def test_independent_of_the_substep():
    u = triangle(20.0, [2.5, 1.0])
    coarse, fine = (table1_plant(12, substep_s=h).simulate(1e-3, u) for h in (1e-4, 1.25e-5))
    assert np.abs(coarse - fine).max() < 1e-5 * np.ptp(fine)


def test_independent_of_how_a_ramp_is_cut_into_samples():
    plant = table1_plant(12)
    corners = np.array([0.0, 1.5, -0.5, 1.0])
    rng = np.random.default_rng(5)
    whole_time = np.array([0.0, 0.3, 0.7, 1.0])
    even = np.linspace(0, 1, 1001)[1:]
    ragged = np.unique(np.concatenate([whole_time[1:], rng.uniform(0, 1, 400)]))
    ragged = ragged[np.append(True, np.diff(ragged) > 1e-6)]
    results = [
        plant.simulate(np.diff(np.append(0.0, t)), np.interp(t, whole_time, corners))[-1] for t in (even, ragged)
    ]
    assert results[0] == pytest.approx(results[1], rel=1e-6)


def test_stepwise_equals_batch_and_copies_are_independent():
    plant = table1_plant(8)
    u = triangle(50.0, [2.0])
    batch = plant.simulate(1e-3, u)
    state = plant.initial_state()
    stepwise = [plant.advance(state, v, 1e-3) for v in u[:20]]
    saved = state.copy()
    stepwise += [plant.advance(state, v, 1e-3) for v in u[20:]]
    np.testing.assert_array_equal(stepwise, batch)
    np.testing.assert_array_equal(plant.simulate(1e-3, u[20:], saved), batch[20:])


def test_a_long_simulation_is_heard_and_bit_for_bit_the_same(monkeypatch):
    plant = table1_plant(8)
    u, force = triangle(50.0, [2.0]), np.linspace(0.0, 20.0, triangle(50.0, [2.0]).size)
    whole = plant.simulate(1e-3, u, external_force_n=force)
    monkeypatch.setattr(electromechanical, "_N_TOGETHER", 70)
    heard = []
    with heard_by(lambda what, n: heard.append((what, n))):
        in_parts = plant.simulate(1e-3, u, external_force_n=force)
    np.testing.assert_array_equal(in_parts, whole)
    assert [n for _, n in heard] == [70] * (u.size // 70) + [u.size % 70] * (u.size % 70 > 0)
    assert {what for what, _ in heard} == {"samples of the plant"}


def test_voltages_stay_within_saturation_and_add_up():
    plant = table1_plant(15)
    state = plant.initial_state()
    rng = np.random.default_rng(1)
    for v in np.cumsum(rng.normal(0, 0.3, 200)):
        plant.advance(state, v, 1e-3)
        assert np.all(np.abs(state.potential_v[:-1]) <= plant.saturation_v * (1 + 1e-12))
        assert state.potential_v.sum() == pytest.approx(v, abs=1e-12)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"mass_kg": 0.0}, "mass_kg"),
        ({"stiffness_n_per_m": math.nan}, "stiffness_n_per_m"),
        ({"branch_order": 1.0}, "branch_order"),
        (
            {"element_capacitance_f": [1e-4], "saturation_v": [0.1, 0.2], "element_order": [0.0]},
            "saturation_v",
        ),
        ({"element_capacitance_f": [1e-4], "saturation_v": [-0.1], "element_order": [0.0]}, "saturation_v"),
    ],
)
def test_bad_parameters_are_named(changes, word):
    with pytest.raises(ParameterError, match=word):
        plain_plant(**changes)


def test_bad_input_leaves_the_state_as_it_was():
    plant = table1_plant(4)
    state = plant.initial_state()
    plant.advance(state, 1.0, 1e-3)
    before = state.copy()
    for voltage, step in ((math.nan, 1e-3), (1.0, 0.0), (1.0, -1e-3), (math.inf, 1e-3)):
        with pytest.raises(ParameterError):
            plant.advance(state, voltage, step)
    np.testing.assert_array_equal(state.potential_v, before.potential_v)
    np.testing.assert_array_equal(state.motion, before.motion)

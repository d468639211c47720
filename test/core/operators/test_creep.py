"""The fractional operator against closed forms, the exact full-memory form, and itself backwards."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_models import relative, signals, steps
from scipy.integrate import quad

from fomrc_core.errors import InputError
from fomrc_core.operators.creep import (
    creep_block,
    creep_modes,
    creep_modes_slope,
    differentiate_step,
    integrate_step,
    mode_states,
    step_response,
)
from fomrc_core.operators.creep_batch import differentiate, integrate
from fomrc_core.operators.creep_full_memory import creep_full_memory

ORDERS = [1e-9, 1e-4, 0.003, 0.015, 0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99, 0.9999, 1.0 - 1e-9]


def integral(order, values, steps_s):
    out = np.empty(values.size)
    integrate(creep_block(creep_modes(order)), 0, values, steps_s, out)
    return out


def derivative(order, values, steps_s):
    out = np.empty(values.size)
    differentiate(creep_block(creep_modes(order)), 0, values, steps_s, out)
    return out


@pytest.mark.parametrize("order", [0.0, *ORDERS, 1.0])
def test_step_response_of_the_modes(order):
    modes = creep_modes(order)
    t = np.geomspace(1e-3, 1e5, 3000)
    exact = t**order / math.gamma(1.0 + order)
    assert modes.n_modes <= 40
    assert np.max(np.abs(step_response(modes, t) / exact - 1.0)) <= 1e-6


@pytest.mark.parametrize("order", [0.0, *ORDERS, 1.0])
def test_step_response_of_the_stepped_operator(order):
    # a step that arrives over 1 us, then ever longer steps from 1 ms to 1e5 s
    t = np.concatenate(([1e-6], 1e-6 + np.geomspace(1e-3, 1e5, 400)))
    dt = np.diff(t, prepend=0.0)
    after = t[1:]
    # a ramp of 1 us: the integral of the step response over the ramp, without cancellation
    exact = np.array([quad(lambda s, t=t: (t - s) ** order, 0.0, 1e-6)[0] / 1e-6 for t in after])
    exact /= math.gamma(1.0 + order)
    found = integral(order, np.ones(t.size), dt)[1:]
    assert np.max(np.abs(found / exact - 1.0)) <= 1e-6


@pytest.mark.parametrize("order", [0.015, 0.1, 0.4, 0.8])
@pytest.mark.parametrize("step_s", [1e-3, 2e-4])
def test_random_walk_against_full_memory(order, step_s):
    walk = np.cumsum(np.random.default_rng(7).standard_normal(60_000))
    dt = np.full(walk.size, step_s)
    assert relative(integral(order, walk, dt), creep_full_memory(order, walk, dt)) <= 1e-5


@pytest.mark.parametrize("order", [0.015, 0.3, 0.9])
def test_jittered_random_walk_with_gaps_against_full_memory(order):
    rng = np.random.default_rng(8)
    walk = np.cumsum(rng.standard_normal(4000))
    dt = 1e-3 * rng.uniform(0.5, 1.5, walk.size)
    dt[rng.random(walk.size) < 0.01] *= 200.0
    assert relative(integral(order, walk, dt), creep_full_memory(order, walk, dt)) <= 1e-5


@pytest.mark.parametrize("order", [0.0, 0.015, 0.5, 1.0])
def test_full_memory_form_against_quadrature(order):
    rng = np.random.default_rng(9)
    dt = rng.uniform(0.1, 2.0, 12)
    y = rng.standard_normal(12)
    times, nodes = np.concatenate(([0.0], np.cumsum(dt))), np.concatenate(([0.0], y))
    rates = np.diff(nodes) / dt
    for k in (0, 3, 11):
        t = times[k + 1]
        # Riemann-Liouville after one integration by parts: the slope of the input times (t - s)^alpha
        exact = sum(
            rates[j] * quad(lambda s, t=t: (t - s) ** order, times[j], times[j + 1], epsabs=1e-13, epsrel=1e-13)[0]
            for j in range(k + 1)
        ) / math.gamma(order + 1.0)
        assert creep_full_memory(order, y, dt)[k] == pytest.approx(exact, rel=1e-11, abs=1e-11)


@pytest.mark.parametrize("order", [0.0, 0.015, 0.7, 1.0])
def test_full_memory_uniform_equals_any_steps(order):
    y = np.cumsum(np.random.default_rng(10).standard_normal(500))
    dt = np.full(500, 1e-3)
    slightly_off = dt.copy()
    slightly_off[250] *= 1.0 + 1e-14
    assert relative(creep_full_memory(order, y, dt), creep_full_memory(order, y, slightly_off)) <= 1e-12


def test_full_memory_power_law():
    # a ramp is linear between samples, so its fractional integral is exact: t^(1+a)/Gamma(2+a)
    dt = np.random.default_rng(11).uniform(1e-3, 1.0, 300)
    t = np.cumsum(dt)
    for order in (0.0, 0.2, 1.0):
        exact = t ** (1.0 + order) / math.gamma(2.0 + order)
        assert np.max(np.abs(creep_full_memory(order, t, dt) / exact - 1.0)) <= 1e-12


def test_order_zero_is_the_identity():
    rng = np.random.default_rng(12)
    y, dt = rng.standard_normal(1000), rng.uniform(1e-6, 10.0, 1000)
    assert np.array_equal(integral(0.0, y, dt), y)
    assert np.array_equal(derivative(0.0, y, dt), y)


def test_order_one_is_the_trapezoid_integrator():
    rng = np.random.default_rng(13)
    y, dt = rng.standard_normal(1000), rng.uniform(1e-3, 1.0, 1000)
    trapezoid = np.cumsum(0.5 * (y + np.concatenate(([0.0], y[:-1]))) * dt)
    assert relative(integral(1.0, y, dt), trapezoid) <= 1e-14
    assert creep_modes(1.0).n_modes == 1


@settings(deadline=None, max_examples=60)
@given(st.data(), st.floats(0.0, 1.0))
def test_derivative_then_integral_is_identity(data, order):
    x = data.draw(signals())
    dt = data.draw(steps(x.size))
    y = derivative(order, x, dt)
    # at high order the derivative is large and oscillates: what comes back is exact to its rounding
    slack = max(1.0, np.max(np.abs(y)) * np.max(dt) ** order / np.max(np.abs(x)) if np.any(x) else 1.0)
    assert relative(integral(order, y, dt), x) <= 1e-12 * slack


@settings(deadline=None, max_examples=60)
@given(st.data(), st.floats(0.0, 0.4))
def test_integral_then_derivative_is_identity(data, order):
    y = data.draw(signals())
    dt = data.draw(steps(y.size))
    x = integral(order, y, dt)
    # the condition of the passage: what one rounding of x is worth in y, over the shortest step
    condition = (
        np.max(np.abs(x)) * math.gamma(order + 2.0) / np.min(dt) ** order / np.max(np.abs(y)) if np.any(y) else 1.0
    )
    assert relative(derivative(order, x, dt), y) <= 1e-12 * max(1.0, condition)


@settings(deadline=None, max_examples=60)
@given(st.data(), st.floats(0.0, 1.0))
def test_batch_equals_stepwise(data, order):
    y = data.draw(signals())
    dt = data.draw(steps(y.size))
    for batch, one_step in ((integrate, integrate_step), (differentiate, differentiate_step)):
        block = creep_block(creep_modes(order))
        stepwise = np.array([one_step(block, 0, v, s) for v, s in zip(y, dt, strict=True)])
        out, whole = np.empty(y.size), creep_block(creep_modes(order))
        batch(whole, 0, y, dt, out)
        assert relative(out, stepwise) <= 1e-12
        if order > 0.0:
            assert relative(mode_states(whole), mode_states(block)) <= 1e-12
        cut = data.draw(st.integers(0, y.size))
        parts, split = np.empty(y.size), creep_block(creep_modes(order))
        batch(split, 0, y[:cut], dt[:cut], parts[:cut])
        batch(split, 0, y[cut:], dt[cut:], parts[cut:])
        assert relative(parts, stepwise) <= 1e-12


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), order=st.floats(0.0, 1.0), n_lengths=st.sampled_from((1, 3, 20)))
def test_steps_in_parts_and_a_clock_that_jitters_equal_single_steps(seed, order, n_lengths):
    # runs of one to thirty steps, their lengths few or more than are kept; what comes out in the place of what goes in
    rng = np.random.default_rng(seed)
    runs = rng.integers(1, 31, size=40)
    lengths = 1e-3 / rng.integers(1, n_lengths + 1, size=40)
    dt = np.repeat(lengths, runs) * (rng.uniform(0.9, 1.1, runs.sum()) if rng.random() < 0.2 else 1.0)
    y = np.cumsum(rng.normal(size=dt.size))
    for batch, one_step in ((integrate, integrate_step), (differentiate, differentiate_step)):
        block, whole = creep_block(creep_modes(order)), creep_block(creep_modes(order))
        stepwise = np.array([one_step(block, 0, v, s) for v, s in zip(y, dt, strict=True)])
        out = y.copy()
        batch(whole, 0, out, dt, out)
        assert relative(out, stepwise) <= 1e-12
        assert relative(batch_goes_on(batch, whole, dt), batch_goes_on(batch, block, dt)) <= 1e-12


def batch_goes_on(batch, block, dt):
    """Return what some more samples give, which tells every part of the state."""
    out = np.ones(dt.size)
    batch(block, 0, out, dt[::-1].copy(), out)
    return out


def test_a_long_step_equals_many_short_ones_on_a_ramp():
    # the input is linear over both, so nothing may differ but the approximation
    fine = integral(0.1, np.linspace(0.001, 1.0, 1000), np.full(1000, 1e-3))
    coarse = integral(0.1, np.array([0.25, 0.5, 1.0]), np.array([0.25, 0.25, 0.5]))
    assert coarse == pytest.approx(fine[[249, 499, 999]], rel=1e-6)


@pytest.mark.parametrize("order", [0.01, 0.3, 0.8])
def test_slope_modes_against_the_closed_derivative(order):
    # d/da t^a / Gamma(1+a) by a symmetric difference of the closed form
    t = np.geomspace(1e-2, 1e3, 50)
    h = 1e-6
    exact = (t ** (order + h) / math.gamma(1 + order + h) - t ** (order - h) / math.gamma(1 + order - h)) / (2 * h)
    found = step_response(creep_modes_slope(order), t)
    assert np.max(np.abs(found - exact)) <= 1e-4 * np.max(np.abs(exact))


@pytest.mark.parametrize("accuracy", [1e-3, 1e-5, 1e-8])
@pytest.mark.parametrize("order", [0.015, 0.5])
def test_chosen_accuracy_is_kept(accuracy, order):
    modes = creep_modes(order, accuracy, 1e-2, 1e4)
    t = np.geomspace(1e-2, 1e4, 1000)
    assert np.max(np.abs(step_response(modes, t) * math.gamma(1.0 + order) / t**order - 1.0)) <= accuracy
    assert creep_modes(order, accuracy, 1e-2, 1e4).n_modes < creep_modes(order, accuracy / 10.0, 1e-2, 1e4).n_modes


@pytest.mark.parametrize(
    ("call", "named", "shown"),
    [
        (lambda: creep_modes(-0.1), "creep_order", "-0.1"),
        (lambda: creep_modes(1.5), "creep_order", "1.5"),
        (lambda: creep_modes(math.nan), "creep_order", "nan"),
        (lambda: creep_modes("0.1"), "creep_order", "0.1"),
        (lambda: creep_modes(True), "creep_order", "True"),
        (lambda: creep_modes(0.1, accuracy=0.0), "accuracy", "0.0"),
        (lambda: creep_modes(0.1, accuracy=math.nan), "accuracy", "nan"),
        (lambda: creep_modes(0.1, 1e-6, 1.0, 0.1), "shortest_time_s", "1.0"),
        (lambda: creep_modes(0.1, 1e-6, 0.0, 0.1), "shortest_time_s", "0.0"),
        (lambda: creep_full_memory(2.0, np.ones(3), np.ones(3)), "order", "2.0"),
        (lambda: creep_full_memory(0.1, np.ones(3), np.ones(4)), "values", "(4,)"),
        (lambda: creep_full_memory(0.1, np.ones(2), np.array([1.0, 0.0])), "steps_s", "0.0"),
    ],
)
def test_bad_input_is_named(call, named, shown):
    with pytest.raises(InputError) as caught:
        call()
    line = str(caught.value)
    assert named in line
    assert shown in line
    assert "allowed" in line
    assert "\n" not in line

"""The direct inverse: both compositions are the identity, effects are undone where they can be."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_models import elements, relative, signals, steps

from fomrc_core.effects import effect_classes
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.cross_axis import CrossAxis
from fomrc_core.effects.dead_zone import DeadZone
from fomrc_core.effects.missing_hysteresis import MissingHysteresis
from fomrc_core.effects.slow_relaxation import SlowRelaxation
from fomrc_core.effects.thermal_drift import ThermalDrift
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.state import ModelState

ORDERS = st.one_of(st.sampled_from([0.0, 1e-6, 0.015, 0.2]), st.floats(0.0, 0.2))
MODEL = PiezoModel([10.0, 4.0, 7.0, 1.5], [0.02, 0.1, 0.3], 0.02)


@settings(deadline=None, max_examples=200)
@given(st.data(), elements(), ORDERS)
def test_forward_of_inverse_is_identity(data, sets, order):
    model = PiezoModel(*sets, order)
    wanted = data.draw(signals())
    steps_s = data.draw(steps(wanted.size))
    assert relative(model.simulate(steps_s, Compensator(model).run(steps_s, wanted)), wanted) <= 1e-12


@settings(deadline=None, max_examples=200)
@given(st.data(), elements(), ORDERS)
def test_inverse_of_forward_is_identity(data, sets, order):
    model = PiezoModel(*sets, order)
    voltage_v = data.draw(signals())
    steps_s = data.draw(steps(voltage_v.size))
    assert relative(Compensator(model).run(steps_s, model.simulate(steps_s, voltage_v)), voltage_v) <= 1e-12


@settings(deadline=None, max_examples=60)
@given(st.data(), elements(), ORDERS)
def test_batch_equals_stepwise(data, sets, order):
    compensator = Compensator(PiezoModel(*sets, order))
    wanted = data.draw(signals())
    steps_s = data.draw(steps(wanted.size))
    state = compensator.initial_state()
    pairs = zip(wanted.tolist(), steps_s.tolist(), strict=True)
    single = np.array([compensator.advance(state, x, dt) for x, dt in pairs])
    assert relative(compensator.run(steps_s, wanted), single) <= 1e-12
    half = wanted.size // 2
    state = compensator.initial_state()
    parts = [compensator.run(steps_s[p], wanted[p], state) for p in (slice(0, half), slice(half, None))]
    assert relative(np.concatenate(parts), single) <= 1e-12


def test_saved_state_goes_on():
    compensator = Compensator(MODEL.with_effects(AsymmetricHysteresis((0.1,), (0.2,), (0.05,))))
    wanted, steps_s = np.sin(np.arange(200) / 9.0), np.full(200, 1e-3)
    state = compensator.initial_state()
    compensator.run(steps_s[:90], wanted[:90], state)
    restored = ModelState.from_mapping(json.loads(json.dumps(state.to_mapping())))
    onward = compensator.run(steps_s[90:], wanted[90:], state)
    assert np.array_equal(compensator.run(steps_s[90:], wanted[90:], restored), onward)


@pytest.mark.parametrize(
    "effect",
    [
        DeadZone(half_width_v=0.05),
        SlowRelaxation(amplitude=0.05, time_constant_s=0.3),
        CrossAxis(gain=0.07),
        ThermalDrift(um_per_c=0.02),
        MissingHysteresis(n_elements=5.0, thresholds_v=(0.05, 0.4), weights_um_per_v=(0.1, 0.2)),
        AsymmetricHysteresis((0.0, 0.2, 0.3), (0.1, -0.2, 0.4), (0.08, -0.05, 0.1)),
    ],
    ids=lambda effect: effect.name,
)
@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_extended_inverse(effect, jitter):
    model = MODEL.with_effects(effect)
    rng = np.random.default_rng(4)
    n = 3000
    # so slow that no step is divided: then both directions see the same samples
    wanted = 1.5 * np.sin(np.arange(n) / 250.0) + 0.02 * np.cumsum(rng.standard_normal(n)) / np.sqrt(n)
    steps_s = 1e-3 * (1.0 + jitter * rng.uniform(-1.0, 1.0, n))
    outside = {"temperature_c": 20.0 + np.arange(n) / 100.0, "cross": np.cos(np.arange(n) / 900.0)}
    compensator = Compensator(model)
    assert compensator.not_inverted == ()
    error = np.abs(model.simulate(steps_s, compensator.run(steps_s, wanted, **outside), **outside) - wanted)
    if isinstance(effect, DeadZone):
        # the drive jumps across the band, which takes the actuator one sample of its own linear drive
        error = error[np.abs(wanted) > 0.5]
        assert np.max(error) <= 1e-4
        return
    assert np.max(error[5:]) <= 1e-11


def test_bandwidth_inverse_halves_and_more_the_lag():
    # the backward difference is first order: a smooth target well below the cutoff is followed closely
    effect = AmplifierBandwidth(cutoff_hz=50.0)
    model = MODEL.with_effects(effect)
    wanted, steps_s = np.sin(2 * np.pi * 2.0 * np.arange(2000) * 1e-3), np.full(2000, 1e-3)
    with_it = model.simulate(steps_s, Compensator(model).run(steps_s, wanted))
    without = model.simulate(steps_s, Compensator(MODEL).run(steps_s, wanted))
    assert np.max(np.abs(with_it - wanted)) < 0.2 * np.max(np.abs(without - wanted))


def test_what_is_not_inverted_is_named_with_its_reason():
    model = MODEL.with_effects(TransportDelay(delay_s=0.01), SlowRelaxation(0.05, 0.3))
    ((name, reason),) = Compensator(model).not_inverted
    assert name == "transport_delay"
    assert "look" in reason
    for kind in effect_classes().values():
        assert kind.inverse_note


def test_non_monotone_extension_still_ends():
    # a falling branch has no inverse; the search must end and stay finite all the same
    model = MODEL.with_effects(AsymmetricHysteresis((0.0,), (0.1,), (-50.0,)))
    wanted = np.sin(np.arange(100) / 9.0)
    assert np.all(np.isfinite(Compensator(model).run(np.full(100, 1e-3), wanted)))

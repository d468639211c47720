"""Each effect by its own physics, and what all of them have in common."""

from __future__ import annotations

import json

import numpy as np
import pytest
from new_effects import NEW_EFFECTS
from random_models import relative
from scipy.integrate import solve_ivp

from fomrc_core.effects import Stage, effect_classes
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.amplifier_saturation import AmplifierSaturation
from fomrc_core.effects.amplifier_slew_limit import AmplifierSlewLimit
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.clock_skew import ClockSkew
from fomrc_core.effects.cross_axis import CrossAxis
from fomrc_core.effects.dac_quantization import DacQuantization
from fomrc_core.effects.dead_zone import DeadZone
from fomrc_core.effects.external_load import ExternalLoad
from fomrc_core.effects.gain_drift import GainDrift
from fomrc_core.effects.mains_hum import MainsHum
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
from fomrc_core.effects.missing_hysteresis import MissingHysteresis
from fomrc_core.effects.sensor_nonlinearity import SensorNonlinearity
from fomrc_core.effects.slow_relaxation import SlowRelaxation
from fomrc_core.effects.thermal_drift import ThermalDrift
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.errors import InputError
from fomrc_core.model.causes import cause_class
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.state import ModelState

EFFECTS = [
    ClockSkew(ppm=-300.0),
    DacQuantization(step_v=0.01),
    AmplifierSlewLimit(slew_v_per_s=20.0),
    AmplifierBandwidth(cutoff_hz=40.0),
    AmplifierSaturation(low_v=-0.7, high_v=0.9),
    DeadZone(half_width_v=0.03),
    AsymmetricHysteresis((0.0, 0.2), (0.1, -0.3), (0.05, -0.04)),
    MissingHysteresis(5.0, (0.1, 0.4), (0.1, 0.05)),
    SlowRelaxation(amplitude=0.1, time_constant_s=0.05),
    MechanicalResonance(frequency_hz=120.0, damping_ratio=0.05),
    TransportDelay(delay_s=0.0033),
    ExternalLoad(displacement_um=0.2, onset_s=0.0995, release_s=0.2, rise_s=0.004),
    CrossAxis(gain=0.07),
    ThermalDrift(um_per_c=0.02, um_per_s=0.01, um_per_s2=-0.02, um_per_s3=0.003, warm_up_um=-0.1, warm_up_s=0.2),
    GainDrift(per_s=0.01),
    SensorNonlinearity(quadratic_per_um=0.004, cubic_per_um2=-0.003),
    MainsHum(frequency_hz=50.0, amplitude_um=0.01, phase_rad=0.3),
    *NEW_EFFECTS,
]
MODEL = PiezoModel([10.0, 4.0, 7.0, 1.5], [0.02, 0.1, 0.3], 0.02)
IDS = [effect.name for effect in EFFECTS]


def record(jitter: float, n: int = 400):
    rng = np.random.default_rng(17)
    steps_s = 1e-3 * (1.0 + jitter * rng.uniform(-1.0, 1.0, n))
    voltage_v = np.round(np.sin(np.cumsum(steps_s) * 25.0) + 0.1 * np.cumsum(rng.standard_normal(n)) / np.sqrt(n), 3)
    voltage_v[100:120] = voltage_v[100]
    outside = {"temperature_c": 20.0 + np.arange(n) / 100.0, "cross": np.cos(np.arange(n) / 11.0)}
    return steps_s, voltage_v, outside


def one_by_one(runner, state, steps_s, values, outside):
    rows = zip(
        steps_s.tolist(),
        values.tolist(),
        outside["temperature_c"].tolist(),
        outside["cross"].tolist(),
        strict=True,
    )
    return np.array([runner.advance(state, v, dt, temperature_c=t, cross=c) for dt, v, t, c in rows])


def test_every_effect_is_tried_here():
    assert {effect.name for effect in EFFECTS} == set(effect_classes())


@pytest.mark.parametrize("effect", EFFECTS, ids=IDS)
@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_batch_equals_stepwise_and_chunks(effect, jitter):
    steps_s, voltage_v, outside = record(jitter)
    model = MODEL.with_effects(effect)
    whole = model.simulate(steps_s, voltage_v, **outside)
    assert relative(one_by_one(model, model.initial_state(), steps_s, voltage_v, outside), whole) <= 1e-12
    state, parts = model.initial_state(), []
    for part in (slice(0, 1), slice(1, 133), slice(133, None)):
        parts.append(model.simulate(steps_s[part], voltage_v[part], state, **{k: v[part] for k, v in outside.items()}))
    assert relative(np.concatenate(parts), whole) <= 1e-12


@pytest.mark.parametrize("effect", EFFECTS, ids=IDS)
def test_effect_changes_the_response(effect):
    steps_s, voltage_v, outside = record(0.0)
    plain = MODEL.simulate(steps_s, voltage_v)
    assert relative(MODEL.with_effects(effect).simulate(steps_s, voltage_v, **outside), plain) > 1e-4


@pytest.mark.parametrize("effect", [e for e in EFFECTS if e.can_invert], ids=lambda e: e.name)
@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_inverse_batch_equals_stepwise(effect, jitter):
    steps_s, wanted, outside = record(jitter)
    compensator = Compensator(MODEL.with_effects(effect))
    whole = compensator.run(steps_s, wanted, **outside)
    assert relative(one_by_one(compensator, compensator.initial_state(), steps_s, wanted, outside), whole) <= 1e-12


def all_effects_model():
    return MODEL.with_effects(*(e for e in EFFECTS if e.name != "clock_skew"))


@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_all_effects_together_batch_equals_stepwise(jitter):
    steps_s, voltage_v, outside = record(jitter)
    model = all_effects_model()
    whole = model.simulate(steps_s, voltage_v, **outside)
    assert relative(one_by_one(model, model.initial_state(), steps_s, voltage_v, outside), whole) <= 1e-12


@pytest.mark.parametrize("effect", EFFECTS, ids=IDS)
def test_saved_state_goes_on(effect):
    steps_s, voltage_v, outside = record(0.3)
    model = MODEL.with_effects(effect)
    state = model.initial_state()
    model.simulate(steps_s[:150], voltage_v[:150], state, **{k: v[:150] for k, v in outside.items()})
    restored = ModelState.from_mapping(json.loads(json.dumps(state.to_mapping())))
    rest = {k: v[150:] for k, v in outside.items()}
    onward = model.simulate(steps_s[150:], voltage_v[150:], state, **rest)
    assert np.array_equal(model.simulate(steps_s[150:], voltage_v[150:], restored, **rest), onward)


@pytest.mark.parametrize("effect", EFFECTS, ids=IDS)
def test_mapping_round_trip(effect):
    back = effect_classes()[effect.name].from_mapping(json.loads(json.dumps(effect.to_mapping())), "here")
    assert back == effect


@pytest.mark.parametrize("effect", EFFECTS, ids=IDS)
def test_state_is_of_fixed_size(effect):
    steps_s, voltage_v, outside = record(0.0)
    model = MODEL.with_effects(effect)
    state = model.initial_state()
    before = {name: values.shape for name, values in state.effects.items()}
    model.simulate(steps_s, voltage_v, state, **outside)
    assert {name: values.shape for name, values in state.effects.items()} == before


@pytest.mark.parametrize("kind", effect_classes().values(), ids=list(effect_classes()))
def test_every_effect_describes_itself(kind):
    assert kind.main_parameter in {p.name for p in kind.parameters}
    assert set(kind.linear_parameters) <= {p.name for p in kind.parameters}
    for text in (kind.meaning, kind.signature, kind.experiment, kind.inverse_note):
        assert len(text) > 10
    assert isinstance(kind.order, float)
    assert isinstance(kind.stage, Stage)
    for parameter in kind.parameters:
        assert parameter.lower < parameter.upper
        assert parameter.description


# --- their own physics ---------------------------------------------------------------------------------------------


def drive_and_time(jitter: float):
    rng = np.random.default_rng(23)
    steps_s = 2e-3 * (1.0 + jitter * rng.uniform(-1.0, 1.0, 120))
    return steps_s, np.cumsum(steps_s), rng.standard_normal(120)


def ode(rhs, y0, t, values):
    """Integrate segment by segment, so that the corners of the linear drive fall on ends of the integration."""
    y, before_t, before, out = np.array(y0, dtype=float), 0.0, 0.0, []
    for now_t, now in zip(t, values, strict=True):
        slope = (now - before) / (now_t - before_t)
        solved = solve_ivp(
            lambda s, y, b=before, bt=before_t, m=slope: rhs(y, b + m * (s - bt)),
            (before_t, now_t),
            y,
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
        )
        y = solved.y[:, -1]
        out.append(y[0])
        before_t, before = now_t, now
    return np.array(out)


@pytest.mark.parametrize("jitter", [0.0, 0.5])
@pytest.mark.parametrize("cutoff_hz", [3.0, 400.0])
def test_bandwidth_is_a_first_order_lag(jitter, cutoff_hz):
    steps_s, t, values = drive_and_time(jitter)
    effect = AmplifierBandwidth(cutoff_hz=cutoff_hz)
    exact = ode(lambda y, u: (u - y) * 2 * np.pi * cutoff_hz, [0.0], t, values)
    assert relative(effect.run(effect.initial_state(), values, steps_s), exact) <= 1e-9


def test_bandwidth_attenuates_by_the_root_of_two_at_its_cutoff():
    effect = AmplifierBandwidth(cutoff_hz=10.0)
    steps_s = np.full(20_000, 1e-4)
    t = np.cumsum(steps_s)
    out = effect.run(effect.initial_state(), np.sin(2 * np.pi * 10.0 * t), steps_s)[10_000:]
    assert np.sqrt(2 * np.mean(out**2)) == pytest.approx(1 / np.sqrt(2), rel=1e-4)


@pytest.mark.parametrize("jitter", [0.0, 0.5])
@pytest.mark.parametrize(("frequency_hz", "damping"), [(5.0, 0.001), (90.0, 0.03), (300.0, 0.9)])
def test_resonance_is_a_mass_on_a_spring(jitter, frequency_hz, damping):
    steps_s, t, values = drive_and_time(jitter)
    w = 2 * np.pi * frequency_hz
    effect = MechanicalResonance(frequency_hz=frequency_hz, damping_ratio=damping)
    exact = ode(lambda y, u: (y[1], w * w * (u - y[0]) - 2 * damping * w * y[1]), [0.0, 0.0], t, values)
    assert relative(effect.run(effect.initial_state(), values, steps_s), exact) <= 1e-8


@pytest.mark.parametrize("jitter", [0.0, 0.5])
@pytest.mark.parametrize("time_constant_s", [1e-3, 0.05, 1e5])
def test_relaxation_is_a_lagging_share_and_its_inverse_is_exact(jitter, time_constant_s):
    steps_s, t, values = drive_and_time(jitter)
    effect = SlowRelaxation(amplitude=0.4, time_constant_s=time_constant_s)
    exact = values + 0.4 * ode(lambda y, u: (u - y) / time_constant_s, [0.0], t, values)
    out = effect.run(effect.initial_state(), values, steps_s)
    assert relative(out, exact) <= 1e-9
    assert relative(effect.invert(effect.initial_state(), out, steps_s), values) <= 1e-12


@pytest.mark.parametrize("jitter", [0.0, 0.5])
@pytest.mark.parametrize("delay_s", [0.0, 1e-4, 0.002, 0.0053, 0.1])
def test_delay_reads_the_linear_past(jitter, delay_s):
    steps_s, t, values = drive_and_time(jitter)
    effect = TransportDelay(delay_s=delay_s)
    exact = np.interp(t - delay_s, np.concatenate(([0.0], t)), np.concatenate(([0.0], values)))
    assert relative(effect.run(effect.initial_state(), values, steps_s), exact) <= 1e-12


def test_a_delay_longer_than_the_delay_line_is_refused_from_call_to_call_and_runs_in_one():
    effect = TransportDelay(delay_s=0.05)
    steps_s, values = np.full(10_000, 1e-5), np.arange(10_000.0)
    state = effect.initial_state()
    found = effect.run(state, values, steps_s)
    np.testing.assert_allclose(found[6000:], values[6000:] - 5000.0, atol=1e-6)
    with pytest.raises(InputError, match="delay_s"):
        effect.run(state, values[:10], steps_s[:10])
    # just within its length, and long after it has wrapped around
    effect, values = TransportDelay(delay_s=0.0409), np.sin(np.arange(30_000) / 500.0)
    steps_s = np.full(30_000, 1e-5)
    t = np.cumsum(steps_s)
    exact = np.interp(t - 0.0409, np.concatenate(([0.0], t)), np.concatenate(([0.0], values)))
    assert relative(effect.run(effect.initial_state(), values, steps_s), exact) <= 1e-9


def test_slew_limit_follows_at_its_rate():
    effect = AmplifierSlewLimit(slew_v_per_s=10.0)
    steps_s = np.full(30, 0.01)
    values = np.concatenate((np.full(15, 1.0), np.full(15, 0.95)))
    out = effect.run(effect.initial_state(), values, steps_s)
    assert out == pytest.approx(np.concatenate((np.minimum(0.1 * np.arange(1, 16), 1.0), np.full(15, 0.95))))


def test_saturation_and_dead_zone_by_hand():
    values = np.array([-2.0, -0.5, -0.01, 0.0, 0.02, 0.5, 2.0])
    steps_s = np.ones(7)
    rails = AmplifierSaturation(low_v=-1.0, high_v=0.4)
    assert rails.run(rails.initial_state(), values, steps_s).tolist() == [
        -1.0,
        -0.5,
        -0.01,
        0.0,
        0.02,
        0.4,
        0.4,
    ]
    zone = DeadZone(half_width_v=0.1)
    passed = zone.run(zone.initial_state(), values, steps_s)
    assert passed == pytest.approx([-1.9, -0.4, 0.0, 0.0, 0.0, 0.4, 1.9])
    back = zone.invert(zone.initial_state(), passed, steps_s)
    assert back[[0, 1, 5, 6]] == pytest.approx(values[[0, 1, 5, 6]])


def test_quantization_rounds_to_the_step():
    effect = DacQuantization(step_v=0.25)
    out = effect.run(effect.initial_state(), np.array([0.1, 0.13, 0.37, -0.38, 1.0]), np.ones(5))
    assert out == pytest.approx([0.0, 0.25, 0.25, -0.5, 1.0])


@pytest.mark.parametrize("ppm", [-2000.0, 2000.0])
def test_skew_reads_the_drive_at_the_other_clock(ppm):
    effect = ClockSkew(ppm=ppm)
    steps_s = np.full(1000, 1e-3)
    t = np.arange(1000) * 1e-3
    out = effect.run(effect.initial_state(), 3.0 * t, steps_s)
    assert out == pytest.approx(3.0 * t * (1.0 + 1e-6 * ppm), abs=1e-12)


def test_drifts_and_hum_run_on_the_clock_of_the_record():
    steps_s = np.full(100, 0.01)
    t = np.arange(100) * 0.01  # the record's first sample is at time zero
    x = np.cos(t)
    for effect, wanted in (
        (GainDrift(per_s=0.1), x * (1 + 0.1 * t)),
        (ThermalDrift(um_per_s=1.0, um_per_s2=2.0, um_per_s3=3.0), x + t + 2 * t**2 + 3 * t**3),
        (ThermalDrift(warm_up_um=2.0, warm_up_s=0.3), x + 2.0 * (1.0 - np.exp(-t / 0.3))),
        (
            MainsHum(frequency_hz=50.0, amplitude_um=0.1, phase_rad=0.4),
            x + 0.1 * np.sin(100 * np.pi * t + 0.4),
        ),
        (SensorNonlinearity(quadratic_per_um=0.1, cubic_per_um2=0.2), x + 0.1 * x**2 + 0.2 * x**3),
    ):
        assert relative(effect.run(effect.initial_state(), x, steps_s), wanted) <= 1e-12
    load = ExternalLoad(displacement_um=0.5, onset_s=0.255, release_s=0.505)
    assert relative(load.run(load.initial_state(), x, steps_s), x + 0.5 * ((t > 0.255) & (t < 0.505))) <= 1e-15
    slow = ExternalLoad(displacement_um=0.5, onset_s=0.255, release_s=0.505, rise_s=0.05)
    come = np.where(t > 0.255, 1.0 - np.exp(-(t - 0.255) / 0.05), 0.0)
    gone = np.where(t > 0.505, 1.0 - np.exp(-(t - 0.505) / 0.05), 0.0)
    assert relative(slow.run(slow.initial_state(), x, steps_s), x + 0.5 * (come - gone)) <= 1e-12


def test_covariates_add_their_share():
    steps_s, x = np.ones(4), np.zeros(4)
    temperature, cross = np.array([20.0, 21.0, 22.0, 19.0]), np.array([1.0, 2.0, 3.0, 4.0])
    drift = ThermalDrift(um_per_c=0.5)
    assert drift.run(drift.initial_state(), x, steps_s, temperature) == pytest.approx([0.0, 0.5, 1.0, -0.5])
    leak = CrossAxis(gain=0.1)
    assert leak.run(leak.initial_state(), x, steps_s, cross) == pytest.approx(0.1 * cross)
    assert leak.run(leak.initial_state(), x, steps_s).tolist() == [0.0] * 4


def test_knees_and_added_plays_by_their_law():
    rng = np.random.default_rng(31)
    values = 2.0 * rng.standard_normal(300)
    thresholds, knees, weights = (0.0, 0.5, 1.0), (0.3, -0.4, 0.1), (0.2, -0.1, 0.3)

    def play(threshold):
        state, out = 0.0, []
        for u in values:
            state = np.clip(state, u - threshold, u + threshold)
            out.append(state)
        return np.array(out)

    bent = sum(w * (np.maximum(play(r), k) - max(0.0, k)) for r, k, w in zip(thresholds, knees, weights, strict=True))
    effect = AsymmetricHysteresis(thresholds, knees, weights)
    assert relative(effect.run(effect.initial_state(), values, np.ones(300)), bent) <= 1e-13
    plain = sum(w * play(r) for r, w in zip(thresholds, weights, strict=True))
    effect = MissingHysteresis(3.0, thresholds, weights)
    assert relative(effect.run(effect.initial_state(), values, np.ones(300)), plain) <= 1e-13


# --- bad input -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("effect", EFFECTS, ids=IDS)
def test_bad_parameters_are_named(effect):
    for parameter in effect.parameters:
        bad_values = [
            "a",
            None,
            True,
            float("nan"),
            float("inf"),
            parameter.upper * 2.0 + 1.0,
            parameter.lower - abs(parameter.lower) - 1.0,
        ]
        for bad in bad_values:
            mapping = {**effect.to_mapping(), parameter.name: [bad] if parameter.is_list else bad}
            with pytest.raises(InputError) as caught:
                type(effect).from_mapping(mapping, "model.x")
            line = str(caught.value)
            assert parameter.name in line
            assert "allowed" in line
            assert "\n" not in line
        if parameter.is_list:
            with pytest.raises(InputError, match=parameter.name):
                type(effect).from_mapping({**effect.to_mapping(), parameter.name: 0.1}, "model.x")
    with pytest.raises(InputError, match="nonsense"):
        type(effect).from_mapping({**effect.to_mapping(), "nonsense": 1.0}, "model.x")
    with pytest.raises(InputError, match=r"model\.x"):
        type(effect).from_mapping(7, "model.x")


def test_contradictions_are_named():
    with pytest.raises(InputError, match="low_v"):
        AmplifierSaturation(low_v=1.0, high_v=1.0)
    with pytest.raises(InputError, match="length"):
        AsymmetricHysteresis((0.1,), (0.1, 0.2), (0.1,))
    with pytest.raises(InputError, match="length"):
        MissingHysteresis(1.0, (0.1,), ())
    with pytest.raises(InputError, match="unknown effect"):
        cause_class("nonsense", "model.effects")
    effect = TransportDelay(0.1)
    with pytest.raises(InputError, match="no inverse"):
        effect.invert(effect.initial_state(), np.ones(2), np.ones(2))
    with pytest.raises(InputError, match="twice"):
        PiezoModel([2.0, 1.0], [0.1], 0.01, (GainDrift(0.1), GainDrift(0.2)))

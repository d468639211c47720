"""A target known as a whole: the stage of code of its own follows it, dynamics and all."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.fast_scans import (
    CREEP_ORDER,
    STEP_S,
    acceleration_limited_step,
    band_limited_course,
    band_limited_um,
    endless_scan,
    model,
    raster_um,
    target_of,
    truth,
)
from fomrc_core.errors import ParameterError
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.dynamic_inverse import DynamicInverse
from fomrc_core.model.known_target import known_target
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.waveform import WaveformLimits
from test.core.small_model import MODEL


def extended(**effects: dict[str, Any]) -> PiezoModel:
    return PiezoModel.from_mapping(MODEL | {"effects": list(effects)} | effects)


def test_a_course_of_half_the_resonance_is_followed_to_a_thousandth_of_a_per_cent() -> None:
    found = band_limited_course()
    print(f"dynamic {found.by_model:.2g} %, on the truth {found.on_truth:.2g} %; static {found.static:.3g} %")
    assert found.by_model <= 1e-3
    assert found.on_truth <= 1e-3
    assert found.static > 10.0


def test_the_truth_is_the_model_in_other_code() -> None:
    # what the figures on the truth are worth: both do the same with a voltage no inverse has made
    voltage_v = band_limited_um(4000, 5, range_um=3.0)
    by_model = model().simulate(np.full(4000, STEP_S), voltage_v)
    assert np.max(np.abs(truth().displacement_um(STEP_S, voltage_v) - by_model)) < 1e-5 * np.ptp(by_model)


def test_a_step_within_few_swings_arrives_without_ringing_and_as_predicted() -> None:
    found = acceleration_limited_step()
    assert found.ringing <= 0.1
    assert found.static_ringing > 0.5
    assert abs(found.predicted_s - found.arrived_s) <= max(2e-3, 0.05 * found.arrived_s)
    assert found.predicted_s < 0.02


def test_an_endless_scan_stays_as_it_was_in_its_second_period() -> None:
    found = endless_scan()
    assert found.hundredth == pytest.approx(found.second, rel=0.1)
    assert found.static > 3.0 * found.second


@pytest.mark.parametrize("middle_um", [0.0, 2.0])
def test_the_end_of_a_periodic_voltage_meets_its_start(middle_um: float) -> None:
    found = DynamicInverse(model()).run(target_of(raster_um(20.0, 4.0) + middle_um, is_periodic=True))
    inside = np.abs(np.diff(found.voltage_v))
    assert abs(found.voltage_v[0] - found.voltage_v[-1]) <= np.max(inside)
    # Creep carries the middle on with the logarithm of time; the fourteenth period is the one that is met.
    played = model().simulate(np.full(50_000, STEP_S), np.tile(found.voltage_v, 100)).reshape(100, -1)
    off_um = np.mean(played - found.target.desired_um, axis=1)
    assert abs(off_um[13]) < 1e-4
    assert abs(off_um[99]) <= 1.2 * CREEP_ORDER * np.log(100.0 / 14.0) * middle_um + 5e-4


@settings(max_examples=25, deadline=None)
@given(
    amplifier_hz=st.floats(200.0, 3000.0),
    resonance_hz=st.floats(200.0, 1500.0),
    damping=st.floats(0.005, 0.7),
    delay_s=st.floats(0.0, 3e-3),
    seed=st.integers(0, 100),
)
def test_what_the_model_gives_is_the_target_whatever_its_dynamics(
    amplifier_hz: float, resonance_hz: float, damping: float, delay_s: float, seed: int
) -> None:
    known = extended(
        amplifier_bandwidth={"cutoff_hz": amplifier_hz},
        mechanical_resonance={"frequency_hz": resonance_hz, "damping_ratio": damping},
        transport_delay={"delay_s": delay_s},
    )
    desired_um = band_limited_um(3000, seed, highest_hz=100.0)
    found = DynamicInverse(known).run(target_of(desired_um))
    again_um = known.simulate(np.full(3000, STEP_S), found.voltage_v)
    assert np.array_equal(again_um, found.reached_um)
    assert found.error_percent < 0.01


@pytest.mark.parametrize(
    ("effects", "bar_percent"),
    [
        ({"drive_resonance": {"frequency_hz": 700.0, "damping_ratio": 0.4}}, 1e-2),
        ({"second_mode": {"frequency_hz": 260.0, "damping_ratio": 0.05, "participation": 0.2}}, 1e-2),
        ({"slow_relaxation": {"amplitude": 0.1, "time_constant_s": 0.02}}, 1e-2),
        ({"zero_order_hold": {"hold_s": STEP_S}}, 1e-2),
        ({"zero_order_hold": {"hold_s": 5.0 * STEP_S, "per_sample": 1.0}}, 1e-2),  # told at a fifth of this rate
        ({"unequal_lag": {"rising_s": 4e-4, "falling_s": 2e-4}}, 2e-2),
        ({"voltage_dependent_capacitance": {"time_constant_s": 4e-4, "per_v": 0.1}}, 1e-2),
        ({"rate_dependent_hysteresis": {"per_v_per_s": 1e-4}}, 2e-2),
        ({"asymmetric_hysteresis": {"weights_um_per_v": [0.1], "thresholds_v": [0.3], "knees_v": [0.2]}}, 2e-2),
    ],
)
def test_other_dynamics_are_undone_beside_a_resonance(effects: dict[str, Any], bar_percent: float) -> None:
    ringing = {"mechanical_resonance": {"frequency_hz": 400.0, "damping_ratio": 0.03}}
    known = extended(**ringing, **effects)
    desired_um = band_limited_um(4000, 2, highest_hz=120.0)
    found = DynamicInverse(known).run(target_of(desired_um))
    assert not found.not_inverted
    off_um = np.abs(known.simulate(np.full(4000, STEP_S), found.voltage_v) - desired_um)[300:-300]
    assert 100.0 * np.max(off_um) / np.ptp(desired_um) < bar_percent


def test_each_round_of_the_search_is_nearer() -> None:
    found = DynamicInverse(model()).run(target_of(band_limited_um(4000, 1)))
    assert found.errors_um[1] < 0.1 * found.errors_um[0]
    assert np.all(np.diff(found.errors_um[:-1]) < 0.0)


def test_a_reading_that_lags_is_left_as_it_is_and_named() -> None:
    lagging = replace(model(), effects=(*model().effects, *extended(sensor_bandwidth={"cutoff_hz": 300.0}).effects))
    desired_um = band_limited_um(2000, 1)
    found = DynamicInverse(lagging).run(target_of(desired_um))
    assert [name for name, _ in found.not_inverted] == ["sensor_bandwidth"]
    np.testing.assert_array_equal(found.voltage_v, DynamicInverse(model()).run(target_of(desired_um)).voltage_v)


def test_a_model_without_dynamics_needs_no_future_and_gets_the_voltage_of_the_compensator() -> None:
    plain = PiezoModel.from_mapping(MODEL)
    assert not DynamicInverse(plain).is_needed
    assert DynamicInverse(model()).is_needed
    desired_um = band_limited_um(2000, 1)
    found = DynamicInverse(plain).run(target_of(desired_um))
    np.testing.assert_allclose(found.voltage_v, Compensator(plain).run(np.full(2000, STEP_S), desired_um), atol=1e-12)


def test_a_resonance_near_the_sample_rate_is_told() -> None:
    desired_um = band_limited_um(3000, 1, highest_hz=20.0)
    coarse = known_target(STEP_S * np.arange(3000), desired_um, rate_hz=750.0)
    notes = DynamicInverse(model()).run(coarse).notes
    assert len(notes) == 1
    assert "rings at 300 Hz, near the sample rate of 750 Hz" in notes[0]
    assert DynamicInverse(model()).run(target_of(desired_um)).notes == ()


def test_a_target_that_leaves_before_the_stage_can_is_told() -> None:
    course_um = band_limited_um(3000, 1)
    assert DynamicInverse(model()).run(target_of(course_um)).notes == ()
    (note,) = DynamicInverse(model()).run(target_of(course_um + 1.0)).notes
    assert "begins 1 um from the relaxed stage" in note


def test_the_first_sample_beyond_a_limit_is_named() -> None:
    found = DynamicInverse(model()).run(target_of(raster_um(20.0, 4.0), is_periodic=True))
    found.require_within(WaveformLimits(-10.0, 10.0, 1e6))
    bound_v = 0.9 * float(np.max(found.voltage_v))
    first = int(np.argmax(found.voltage_v > bound_v))
    with pytest.raises(ParameterError, match=f"sample {first} .*asks for more than the limit"):
        found.require_within(WaveformLimits(maximum_v=bound_v))
    rate = 0.9 * found.largest_rate_v_per_s
    first = int(np.argmax(np.abs(found.rates_v_per_s) > rate))
    with pytest.raises(ParameterError, match=f"rate of voltage_v: sample {first} "):
        found.require_within(WaveformLimits(rate_v_per_s=rate))
    assert found.largest_current_a(1e-6) == pytest.approx(1e-6 * found.largest_rate_v_per_s)


def test_a_voltage_far_beyond_slow_motion_is_refused_unless_it_is_allowed() -> None:
    # a sine of nine times the mass's square of frequency
    since_s = STEP_S * np.arange(1000)
    swing = DynamicInverse(model()).run(target_of(np.sin(2.0 * np.pi * 900.0 * since_s), is_periodic=True))
    with pytest.raises(ParameterError, match=r"times the .* V of slow motion"):
        swing.require_within(WaveformLimits())
    swing.require_within(WaveformLimits(-1e3, 1e3))


@pytest.mark.parametrize(
    ("limits", "word"),
    [((1.0, -1.0, 1.0), "maximum_v"), ((np.nan, 1.0, 1.0), "maximum_v"), ((-1.0, 1.0, 0.0), "rate_v_per_s")],
)
def test_limits_that_leave_nothing_are_refused(limits: tuple[float, float, float], word: str) -> None:
    with pytest.raises(ParameterError, match=word):
        WaveformLimits(*limits)

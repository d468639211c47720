"""Excitations: the shapes the paper names, and that the relaxation routine relaxes."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fomrc_core.errors import InputError, ParameterError, RecordingError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.plants.paper_stage import CREEP_ORDER, KAPPA_UM_PER_V, SATURATION_V
from fomrc_core.records import excitation
from fomrc_core.records.excitation import Excitation, concatenate, multisine, relaxation, staircase, steps, triangle

_ALL = [relaxation, triangle, staircase, steps, multisine]
_amplitudes = st.floats(0.3, 10.0)


def _turning_values(voltage_v: np.ndarray) -> np.ndarray:
    """Values at which the drive turns; level stretches count once."""
    moved = voltage_v[np.concatenate(([True], np.diff(voltage_v) != 0.0))]
    direction = np.sign(np.diff(moved))
    return moved[1:-1][direction[1:] != direction[:-1]]


@pytest.mark.parametrize("make", _ALL)
def test_defaults_are_the_papers_range_and_rate(make: Any) -> None:
    drive = make()
    assert np.max(np.abs(drive.voltage_v)) == pytest.approx(2.5)
    np.testing.assert_allclose(np.diff(drive.time_s), 1e-3, rtol=1e-6)
    assert drive.time_s[0] == 0.0
    assert drive.name == make.__name__
    assert drive.to_recording().n_samples == drive.n_samples


@pytest.mark.parametrize("make", _ALL)
def test_an_offset_moves_the_whole_signal(make: Any) -> None:
    options = {"dwell_s": 0.1} if make in (steps, staircase) else {}
    np.testing.assert_allclose(make(offset_v=50.0, **options).voltage_v - 50.0, make(**options).voltage_v, atol=1e-12)


def test_excitations_are_frozen_and_checked() -> None:
    drive = Excitation(np.arange(3.0), np.zeros(3), "rest")
    assert drive.duration_s == 2.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        drive.name = "other"  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        drive.voltage_v[0] = 1.0
    with pytest.raises(RecordingError, match="does not increase"):
        Excitation(np.zeros(3), np.zeros(3), "broken")


# Relaxation routine, (27) and (28).


@settings(deadline=None)
@given(
    amplitude_v=_amplitudes,
    frequency_hz=st.floats(1.0, 20.0),
    duration_s=st.floats(2.0, 20.0),
    corner_ratio=st.floats(0.02, 0.5),
    final_ratio=st.floats(1e-6, 1e-2),
)
def test_relaxation_falls_linearly_then_exponentially_without_a_kink(
    amplitude_v: float, frequency_hz: float, duration_s: float, corner_ratio: float, final_ratio: float
) -> None:
    drive = relaxation(
        amplitude_v,
        frequency_hz=frequency_hz,
        duration_s=duration_s,
        corner_ratio=corner_ratio,
        final_ratio=final_ratio,
        rate_hz=2000.0,
    )
    sine = np.sin(2.0 * np.pi * frequency_hz * drive.time_s - 0.5 * np.pi)
    is_clear = (np.abs(sine) > 0.5) & (drive.time_s < duration_s)
    time_s, envelope_v = drive.time_s[is_clear], (drive.voltage_v[is_clear] / sine[is_clear])
    assert drive.voltage_v[0] == pytest.approx(-amplitude_v)
    is_linear = envelope_v > corner_ratio * amplitude_v
    # a short exponential part may lie between two swings of the sine: then there is nothing to see of it
    assume(min(np.count_nonzero(is_linear), np.count_nonzero(~is_linear)) > 10)
    linear = np.polynomial.Polynomial.fit(time_s[is_linear], envelope_v[is_linear], 1).convert()
    np.testing.assert_allclose(envelope_v[is_linear], linear(time_s[is_linear]), atol=1e-9 * amplitude_v)
    logarithm = np.polynomial.Polynomial.fit(time_s[~is_linear], np.log(envelope_v[~is_linear]), 1).convert()
    np.testing.assert_allclose(np.log(envelope_v[~is_linear]), logarithm(time_s[~is_linear]), atol=1e-6)
    # Below (28): k_1 = k_2 a(t_1), the slope does not jump.
    k_1, k_2 = -linear.coef[1], -logarithm.coef[1]
    assert k_1 == pytest.approx(k_2 * corner_ratio * amplitude_v, rel=1e-6)
    assert math.exp(logarithm(duration_s)) == pytest.approx(final_ratio * amplitude_v, rel=1e-6)


@settings(deadline=None)
@given(amplitude_v=_amplitudes, frequency_hz=st.floats(0.5, 40.0), rest_s=st.floats(0.0, 1.0))
def test_relaxation_ends_at_rest_without_a_jump(amplitude_v: float, frequency_hz: float, rest_s: float) -> None:
    drive = relaxation(amplitude_v, frequency_hz=frequency_hz, duration_s=5.0, rest_s=rest_s)
    assert drive.voltage_v[-1] == 0.0
    assert 5.0 <= drive.duration_s <= 5.0 + 0.5 / frequency_hz + rest_s + 2e-3
    largest_step_v = 2e-4 * amplitude_v * 2.0 * math.pi * frequency_hz * 2e-3
    assert np.max(np.abs(np.diff(drive.voltage_v[-20:]))) <= largest_step_v


def _random_state_model(seed: int) -> tuple[PiezoModel, Any, np.ndarray]:
    """The paper's actuator after an hour of unknown use, and what it was driven with."""
    model = PiezoModel(KAPPA_UM_PER_V, SATURATION_V, CREEP_ORDER)
    random = np.random.default_rng(seed)
    past_v = np.append(random.uniform(-2.5, 2.5, 40), 0.0)
    state = model.initial_state()
    model.simulate(np.full(past_v.size, 5.0), past_v, state)
    return model, state, past_v


@pytest.mark.parametrize("seed", range(3))
def test_relaxation_removes_drift_and_remanence_as_in_figures_7_and_8(seed: int) -> None:
    model, used, _ = _random_state_model(seed)
    rest_s, rest_v = np.full(60, 1.0), np.zeros(60)
    relaxed = used.copy()
    routine = relaxation()
    model.simulate(np.full(routine.n_samples, 1e-3), routine.voltage_v, relaxed)
    without_um = model.simulate(rest_s, rest_v, used)
    with_um = model.simulate(rest_s, rest_v, relaxed)
    # Figure 7: displacement under zero input; figure 8: the loop begins at the origin.
    assert abs(with_um[-1] - with_um[0]) < 0.5 * abs(without_um[-1] - without_um[0])
    assert abs(with_um[-1]) < 0.1 * abs(without_um[-1])


def test_more_cycles_leave_less_memory() -> None:
    left_um = []
    for duration_s in (1.0, 4.0, 16.0):
        model, state, _ = _random_state_model(7)
        drive = relaxation(duration_s=duration_s)
        model.simulate(np.full(drive.n_samples, 1e-3), drive.voltage_v, state)
        left_um.append(abs(model.advance(state, 0.0, 1.0)))
    assert left_um[0] > left_um[1] > left_um[2]


# Triangle and staircase of decreasing amplitude, figure 9.


@given(amplitude_v=_amplitudes, slope=st.floats(0.5, 50.0), n_cycles=st.integers(1, 6), is_unipolar=st.booleans())
def test_triangle_keeps_its_slope_and_loses_amplitude(
    amplitude_v: float, slope: float, n_cycles: int, is_unipolar: bool
) -> None:
    drive = triangle(
        amplitude_v, slope_v_per_s=slope, n_cycles=n_cycles, is_unipolar=is_unipolar, rate_hz=400.0 * slope
    )
    moved_v = np.abs(np.diff(drive.voltage_v))
    step_v = 1.0 / 400.0
    assert np.max(moved_v) <= step_v * (1.0 + 1e-6)
    # Every step but those across a turning point is the whole slope.
    assert np.count_nonzero(moved_v < step_v * (1.0 - 1e-6)) <= 2 * n_cycles + 2
    turns_v = _turning_values(drive.voltage_v)
    highs, lows = turns_v[turns_v > 0.25 * step_v], turns_v[turns_v < -step_v]
    expected = amplitude_v * (1.0 - np.arange(n_cycles) / n_cycles)
    np.testing.assert_allclose(np.sort(highs[highs > step_v])[::-1], expected, atol=step_v)
    if is_unipolar:
        assert np.min(drive.voltage_v) >= -1e-12
    else:
        np.testing.assert_allclose(lows, -expected, atol=step_v)
    assert drive.voltage_v[0] == drive.voltage_v[-1] == 0.0


@given(
    step_v=st.floats(0.05, 1.0),
    n_steps=st.integers(1, 12),
    n_cycles=st.integers(1, 4),
    is_unipolar=st.booleans(),
)
def test_staircase_moves_by_single_steps_and_holds_each(
    step_v: float, n_steps: int, n_cycles: int, is_unipolar: bool
) -> None:
    drive = staircase(
        n_steps * step_v,
        step_v=step_v,
        dwell_s=0.05,
        n_cycles=n_cycles,
        is_unipolar=is_unipolar,
        rate_hz=200.0,
    )
    assert drive.n_samples % 10 == 0
    levels_v = drive.voltage_v.reshape(-1, 10)
    np.testing.assert_array_equal(levels_v, np.repeat(levels_v[:, :1], 10, axis=1))
    np.testing.assert_allclose(np.abs(np.diff(levels_v[:, 0])), step_v, rtol=1e-9)
    assert np.max(drive.voltage_v) == pytest.approx(n_steps * step_v)
    assert np.min(drive.voltage_v) == pytest.approx(0.0 if is_unipolar else -n_steps * step_v)
    assert drive.voltage_v[0] == drive.voltage_v[-1] == 0.0
    highs = _turning_values(drive.voltage_v)
    assert np.all(np.diff(np.abs(highs[highs > 0.5 * step_v])) <= 1e-9)


def test_the_papers_staircase() -> None:
    drive = staircase()
    levels_v = drive.voltage_v[::3000]
    np.testing.assert_allclose(np.abs(np.diff(levels_v)), 0.25)
    np.testing.assert_allclose(levels_v[:12], [*np.arange(0.0, 2.6, 0.25), 2.25])


def test_steps_by_default_are_those_of_table_2() -> None:
    drive = steps(dwell_s=0.01)
    levels_v = [level for level in drive.voltage_v[1000::10] if level != 0.0]
    assert levels_v == [2.5, 1.5, 0.5, -0.5, -1.5, -2.5]


# Multisine.


@settings(deadline=None)
@given(
    seed=st.integers(0, 2**31),
    n_periods=st.integers(1, 4),
    first=st.integers(1, 20),
    width=st.integers(0, 30),
)
def test_multisine_is_periodic_flat_in_its_band_and_silent_outside(
    seed: int, n_periods: int, first: int, width: int
) -> None:
    drive = multisine(
        lowest_hz=first * 0.5, highest_hz=(first + width) * 0.5, period_s=2.0, n_periods=n_periods, seed=seed
    )
    periods_v = drive.voltage_v.reshape(n_periods, 2000)
    np.testing.assert_array_equal(periods_v, np.repeat(periods_v[:1], n_periods, axis=0))
    assert np.max(np.abs(drive.voltage_v)) == pytest.approx(2.5)
    lines = np.abs(np.fft.rfft(periods_v[0]))
    in_band = slice(first, first + width + 1)
    np.testing.assert_allclose(lines[in_band], lines[first], rtol=1e-9)
    lines[in_band] = 0.0
    assert np.max(lines) < 1e-9


def test_multisine_phases_follow_the_seed() -> None:
    np.testing.assert_array_equal(multisine(seed=3).voltage_v, multisine(seed=3).voltage_v)
    assert not np.array_equal(multisine(seed=3).voltage_v, multisine(seed=4).voltage_v)
    assert abs(multisine(seed=3).voltage_v[0]) < 0.01


# Put together, and refused.


def test_excitations_follow_each_other_a_step_apart() -> None:
    first, second = (
        triangle(n_cycles=1, slope_v_per_s=10.0),
        steps([1.0], dwell_s=0.1, lead_in_s=0.1, rate_hz=100.0),
    )
    whole = concatenate(first, second)
    assert whole.name == "triangle+steps"
    assert whole.n_samples == first.n_samples + second.n_samples
    np.testing.assert_array_equal(whole.voltage_v[first.n_samples :], second.voltage_v)
    assert whole.time_s[first.n_samples] - whole.time_s[first.n_samples - 1] == pytest.approx(1e-3)
    assert concatenate(first, name="one").name == "one"
    with pytest.raises(ParameterError, match="nothing to put together"):
        concatenate()


@pytest.mark.parametrize(
    ("make", "options", "where"),
    [
        (relaxation, {"amplitude_v": 0.0}, "amplitude_v"),
        (relaxation, {"frequency_hz": 251.0}, "frequency_hz"),
        (relaxation, {"duration_s": 0.05}, "duration_s"),
        (relaxation, {"corner_ratio": 1.0}, "corner_ratio"),
        (relaxation, {"final_ratio": 0.2}, "final_ratio"),
        (relaxation, {"rest_s": -1.0}, "rest_s"),
        (triangle, {"slope_v_per_s": -1.0}, "slope_v_per_s"),
        (triangle, {"n_cycles": 0}, "n_cycles"),
        (triangle, {"n_cycles": 1.5}, "n_cycles"),
        (triangle, {"offset_v": math.inf}, "offset_v"),
        (triangle, {"slope_v_per_s": 1e-6}, "too many samples"),
        (staircase, {"step_v": 3.0}, "amplitude_v"),
        (staircase, {"dwell_s": 1e-4}, "dwell_s"),
        (staircase, {"rate_hz": math.nan}, "rate_hz"),
        (steps, {"levels_v": []}, "levels_v"),
        (steps, {"levels_v": [1.0, math.nan]}, "levels_v"),
        (steps, {"lead_in_s": -1.0}, "lead_in_s"),
        (steps, {"dwell_s": 1e9}, "too many samples"),
        (multisine, {"highest_hz": 600.0}, "highest_hz"),
        (multisine, {"period_s": 1.00001}, "period_s"),
        (multisine, {"lowest_hz": 3.01, "highest_hz": 3.09}, "lowest_hz, highest_hz"),
        (multisine, {"n_periods": True}, "n_periods"),
        (multisine, {"period_s": 1e9}, "too many samples"),
    ],
)
def test_arguments_outside_are_named(make: Any, options: dict[str, Any], where: str) -> None:
    with pytest.raises(InputError) as caught:
        make(**options)
    assert where in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "allowed" in str(caught.value)


def test_the_module_names_every_kind() -> None:
    assert all(getattr(excitation, make.__name__) is make for make in _ALL)

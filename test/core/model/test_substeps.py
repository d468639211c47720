"""Steps are divided where hysteresis and creep bend the response, and after a jump as long as creep still bends."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from fomrc_core.effects import Effect, effect_classes
from fomrc_core.effects.amplifier_saturation import AmplifierSaturation
from fomrc_core.effects.amplifier_slew_limit import AmplifierSlewLimit
from fomrc_core.effects.amplitude_dependent_creep import AmplitudeDependentCreep
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.backlash import Backlash
from fomrc_core.effects.clock_skew import ClockSkew
from fomrc_core.effects.creep_law import CreepLaw
from fomrc_core.effects.cross_axis import CrossAxis
from fomrc_core.effects.cyclic_sensor_error import CyclicSensorError
from fomrc_core.effects.dead_zone import DeadZone
from fomrc_core.effects.external_load import ExternalLoad
from fomrc_core.effects.gain_drift import GainDrift
from fomrc_core.effects.intermittent_contact import IntermittentContact
from fomrc_core.effects.lost_preload import LostPreload
from fomrc_core.effects.mains_hum import MainsHum
from fomrc_core.effects.missing_hysteresis import MissingHysteresis
from fomrc_core.effects.rate_dependent_hysteresis import RateDependentHysteresis
from fomrc_core.effects.sensor_nonlinearity import SensorNonlinearity
from fomrc_core.effects.slow_relaxation import SlowRelaxation
from fomrc_core.effects.thermal_drift import ThermalDrift
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.effects.unnamed import Unnamed
from fomrc_core.effects.unnamed_converter import UnnamedConverter
from fomrc_core.effects.unnamed_drive import UnnamedDrive
from fomrc_core.effects.unnamed_in_time import UnnamedInTime
from fomrc_core.effects.unnamed_ringing import UnnamedRinging
from fomrc_core.effects.unnamed_second_axis import UnnamedSecondAxis
from fomrc_core.effects.unnamed_static import UnnamedStatic
from fomrc_core.effects.unnamed_temperature import UnnamedTemperature
from fomrc_core.effects.zero_order_hold import ZeroOrderHold
from fomrc_core.errors import InputError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.simulation import relaxed_state, run_chain
from fomrc_core.model.substeps import (
    N_PARTS_LARGE,
    N_SUBSTEPS,
    STRAIGHT,
    TURN,
    Substeps,
    held_parts,
    least_parts,
    means_of_parts,
    parts_of_steps,
    subdivide,
)

_KAPPA, _SATURATION, _ORDER = [10.0, 25.0, 50.0, 1.3], [0.05, 0.1, 0.04], 0.03
_RINGING = effect_classes()["mechanical_resonance"](314.0, 0.0157)  # type: ignore[call-arg]
_LAGGING = effect_classes()["amplifier_bandwidth"](200.0)  # type: ignore[call-arg]


def _worked_finer(model: PiezoModel, drive_v: np.ndarray, before_v: float, factor: int = 40) -> np.ndarray:
    """Return the course of a drive straight between samples of a millisecond, each worked in so many [um].

    So fine that nothing is divided any more.
    """
    at = np.arange(1, drive_v.size * factor + 1) / factor
    fine_v = np.interp(at, np.arange(drive_v.size + 1), np.append(before_v, drive_v))
    return np.asarray(model.simulate(np.full(fine_v.size, 1e-3 / factor), fine_v)[factor - 1 :: factor])


def _in_a_fit(model: PiezoModel, drive_v: np.ndarray) -> np.ndarray:
    """Return what a fit gives for a drive at samples of a millisecond [um]."""
    state, at_creep = relaxed_state(model.play_form, model.creep_modes, model.effects)
    steps_s = np.full(drive_v.size, 1e-3)
    return run_chain(state, at_creep, model.effects, steps_s, drive_v, substeps=Substeps.FIT)


def _n_least(effect: Effect, substeps: Substeps = Substeps.BENDS, step_s: float = 1e-3) -> int:
    return least_parts((effect,), np.full(3, step_s), substeps)


def test_for_a_direction_a_swing_is_divided_as_far_as_it_turns() -> None:
    assert _n_least(_RINGING) > _n_least(_RINGING, Substeps.DIRECTIONS) == 5  # 0.314 of a turn a step
    assert _n_least(_RINGING, Substeps.DIRECTIONS, 1e-4) == 1
    assert _n_least(_RINGING, Substeps.DIRECTIONS, 1.0) == _n_least(_RINGING)
    assert _n_least(_LAGGING, Substeps.DIRECTIONS) == 1


def test_for_a_fit_a_swing_is_divided_as_far_as_it_turns_and_no_further_than_in_its_model() -> None:
    assert _n_least(_RINGING, Substeps.FIT, 1e-4) == 4  # 0.197 rad a step, in parts of 0.05
    assert _n_least(_RINGING, Substeps.FIT, 1e-3) == _n_least(_RINGING)
    assert _n_least(_LAGGING, Substeps.FIT) == 1
    hold = effect_classes()["zero_order_hold"](1e-4)  # type: ignore[call-arg]
    # its jumps are spread over a part, however slowly what sees them swings
    assert least_parts((hold, _RINGING), np.full(3, 1e-4), Substeps.FIT) > 4


@pytest.mark.parametrize("frequency_hz", [5.0, 40.0, 160.0])
def test_a_fit_follows_a_swing_as_its_model_does(frequency_hz: float) -> None:
    effect = effect_classes()["mechanical_resonance"](frequency_hz, 0.02)  # type: ignore[call-arg]
    model = PiezoModel((20.0, 40.0, 30.0, 10.0), (1.5, 12.0, 20.0), 0.02, (effect,), None, Substeps.BENDS)
    drive_v = np.repeat(np.random.default_rng(7).uniform(-50.0, 50.0, 30), 50)
    wanted_um = model.simulate(np.full(drive_v.size, 1e-3), drive_v)
    assert float(np.std(_in_a_fit(model, drive_v) - wanted_um)) < 3e-5 * float(np.ptp(wanted_um))


def _parts_of_fit(change: np.ndarray) -> np.ndarray:
    return parts_of_steps(change, 1.0, 1, Substeps.FIT)[0]


def test_a_fit_divides_steps_where_the_drive_turns_and_where_it_jumps() -> None:
    straight = np.concatenate((np.full(400, 0.004), np.full(400, -0.004)))
    parts = _parts_of_fit(straight)
    # from rest on it goes straight, then turns by twice as much; what is late to follow turns some steps later by less
    assert parts[400] == math.ceil(0.008 / TURN)
    assert np.all(np.diff(parts[400:]) <= 0)
    assert parts[399] == parts[-1] == 1
    # its model divides every step
    assert np.all(parts_of_steps(straight, 1.0, 1, Substeps.BENDS)[0] == N_SUBSTEPS)
    assert _parts_of_fit(np.array([0.0, 0.5, 0.0]))[1] == N_PARTS_LARGE
    assert np.all(_parts_of_fit(np.full(50, 1.5 * STRAIGHT))[20:] == 2), "the plays bend"


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=30))
def test_a_fit_divides_no_step_further_than_its_model(changes: list[float]) -> None:
    change = np.array(changes)
    assert np.all(_parts_of_fit(change) <= parts_of_steps(change, 1.0, 1, Substeps.BENDS)[0])


def test_a_fit_divides_a_held_drive_as_its_model_does() -> None:
    hold = effect_classes()["zero_order_hold"](2.0)  # type: ignore[call-arg]
    lag = effect_classes()["amplifier_bandwidth"](30.0)  # type: ignore[call-arg]
    model = PiezoModel((20.0, 40.0, 30.0, 10.0), (1.5, 12.0, 20.0), 0.02, (hold, lag), None, Substeps.BENDS)
    drive_v = 40.0 * np.sin(np.arange(600) / 40.0)
    np.testing.assert_array_equal(_in_a_fit(model, drive_v), model.simulate(np.full(600, 1e-3), drive_v))


_LATE = {
    "amplifier_bandwidth": {"cutoff_hz": 40.0},
    "unequal_lag": {"rising_s": 0.002, "falling_s": 0.005},
    "sensor_bandwidth": {"cutoff_hz": 60.0, "n_poles": 2.0},
    "transport_delay": {"delay_s": 0.4e-3},
    "slow_relaxation": {"amplitude": 0.03, "time_constant_s": 0.05},
}


@pytest.mark.parametrize("name", _LATE)
def test_a_fit_is_as_close_to_the_course_of_a_drive_that_turns_as_its_model(name: str) -> None:
    effect = effect_classes()[name].from_mapping(_LATE[name], where=name)
    model = PiezoModel((20.0, 40.0, 30.0, 10.0), (1.5, 12.0, 20.0), 0.02, (effect,), None, Substeps.BENDS)
    # triangles of many sizes, some 0.4 % of the largest threshold a step: loops whose turns the plays remember
    ends_v = np.cumsum(np.random.default_rng(3).uniform(10.0, 60.0, 30) * (-1.0) ** np.arange(30))
    ways = np.concatenate(([0], np.cumsum(np.abs(np.diff(ends_v, prepend=0.0)) / 0.08).astype(int)))
    drive_v = np.interp(np.arange(1, ways[-1] + 1), ways, np.concatenate(([0.0], ends_v)))
    fine_um = _worked_finer(model, drive_v, 0.0)
    assert float(np.std(_in_a_fit(model, drive_v) - fine_um)) < 1e-5 * float(np.ptp(fine_um))
    whole = parts_of_steps(np.diff(drive_v, prepend=0.0), 20.0, 1, Substeps.BENDS)[0]
    assert np.sum(_parts_of_fit(np.diff(drive_v, prepend=0.0) / 20.0)) < 0.5 * np.sum(whole)


def test_the_steps_after_a_jump_are_divided_until_creep_is_straight() -> None:
    parts, bend = parts_of_steps(
        np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 1.0, _n_least(_LAGGING), Substeps.BENDS
    )
    assert parts[0] == parts[1] == N_PARTS_LARGE
    assert parts[4] == N_SUBSTEPS
    assert parts[-1] == 1
    assert 0.0 < bend < 1e-3
    at_rest, bend = parts_of_steps(np.zeros(3), 1.0, _n_least(_LAGGING), Substeps.BENDS)
    assert at_rest.tolist() == [1, 1, 1]
    assert bend == 0.0
    # what rings swings on while the drive rests
    assert parts_of_steps(np.zeros(3), 1.0, _n_least(_RINGING), Substeps.BENDS)[0].min() > 1


@pytest.mark.parametrize(
    "names",
    [
        ("mechanical_resonance",),
        ("drive_resonance",),
        ("drive_resonance", "mechanical_resonance"),
        ("mechanical_resonance", "second_mode"),
        ("mechanical_resonance", "sensor_bandwidth"),
        ("mechanical_resonance", "transport_delay"),
    ],
)
def test_what_rings_while_the_drive_rests_is_followed_by_what_is_behind_it(names: tuple[str, ...]) -> None:
    known = {
        "mechanical_resonance": {"frequency_hz": 160.0, "damping_ratio": 0.02},
        "drive_resonance": {"frequency_hz": 130.0, "damping_ratio": 0.05},
        "second_mode": {"frequency_hz": 210.0, "damping_ratio": 0.09, "participation": -1.0, "rate_share": -0.2},
        "sensor_bandwidth": {"cutoff_hz": 200.0, "n_poles": 2.0},
        "transport_delay": {"delay_s": 0.4e-3},
    }
    effects = tuple(effect_classes()[name].from_mapping(known[name], where=name) for name in names)
    model = PiezoModel((20.0, 40.0, 30.0, 10.0), (1.5, 12.0, 20.0), 0.02, effects, None, Substeps.BENDS)
    levels_v = np.repeat(np.random.default_rng(7).uniform(-50.0, 50.0, 30), 50)
    levels_v[:50] = 0.0
    fine_um = _worked_finer(model, levels_v, levels_v[0])
    coarse_um = model.simulate(np.full(levels_v.size, 1e-3), levels_v)
    error_um, stroke_um = coarse_um - fine_um, float(np.ptp(fine_um))
    assert float(np.sqrt(np.mean((error_um - np.mean(error_um)) ** 2))) < 1e-4 * stroke_um


@given(st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=30), st.integers(1, 29))
def test_what_is_divided_does_not_depend_on_where_a_record_is_cut(changes: list[float], cut: int) -> None:
    change = np.array(changes)
    whole, end = parts_of_steps(change, 1.0, _n_least(_RINGING), Substeps.BENDS)
    first, bend = parts_of_steps(change[:cut], 1.0, _n_least(_RINGING), Substeps.BENDS)
    if cut >= change.size:
        np.testing.assert_array_equal(first, whole)
        return
    second, bend = parts_of_steps(change[cut:], 1.0, _n_least(_RINGING), Substeps.BENDS, bend)
    np.testing.assert_array_equal(np.concatenate((first, second)), whole)
    assert bend == end


@given(st.lists(st.tuples(st.floats(1e-4, 1.0), st.floats(-2.0, 2.0), st.integers(1, 9)), min_size=1, max_size=20))
def test_parts_add_up_to_the_steps_they_were_made_from(rows: list[tuple[float, float, int]]) -> None:
    steps, drive, parts = (np.array(column) for column in zip(*rows, strict=True))
    fine_steps, fine_drive, ends = subdivide(steps, drive, 0.25, parts)
    np.testing.assert_array_equal(fine_drive[ends], drive)
    np.testing.assert_allclose(np.add.reduceat(fine_steps, ends - parts + 1), steps, rtol=1e-12)


@pytest.mark.parametrize("jump_v", [0.1, 0.5])
def test_a_ringing_mass_follows_a_jump_as_one_worked_fifty_times_finer(jump_v: float) -> None:
    bare = PiezoModel(_KAPPA, _SATURATION, _ORDER)  # type: ignore[arg-type]
    n_parts, step_s = 50, 1e-3
    drive = np.concatenate((np.zeros(5), np.full(200, jump_v)))
    fine = np.interp(np.arange(n_parts * drive.size + 1) / n_parts, np.arange(drive.size + 1), np.append(0.0, drive))
    creeping = bare.simulate(np.full(fine.size - 1, step_s / n_parts), fine[1:])
    # z'' + 2 d w z' + w^2 z = w^2 f by the bilinear rule at 20 us; its warping of 314 Hz is 3e-5 of the frequency
    w, h, damping = 2.0 * np.pi * _RINGING.frequency_hz, step_s / n_parts, _RINGING.damping_ratio  # type: ignore[attr-defined]
    c = 2.0 / h
    a = np.array([c * c + 2 * damping * w * c + w * w, 2 * (w * w - c * c), c * c - 2 * damping * w * c + w * w])
    expected = lfilter(w * w * np.array([1.0, 2.0, 1.0]) / a[0], a / a[0], creeping)[n_parts - 1 :: n_parts]
    model = replace(bare, effects=(_RINGING,), substeps=Substeps.BENDS)
    moved = model.simulate(np.full(drive.size, step_s), drive)
    swing = float(np.ptp(expected))
    assert np.max(np.abs(moved - expected)) < 2e-3 * swing


_NULLS = {
    "amplitude_dependent_creep": AmplitudeDependentCreep(0.0, 0.002),
    "backlash": Backlash(0.0),
    "intermittent_contact": IntermittentContact(0.5, 0.0, 0.0),
    "lost_preload": LostPreload(0.4, 0.0),
    "rate_dependent_hysteresis": RateDependentHysteresis(0.0),
    "cyclic_sensor_error": CyclicSensorError(0.3, 0.0, 0.0),
    "zero_order_hold": ZeroOrderHold(0.0),
    "creep_law": CreepLaw(0.0, 0.003),
    "amplifier_saturation": AmplifierSaturation(),
    "amplifier_slew_limit": AmplifierSlewLimit(1e9),
    "asymmetric_hysteresis": AsymmetricHysteresis(),
    "clock_skew": ClockSkew(0.0),
    "cross_axis": CrossAxis(0.0),
    "dead_zone": DeadZone(0.0),
    "external_load": ExternalLoad(0.0, 0.05),
    "gain_drift": GainDrift(0.0),
    "mains_hum": MainsHum(50.0, 0.0),
    "missing_hysteresis": MissingHysteresis(0.0),
    "sensor_nonlinearity": SensorNonlinearity(),
    "slow_relaxation": SlowRelaxation(0.0, 0.1),
    "thermal_drift": ThermalDrift(),
    "transport_delay": TransportDelay(0.0),
    "unnamed": Unnamed((0.0,), (2.0,), (0.02,), (1.0,), (0.1,), 1.0),
    "unnamed_drive": UnnamedDrive((0.0, 0.0), (50.0, 20.0), (0.0, 200.0), (0.0, 1.0)),
    "unnamed_converter": UnnamedConverter((0.0, 0.0), (0.1, 0.2), (0.0, 0.25), (0.0, 1.0)),
    "unnamed_ringing": UnnamedRinging((0.0, 0.0), (50.0, 20.0), (0.0, 200.0), (2.0, 1.0)),
    "unnamed_in_time": UnnamedInTime((0.0,), (1.0,), (0.0,), (0.02,), 1.0, 0.0, 1.0),
    "unnamed_second_axis": UnnamedSecondAxis((0.0,), (1.0,), (0.0,), (0.02,), 1.0, 0.0, 1.0),
    "unnamed_static": UnnamedStatic((0.0,), (0.1,), (2.0,), (0.1,), 1.0),
    "unnamed_temperature": UnnamedTemperature((0.0,), (1.0,), (0.0,), (0.02,), 1.0, 20.0, 1.0),
}
_NOT_REPRESENTABLE = {
    "amplifier_bandwidth",
    "charge_leak",
    "dac_quantization",
    "drive_resonance",
    "mechanical_resonance",
    "second_mode",
    "sensor_bandwidth",
    "unequal_lag",
    "voltage_dependent_capacitance",
}


def test_every_effect_whose_size_can_be_nothing_is_asked_for_nothing() -> None:
    assert set(_NULLS) | _NOT_REPRESENTABLE == set(effect_classes())
    assert not any(
        kind.main_parameter in kind.linear_parameters for kind in map(effect_classes().get, _NOT_REPRESENTABLE)
    )


@pytest.mark.parametrize("name", _NULLS)
@pytest.mark.parametrize("substeps", [Substeps.NONE, Substeps.JUMPS, Substeps.BENDS])
def test_an_effect_of_size_zero_changes_no_bit(name: str, substeps: Substeps) -> None:
    bare = PiezoModel(_KAPPA, _SATURATION, _ORDER, substeps=substeps)  # type: ignore[arg-type]
    rng = np.random.default_rng(3)
    steps_s = 1e-3 * (1.0 + 0.3 * rng.uniform(-1.0, 1.0, 500))
    drive = np.concatenate((np.full(100, 1.3), np.sin(np.arange(200) / 9.0), np.repeat(rng.normal(size=10), 20)))
    outside = {"temperature_c": 20.0 + rng.normal(size=500), "cross": rng.normal(size=500)}
    expected = bare.simulate(steps_s, drive)
    found = bare.with_effects(_NULLS[name]).simulate(steps_s, drive, **outside)
    assert np.array_equal(found, expected)


@pytest.mark.parametrize("name", _NULLS)
def test_a_file_of_before_the_key_divides_steps_as_then_and_for_nothing_not_at_all(name: str) -> None:
    effect = _NULLS[name]
    block = {"kappa_um_per_v": _KAPPA, "saturation_v": _SATURATION, "creep_order": _ORDER}
    null = PiezoModel.from_mapping({**block, "effects": [name], name: effect.to_mapping()})
    if effect.is_null():
        assert null.substeps is Substeps.NONE
    back = PiezoModel.from_mapping(replace(null, substeps=Substeps.BENDS).to_mapping())
    assert back.substeps is Substeps.BENDS


def test_a_file_that_does_not_say_is_read_as_ever() -> None:
    block = {"kappa_um_per_v": _KAPPA, "saturation_v": _SATURATION, "creep_order": _ORDER}
    lag = {"effects": ["amplifier_bandwidth"], "amplifier_bandwidth": {"cutoff_hz": 40.0}}
    drift = {"effects": ["gain_drift"], "gain_drift": {"per_s": 0.01}}
    past = {"effects": ["initial_state"], "initial_state": {"extreme_v": 1.0}}
    expected = [({}, Substeps.NONE), (lag, Substeps.BENDS), (drift, Substeps.JUMPS), (past, Substeps.JUMPS)]
    for more, substeps in expected:
        assert PiezoModel.from_mapping({**block, **more}).substeps is substeps
    assert "substeps" not in PiezoModel.from_mapping(block).to_mapping()
    with pytest.raises(InputError, match=r"model\.substeps"):
        PiezoModel.from_mapping({**block, "substeps": "few"})


@given(st.lists(st.integers(1, 9), min_size=1, max_size=30), st.integers(0, 3), st.integers(0, 2**32 - 1))
def test_what_is_read_over_a_sample_is_the_mean_over_its_parts(n_parts: list[int], n_columns: int, seed: int) -> None:
    rng, parts = np.random.default_rng(seed), np.array(n_parts)
    shape = (int(parts.sum()), n_columns) if n_columns else (int(parts.sum()),)
    values, ends = rng.normal(size=shape), np.cumsum(parts) - 1
    expected = [np.mean(piece, axis=0) for piece in np.split(values, ends[:-1] + 1)]
    np.testing.assert_allclose(means_of_parts(values, ends), expected, atol=1e-14)
    before_v, drive_v = rng.normal(size=(2, parts.size))
    held_v = held_parts(before_v, drive_v, parts)
    # half before the jump and half after, whatever the number of parts
    np.testing.assert_allclose(means_of_parts(held_v, ends), 0.5 * (before_v + drive_v), atol=1e-14)

"""A loop that follows its target late by a preview, and undoes dynamics with what it then knows of the future."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from small_model import MODEL, compensator_of

from fomrc_core.control.compensation_loop import CompensationLoop, LoopSettings
from fomrc_core.control.trajectory import TrajectoryPoints
from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.errors import ParameterError
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.preview_inverse import PreviewInverse

PERIOD_S = 1e-3
PREVIEW_S = 0.01
N_LATE = 10
DYNAMICS = {
    "amplifier_bandwidth": {"cutoff_hz": 500.0},
    "mechanical_resonance": {"frequency_hz": 300.0, "damping_ratio": 0.02},
    "transport_delay": {"delay_s": 5e-4},
}


def fast_model(**changed) -> PiezoModel:
    return PiezoModel.from_mapping(MODEL | {"effects": list(DYNAMICS)} | DYNAMICS | changed)


def settings(slew_v_per_s: float = 500.0, limit_v: float = 5.0) -> LoopSettings:
    limits = VoltageLimits(-limit_v, limit_v, slew_v_per_s, 0.0, 10.0, 2.0 * PERIOD_S)
    return LoopSettings(limits, 0.0, False, PERIOD_S, 60.0)


def previewing(model: PiezoModel, preview_s: float = PREVIEW_S, **limits: float) -> CompensationLoop:
    preview = PreviewInverse.of(model, PERIOD_S, preview_s)
    return CompensationLoop(preview.core, settings(**limits), preview=preview)


def driven(loop: CompensationLoop, target_um: np.ndarray) -> np.ndarray:
    voltages = []
    for wanted in target_um:
        loop.set_target(float(wanted))
        voltages.append(loop.tick(PERIOD_S))
    return np.array(voltages)


def raster(frequency_hz: float, n: int = 1500) -> np.ndarray:
    """A triangle rounded to 150 Hz that begins gently [um]."""
    time_s = PERIOD_S * np.arange(n)
    odd = np.arange(1, max(int(150.0 / frequency_hz), 1) + 1, 2)
    angles = 2.0 * np.pi * frequency_hz * np.outer(time_s, odd)
    course = np.sin(angles) @ ((-1.0) ** ((odd - 1) // 2) / odd**2) * 8.0 / np.pi**2
    return 2.0 * course * (0.5 - 0.5 * np.cos(np.pi * np.clip(time_s / 0.3, 0.0, 1.0)))


def moved(model: PiezoModel, voltage_v: np.ndarray) -> np.ndarray:
    return model.simulate(np.full(voltage_v.size, PERIOD_S), voltage_v)


@pytest.mark.parametrize("frequency_hz", [10.0, 30.0])
def test_dynamics_are_undone_that_a_loop_without_a_future_leaves(frequency_hz):
    target_um, model = raster(frequency_hz), fast_model()
    late_um = np.concatenate((np.zeros(N_LATE), target_um[:-N_LATE]))
    off = {
        "preview": moved(model, driven(previewing(model), target_um)) - late_um,
        "none": moved(model, driven(CompensationLoop(Compensator(model), settings()), target_um)) - target_um,
    }
    percent = {name: 100.0 * np.sqrt(np.mean(values[800:] ** 2)) / 4.0 for name, values in off.items()}
    print(frequency_hz, percent)
    assert percent["preview"] < 0.3
    assert percent["preview"] < percent["none"] / 15.0


def test_where_there_is_nothing_to_undo_a_preview_is_a_delay_and_no_more():
    target_um = raster(10.0)
    plain = driven(CompensationLoop(compensator_of(), settings()), target_um)
    late = driven(previewing(PiezoModel.from_mapping(MODEL)), target_um)
    np.testing.assert_array_equal(late[N_LATE:], plain[:-N_LATE])


def test_effects_that_need_no_future_are_undone_beside_it():
    model = fast_model(
        effects=[*DYNAMICS, "slow_relaxation"], slow_relaxation={"amplitude": 0.05, "time_constant_s": 0.2}
    )
    loop = previewing(model)
    assert [effect.name for effect in loop.compensator.model.effects] == ["slow_relaxation"]
    target_um = raster(10.0)
    off = moved(model, driven(loop, target_um))[N_LATE:] - target_um[:-N_LATE]
    assert np.sqrt(np.mean(off[800:] ** 2)) < 0.003 * 4.0


def test_limited_voltages_leave_the_memory_where_the_actuator_is():
    model = fast_model()
    loop = previewing(model, slew_v_per_s=60.0, limit_v=1.2)
    target_um = raster(10.0)
    followed, voltages = [], []
    for wanted in target_um:
        loop.set_target(float(wanted))
        voltages.append(loop.tick(PERIOD_S))
        followed.append(loop.followed_um)
    assert loop.counts.n_clamped > 50
    assert loop.counts.n_slewed > 20
    assert np.max(np.abs(np.diff(voltages))) <= 60.0 * PERIOD_S + 1e-12
    before_mechanics = replace(model, effects=model.effects[:1])
    off = np.array(followed) - moved(before_mechanics, np.array(voltages))
    print("off by", np.max(np.abs(off)))
    assert np.max(np.abs(off)) < 0.005 * 4.0


def test_it_goes_on_from_wherever_it_was_brought_to():
    model = fast_model()
    loop = previewing(model, slew_v_per_s=200.0)
    driven(loop, raster(10.0, 300))
    for goal_v in np.linspace(0.0, 1.0, 50):
        loop.tick_to(float(goal_v), PERIOD_S)
    voltages = driven(loop, np.full(400, 0.5))
    assert np.max(np.abs(np.diff(voltages))) <= 200.0 * PERIOD_S + 1e-12
    assert np.ptp(voltages[-100:]) < 2e-3, "at rest but for creep"
    assert loop.followed_um == pytest.approx(0.5, abs=1e-9)


def test_a_late_tick_is_made_good_for():
    """The voltage is held while the node is held up; then the stage is where the target is that much later."""
    model = fast_model()
    loop, plant = previewing(model), model.initial_state()
    target_um = raster(10.0)
    off_um, k = [], 0
    while k < target_um.size:
        n_periods = 20 if k == 1000 else 1
        k_now = min(k + n_periods - 1, target_um.size - 1)
        loop.set_target(float(target_um[k_now]))
        voltage_before = loop.voltage_v
        voltage_v = loop.tick(n_periods * PERIOD_S)
        for held_v in [voltage_before] * (n_periods - 1) + [voltage_v]:
            moved_um = model.advance(plant, held_v, PERIOD_S)
        off_um.append(moved_um - target_um[k_now - N_LATE])
        k += n_periods
    off_um = np.abs(off_um)
    assert np.max(off_um[850:1000]) < 0.02
    assert np.max(off_um[-150:]) < 0.05, "what is left rings out, damped by 0.02"


def test_swapped_model_stands_as_if_it_had_run_all_along():
    target_um = raster(10.0, 3000)
    new = PreviewInverse.of(fast_model(creep_order=0.016), PERIOD_S, PREVIEW_S)
    replayed = driven(CompensationLoop(new.core, settings(), preview=new), target_um)
    loop = previewing(fast_model())
    voltages = driven(loop, target_um[:1500])
    loop.swap(new.core, new)
    voltages = np.append(voltages, driven(loop, target_um[1500:]))
    assert not loop.is_swapping
    np.testing.assert_allclose(voltages[-800:], replayed[-800:], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(("preview_s", "holds_to_hz"), [(0.001, 100.0), (0.01, 220.0)])
def test_a_preview_that_is_too_short_says_so(preview_s, holds_to_hz):
    preview = PreviewInverse.of(fast_model(), PERIOD_S, preview_s)
    assert ("too short" in preview.note) == (preview_s < 0.005)
    assert preview.holds_to_hz < holds_to_hz
    step = driven(previewing(fast_model(), preview_s), np.full(200, 1.0))
    assert np.max(np.abs(step)) < 4.0 * abs(step[-1]), "never a wild voltage"


def test_a_resonance_near_the_sample_rate_is_told():
    faster = fast_model(mechanical_resonance={"frequency_hz": 420.0, "damping_ratio": 0.02})
    assert "rate_hz of 1.2e+03 or more holds it" in PreviewInverse.of(faster, PERIOD_S, PREVIEW_S).note
    assert PreviewInverse.of(fast_model(), PERIOD_S, PREVIEW_S).note == ""


@pytest.mark.parametrize("preview_s", [0.0, -1.0, 2.0, float("nan")])
def test_a_preview_out_of_range_is_refused(preview_s):
    with pytest.raises(ParameterError, match="preview_s"):
        PreviewInverse.of(fast_model(), PERIOD_S, preview_s)


def test_a_trajectory_needs_no_delay():
    model = fast_model()
    loop = previewing(model)
    times_s = 0.02 * np.arange(1, 60)
    course_um = np.sin(2.0 * np.pi * 5.0 * times_s)
    rates = 2.0 * np.pi * 5.0 * np.cos(2.0 * np.pi * 5.0 * times_s)
    rates[0] = rates[-1] = 0.0
    trajectory = TrajectoryPoints(times_s, course_um, rates).from_state((0.0, 0.0, 0.0), 0.0)
    loop.set_trajectory(trajectory)
    now_s = PERIOD_S * np.arange(1, 1400)
    voltages = np.array([loop.tick(PERIOD_S, float(time_s)) for time_s in now_s])
    off_um = moved(model, voltages) - trajectory.at(now_s)
    assert loop.trajectory is None, "it has ended"
    assert loop.target_um == pytest.approx(course_um[-1])
    assert np.max(np.abs(off_um[300:])) < 0.01

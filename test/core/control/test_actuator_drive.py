"""Who drives, tick by tick: every voltage within the limits and the slew, whoever asks for it."""

from __future__ import annotations

import contextlib
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_model import MODEL, compensator_of

from fomrc_core.control.actuator_drive import ActuatorDrive, DriveSettings
from fomrc_core.control.compensation_loop import CompensationLoop, LoopSettings
from fomrc_core.control.voltage_limits import VoltageLimits
from fomrc_core.errors import FomrcError, ParameterError
from fomrc_core.model.piezo_model import PiezoModel

PERIOD_S = 0.01


def limits_of(maximum_v: float = 2.5, slew_v_per_s: float = 20.0) -> VoltageLimits:
    return VoltageLimits(-maximum_v, maximum_v, slew_v_per_s, 0.0, 5.0)


def drive_of(limits: VoltageLimits, *, has_loop: bool = True) -> ActuatorDrive:
    drive = ActuatorDrive(DriveSettings(limits, True, 0.5))
    if has_loop:
        drive.take_loop(CompensationLoop(compensator_of(), LoopSettings(limits, 0.0, False, PERIOD_S, 1.0)))
        drive.is_active = True
    return drive


def run(drive: ActuatorDrive, n: int, start_s: float = 0.0) -> list[float]:
    voltages = [drive.tick(PERIOD_S, start_s + k * PERIOD_S) for k in range(n)]
    return [voltage for voltage in voltages if voltage is not None]


@pytest.mark.parametrize("has_loop", [True, False])
def test_a_lease_that_runs_out_ends_at_the_safe_voltage(has_loop):
    drive = drive_of(limits_of(), has_loop=has_loop)
    drive.lend(0.0)
    with pytest.raises(FomrcError, match="lent already"):
        drive.lend(0.0)
    assert run(drive, 3) == [], "lent, but nothing asked for yet"
    assert drive.borrow(1.5, 0.03)
    assert not drive.borrow(math.nan, 0.03)
    voltages = run(drive, 30, 0.03)
    assert voltages[-1] == 1.5
    after = run(drive, 100, 0.54)
    assert after[-1] == 0.0
    assert max(np.abs(np.diff([1.5, *after]))) <= 5.0 * PERIOD_S + 1e-12
    assert "fell silent" in drive.problem
    assert ("memory is unknown" in drive.problem) == (not has_loop)
    assert not drive.is_lent
    assert not drive.borrow(1.0, 2.0)


def test_the_memory_is_what_the_borrower_drove():
    drive = drive_of(limits_of())
    driven = []
    drive.lend(0.0)
    for k in range(300):
        drive.borrow(1.2 * math.sin(0.05 * k), k * PERIOD_S)
        driven.append(drive.tick(PERIOD_S, k * PERIOD_S))
    moved = PiezoModel.from_mapping(MODEL).simulate(np.full(300, PERIOD_S), np.array(driven))
    assert drive.loop is not None
    assert drive.loop.followed_um == pytest.approx(moved[-1], abs=1e-9)
    assert drive.take_back()
    drive.loop.set_target(0.7)
    after = run(drive, 200, 3.0)
    moved = PiezoModel.from_mapping(MODEL).simulate(np.full(300 + len(after), PERIOD_S), np.array([*driven, *after]))
    assert moved[-1] == pytest.approx(0.7, abs=1e-9)


@pytest.mark.parametrize("is_lent_again", [True, False])
def test_it_creeps_on_while_nobody_says_what_to_drive(is_lent_again):
    """A borrower leaves a voltage on for long and returns it: until there is a target the stage creeps, and is lent."""
    drive = drive_of(limits_of())
    drive.lend(0.0)
    held_v = [1.2] * 150 + [0.0] * 5
    driven = []
    for k, goal_v in enumerate(held_v):
        drive.borrow(goal_v, k * PERIOD_S)
        driven.append(drive.tick(PERIOD_S, k * PERIOD_S))
    assert drive.take_back()
    if is_lent_again:
        drive.lend(2.0)
    n_silent = 40 if is_lent_again else 200  # a lease lasts for half a second
    assert run(drive, n_silent, 2.0) == [], "there is nothing to publish"
    if is_lent_again:
        assert drive.take_back()
    assert drive.loop is not None
    drive.loop.set_target(0.7)
    after = run(drive, 100, 5.0)
    voltages = np.array([*driven, *[driven[-1]] * n_silent, *after])
    moved = PiezoModel.from_mapping(MODEL).simulate(np.full(voltages.size, PERIOD_S), voltages)
    assert moved[-90:] == pytest.approx(0.7, abs=1e-9), "as soon as the slew lets it"


def test_a_loop_after_a_borrower_without_one_says_that_the_memory_is_unknown():
    drive = drive_of(limits_of(), has_loop=False)
    drive.lend(0.0)
    drive.borrow(1.0, 0.0)
    run(drive, 30)
    drive.take_back()
    loop = CompensationLoop(compensator_of(), LoopSettings(limits_of(), 0.0, False, PERIOD_S, 1.0))
    drive.take_loop(loop)
    assert "memory is unknown" in drive.problem
    assert loop.voltage_v == 1.0, "slewed from where the voltage is"
    drive.set_relaxed()
    assert drive.problem == ""


def test_a_failed_loop_leaves_the_way_to_safety():
    drive = drive_of(limits_of())
    assert drive.loop is not None
    drive.loop.set_target(1.5)
    assert run(drive, 100)[-1] > 0.4
    drive.fail("broken")
    assert run(drive, 100, 1.0)[-1] == 0.0
    assert drive.problem == "broken"


def test_narrowed_limits_are_the_narrower_of_both():
    both = limits_of(2.0, 20.0).narrowed(VoltageLimits(-3.0, 1.0, 5.0, 0.5, 50.0))
    assert both == VoltageLimits(-2.0, 1.0, 5.0, 0.0, 5.0)
    with pytest.raises(ParameterError):
        limits_of(1.0).narrowed(VoltageLimits(2.0, 3.0, 1.0, 2.0, 1.0))


DEEDS = st.one_of(
    st.tuples(st.just("target"), st.floats(-50.0, 50.0)),
    st.tuples(st.just("borrow"), st.floats(allow_nan=True, allow_infinity=True)),
    st.tuples(st.just("limit"), st.sampled_from([0.1, 0.5, 2.5])),
    st.tuples(st.just("slew"), st.sampled_from([1.0, 20.0, 500.0])),
    st.tuples(st.sampled_from(["lend", "return", "stop", "end stop", "fail", "routine", "relaxed"]), st.none()),
)


def told(drive: ActuatorDrive, limits: VoltageLimits) -> VoltageLimits:
    drive.settings = DriveSettings(limits, True, 0.5)
    if drive.loop is not None:
        drive.loop.settings = LoopSettings(limits, 0.0, False, PERIOD_S, 1.0)
    return limits


def do(drive: ActuatorDrive, limits: VoltageLimits, deed: str, value, now_s: float) -> VoltageLimits:
    """Do one thing that may be refused; return the limits in force."""
    loop = drive.loop
    if deed == "limit":
        return told(drive, limits_of(value, limits.slew_v_per_s))
    if deed == "slew":
        return told(drive, limits_of(limits.maximum_v, value))
    if loop is not None and deed in ("target", "routine"):
        loop.set_target(value) if deed == "target" else loop.start_routine(iter([1.0, -1.0, 5.0]))
        return limits
    deeds = {
        "borrow": lambda: drive.borrow(value, now_s),
        "lend": lambda: drive.lend(now_s),
        "return": drive.take_back,
        "stop": drive.begin_stop,
        "end stop": drive.end_stop,
        "fail": lambda: drive.fail("told to"),
        "relaxed": drive.set_relaxed,
    }
    with contextlib.suppress(FomrcError):
        deeds.get(deed, lambda: None)()
    return limits


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.lists(st.tuples(DEEDS, st.integers(1, 12)), max_size=25))
def test_no_sequence_of_deeds_leads_beyond_limits_or_slew(deeds):
    limits = limits_of()
    drive, now_s, last_v = drive_of(limits), 0.0, 0.0
    for (deed, value), n_ticks in deeds:
        limits = do(drive, limits, deed, value, now_s)
        for _ in range(n_ticks):
            now_s += PERIOD_S
            voltage_v = drive.tick(PERIOD_S, now_s)
            if voltage_v is None:
                continue
            assert limits.minimum_v <= voltage_v <= limits.maximum_v
            # Limits narrowed since come before the slew limit, by exactly the way to them.
            assert abs(voltage_v - limits.clamp(last_v)) <= limits.slew_v_per_s * PERIOD_S + 1e-12
            last_v = voltage_v

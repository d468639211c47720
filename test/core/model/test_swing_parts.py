"""A fit divides steps where something swings, and no further than the swing there asks for."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.effects import Effect
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.drive_resonance import DriveResonance
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.effects.unnamed_ringing import UnnamedRinging
from fomrc_core.effects.zero_order_hold import ZeroOrderHold
from fomrc_core.model.divided_drive import ElementDrive
from fomrc_core.model.simulation import pass_chain, relaxed_state
from fomrc_core.model.substeps import Substeps, least_parts
from fomrc_core.model.swing_parts import least_of_steps
from fomrc_core.operators.creep_modes import creep_modes
from fomrc_core.operators.hysteresis import OperatorSum

_FORM = OperatorSum(0.02, np.array([0.5, 2.0, 8.0, 20.0, 30.0]), np.array([0.01, 0.008, 0.006, 0.004, 0.002]))
_STEP_S = 1e-3
_CHAINS: tuple[tuple[Effect, ...], ...] = (
    (DriveResonance(120.0, 0.3),),
    (DriveResonance(120.0, 0.02),),
    (MechanicalResonance(90.0, 0.05), TransportDelay(0.0013)),
    (AmplifierBandwidth(150.0), DriveResonance(150.0, 0.1), MechanicalResonance(60.0, 0.03)),
)


def _smooth_v(n: int = 3000) -> np.ndarray:
    at_s = _STEP_S * np.arange(n)
    return np.asarray(10.0 * sum(np.sin(2.0 * np.pi * f * at_s) for f in (1.0, 2.3, 5.1)))


def _steps_v(n: int = 3000) -> np.ndarray:
    return np.repeat(np.random.default_rng(4).uniform(-30.0, 30.0, n // 100), 100)


def _least(effects: tuple[Effect, ...], drive_v: np.ndarray, substeps: Substeps = Substeps.FIT) -> np.ndarray:
    steps_s = np.full(drive_v.size, _STEP_S)
    n_least = least_parts(effects, steps_s, substeps)
    found = least_of_steps(effects, steps_s, drive_v, 30.0, substeps, n_least)
    return np.asarray(np.broadcast_to(found, drive_v.shape))


def _run(effects: tuple[Effect, ...], drive_v: np.ndarray, substeps: Substeps) -> tuple[np.ndarray, int]:
    state, at_creep = relaxed_state(_FORM, creep_modes(0.03, 1e-4), effects)
    sampled = ElementDrive(np.full(drive_v.size, _STEP_S), drive_v, None)
    seen_um, passage = pass_chain(state, at_creep, effects, sampled, substeps=substeps)
    return seen_um, passage.moved_um.size


@pytest.mark.parametrize("effects", _CHAINS, ids=lambda chain: "+".join(e.name for e in chain))
def test_fewer_parts_miss_some_millionths(effects: tuple[Effect, ...]) -> None:
    wanted_um, n_model = _run(effects, _smooth_v(), Substeps.BENDS)
    seen_um, n_parts = _run(effects, _smooth_v(), Substeps.FIT)
    assert float(np.std(seen_um - wanted_um)) < 1e-5 * float(np.ptp(wanted_um))
    assert n_parts < 0.6 * n_model, "what hardly swings asks for no more"


def test_a_jump_is_followed_by_as_many_parts_as_ever_and_they_get_fewer_as_it_fades() -> None:
    ringing = (DriveResonance(120.0, 0.1),)
    drive_v = np.repeat([0.0, 20.0], 500)
    n_most = least_parts(ringing, np.full(1000, _STEP_S), Substeps.FIT)
    parts = _least(ringing, drive_v)
    assert np.all(parts[:500] == 1)
    assert parts[500] == n_most
    assert np.all(np.diff(parts[500:]) <= 0)
    assert parts[-1] == 1


@pytest.mark.parametrize("effects", _CHAINS, ids=lambda chain: "+".join(e.name for e in chain))
def test_no_step_is_divided_further_than_the_largest_swing_asks(effects: tuple[Effect, ...]) -> None:
    n_most = least_parts(effects, np.full(3, _STEP_S), Substeps.FIT)
    assert np.max(_least(effects, _steps_v())) <= n_most


def test_where_nobody_knows_how_large_a_swing_is_all_steps_are_divided_alike() -> None:
    drive_v = _smooth_v()
    ringing = DriveResonance(120.0, 0.3)
    for effects in ((ZeroOrderHold(1e-3), ringing), (UnnamedRinging((0.2,), (30.0,), (300.0,), (1.0,)),)):
        parts = _least(effects, drive_v)
        assert np.all(parts == parts[0])
        assert parts[0] > 1
    for substeps in (Substeps.BENDS, Substeps.DIRECTIONS):
        assert np.all(_least((ringing,), drive_v, substeps) == least_parts((ringing,), np.full(3, _STEP_S), substeps))


def test_plays_that_nothing_moves_leave_the_parts_that_there_were() -> None:
    steps_s, drive_v = np.full(50, _STEP_S), np.repeat([0.0, 1.0], 25)
    parts = least_of_steps((DriveResonance(120.0, 0.3),), steps_s, drive_v, 0.0, Substeps.FIT, 16)
    assert np.all((np.asarray(parts) >= 1) & (np.asarray(parts) <= 16))

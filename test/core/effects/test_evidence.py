"""What an effect asks of the data before it is believed, and the effects' parts a diagnosis leans on."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fomrc_core.diagnosis.held_out_score import held_out_score
from fomrc_core.effects.amplifier_slew_limit import AmplifierSlewLimit
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.external_load import ExternalLoad
from fomrc_core.effects.slow_relaxation import SlowRelaxation
from fomrc_core.errors import ParameterError
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.operators.hysteresis import OperatorSum, elements_from_play_form
from fomrc_core.records.drive import n_loop_kinds

TIME_S = np.arange(20_000) * 1e-3


def test_a_load_that_jumps_is_confirmed_and_a_swell_is_not() -> None:
    noise = 1e-3 * np.random.default_rng(0).standard_normal(TIME_S.size)
    load = ExternalLoad(0.01, 5.0, 12.0)
    jump = 0.01 * ((TIME_S >= 5.0) & (TIME_S < 12.0))
    swell = 0.01 * np.exp(-(((TIME_S - 8.5) / 3.0) ** 2))
    drive = 2.0 * np.sin(2.0 * np.pi * 0.3 * TIME_S)
    assert load.is_confirmed(TIME_S, drive, noise + jump)
    assert not load.is_confirmed(TIME_S, drive, noise + swell)
    assert not load.is_confirmed(TIME_S, drive, noise)


def test_what_creeps_fast_beside_an_edge_is_no_jump() -> None:
    noise = 1e-3 * np.random.default_rng(0).standard_normal(TIME_S.size)
    drive = 2.0 * np.sin(2.0 * np.pi * 0.3 * TIME_S)
    slope = np.interp(TIME_S, [4.7, 5.3], [0.0, 0.025])
    assert not ExternalLoad(0.0105, 5.0).is_confirmed(TIME_S, drive, noise + slope)


@pytest.mark.parametrize("rise_s", [0.0, 0.02, 0.05])
def test_a_load_that_takes_its_time_is_one(rise_s: float) -> None:
    noise = 1e-3 * np.random.default_rng(0).standard_normal(TIME_S.size)
    drive = 2.0 * np.sin(2.0 * np.pi * 0.3 * TIME_S)
    rise = np.interp(TIME_S, [5.0 - 0.5 * rise_s, 5.0 + 0.5 * rise_s + 1e-3], [0.0, 0.01])
    assert ExternalLoad(0.01, 5.0).is_confirmed(TIME_S, drive, noise + rise)


def test_a_jump_where_the_drive_first_moves_is_its_memory_and_no_load() -> None:
    noise = 1e-3 * np.random.default_rng(0).standard_normal(TIME_S.size)
    load = ExternalLoad(0.01, 5.0)
    jump = 0.01 * (TIME_S >= 5.0)
    first_move = np.interp(TIME_S, [4.98, 10.0], [0.0, 4.0])
    assert not load.is_confirmed(TIME_S, first_move, noise + jump)
    # at rest the jump is no doing of the drive, and later on it is one move of many
    assert load.is_confirmed(TIME_S, np.interp(TIME_S, [6.0, 10.0], [0.0, 4.0]), noise + jump)
    assert load.is_confirmed(TIME_S, np.interp(TIME_S, [3.0, 10.0], [0.0, 4.0]), noise + jump)


def test_a_relaxation_that_no_record_can_show_or_that_takes_away_is_not_plausible() -> None:
    assert SlowRelaxation(0.02, 5.0).is_plausible(60.0, 1e-3)
    assert not SlowRelaxation(0.02, 500.0).is_plausible(60.0, 1e-3)
    assert not SlowRelaxation(0.02, 2e-3).is_plausible(60.0, 1e-3)
    assert not SlowRelaxation(-0.02, 5.0).is_plausible(60.0, 1e-3)


@pytest.mark.parametrize("step_s", [1e-6, 1e-3, 1.2])
def test_a_load_is_confirmed_at_any_sample_rate_and_is_none_where_the_record_begins(step_s: float) -> None:
    time_s = np.arange(3000) * step_s
    noise = 1e-3 * np.random.default_rng(0).standard_normal(time_s.size)
    drive = 2.0 * np.sin(2.0 * np.pi * np.arange(3000) / 900.0)
    jump = 0.01 * (np.arange(3000) >= 1000)
    assert ExternalLoad(0.01, 1000 * step_s).is_confirmed(time_s, drive, noise + jump)
    assert not ExternalLoad(0.01, 1300 * step_s).is_confirmed(time_s, drive, noise + jump)
    assert ExternalLoad(0.01, 1000 * step_s).is_plausible(3000 * step_s, step_s)
    assert not ExternalLoad(0.01, 5 * step_s).is_plausible(3000 * step_s, step_s)


def test_a_gain_in_a_handful_of_samples_is_judged_by_the_noise() -> None:
    rng = np.random.default_rng(1)
    noise = rng.standard_normal(20_000)
    bump = np.zeros(20_000)
    bump[[3000, 9000, 15_000]] = 30.0
    assert held_out_score([noise + bump], [noise]).p_value < 1e-6
    chance = np.zeros(20_000)
    chance[[3000, 9000, 15_000]] = 1.0
    assert held_out_score([noise], [noise - chance]).p_value > 1e-4


@given(st.floats(-0.03, 0.03), st.floats(-0.004, 0.004), st.lists(st.floats(-5.0, 5.0), min_size=1, max_size=20))
def test_unwarp_undoes_the_warp(quadratic: float, cubic: float, drive: list[float]) -> None:
    effect = AsymmetricHysteresis(warp_per_v=quadratic, warp_per_v2=cubic)
    values = np.array(drive)
    np.testing.assert_allclose(effect.unwarp(effect.warp(values)), values, atol=1e-12)


def test_a_warp_that_turns_back_is_refused() -> None:
    with pytest.raises(ParameterError, match="turns back"):
        AsymmetricHysteresis(warp_per_v=-0.5).unwarp(np.array([3.0]))


def test_an_asymmetric_model_is_inverted() -> None:
    form = OperatorSum(1.0, np.array([0.2, 0.9]), np.array([0.15, 0.1]))
    asymmetry = AsymmetricHysteresis((0.0, 0.4), (0.5, -0.3), (0.05, -0.04), 0.01, 5e-4)
    model = PiezoModel(*elements_from_play_form(form), 0.015, (asymmetry,))
    steps = np.full(4000, 1e-3)
    wanted = 1.5 * np.sin(np.arange(4000) * 2e-3)
    followed = model.simulate(steps, Compensator(model).run(steps, wanted))
    assert np.max(np.abs(followed - wanted)) < 1e-5 * np.ptp(wanted)


def test_the_slew_limit_is_exact_whatever_the_step() -> None:
    rng = np.random.default_rng(2)
    corners = np.cumsum(rng.uniform(-1.0, 1.0, 12))
    coarse = np.interp(np.arange(1, 111) * 0.1, np.arange(12) * 1.0, corners)
    fine = np.interp(np.arange(1, 110_001) * 1e-4, np.arange(1, 111) * 0.1, coarse, left=None)
    fine[:1000] = coarse[0] * np.arange(1, 1001) / 1000.0
    effect = AmplifierSlewLimit(0.4)
    by_step = effect.run(effect.initial_state(), coarse, np.full(110, 0.1))
    output, brute = 0.0, np.empty(fine.size)
    for k, value in enumerate(fine):
        output += min(max(value - output, -0.4e-4), 0.4e-4)
        brute[k] = output
    np.testing.assert_allclose(by_step, brute[999::1000], atol=2e-4)


def test_loops_are_counted_by_kind_not_by_number() -> None:
    t = np.arange(20_000) / 500.0
    sine = 1.8 - 1.8 * np.cos(2.0 * np.pi * t)
    noisy = sine + np.random.default_rng(1).normal(0.0, 5e-3, t.size)
    assert n_loop_kinds([sine]) <= n_loop_kinds([noisy]) <= 4
    assert n_loop_kinds([sine, sine]) == n_loop_kinds([sine])
    fading = 1.8 + 1.8 * np.exp(-t / 15.0) * np.cos(2.0 * np.pi * t)
    stairs = np.repeat(np.random.default_rng(2).uniform(0.0, 3.6, 40), 500)
    assert n_loop_kinds([sine]) < n_loop_kinds([fading]) < n_loop_kinds([fading, stairs])
    assert n_loop_kinds([np.ones(10)]) == 0

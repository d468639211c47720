"""The hysteresis of the second truth, against its definitions and its laws."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from test.hidden.second.bouc_wen import BoucWen
from test.hidden.second.plays import GeneralisedPlays, PlayStack, RateDependentPlays, play_outputs
from test.hidden.second.preisach import PreisachPlane, discretised, gaussian_density, grid, lorentzian_density

Run = Callable[[np.ndarray], np.ndarray]


def _stack(seed: int = 1) -> PlayStack:
    rng = np.random.default_rng(seed)
    return PlayStack(0.4, np.sort(rng.uniform(0.02, 0.9, 12)), rng.uniform(0.01, 0.1, 12))


def _plane(kind: str) -> PreisachPlane:
    edges_v, up, down = grid(1.2)
    if kind == "gaussian":
        density = gaussian_density(up, down, coercive_v=0.2, spread_v=0.4, correlation=0.3, bias_v=0.05)
    else:
        density = lorentzian_density(up, down, coercive_v=0.15, spread_v=0.2)
    return discretised(density, 1.5, 0.7, edges_v)


def _fine(turns: list[float], n: int = 40) -> np.ndarray:
    return np.interp(np.arange((len(turns) - 1) * n + 1) / n, np.arange(len(turns)), turns)


_RANDOM_TURNS = [0.0, *np.random.default_rng(4).uniform(-1.0, 1.0, 60).tolist()]


def test_stack_by_its_loading_is_the_plays_one_by_one() -> None:
    stack, drive = _stack(), _fine(_RANDOM_TURNS)
    plays = np.zeros(stack.thresholds_v.size)
    expected = np.empty(drive.size)
    for k, u in enumerate(drive):
        plays = np.clip(plays, u - stack.thresholds_v, u + stack.thresholds_v)
        expected[k] = stack.slope_um_per_v * u + stack.weights_um_per_v @ plays
    # The state relaxed by 4000 reversals is that of plays at rest but for half a swing.
    assert np.max(np.abs(stack.run(drive) - expected)) < 3e-5
    columns = play_outputs(drive, stack.thresholds_v)
    assert columns @ stack.weights_um_per_v + stack.slope_um_per_v * drive == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("kind", ["gaussian", "lorentzian"])
def test_everett_function_is_the_sum_of_relays(kind: str) -> None:
    plane = _plane(kind)
    rng = np.random.default_rng(0)
    n = plane.content_um.shape[0]
    cell = plane.edges_v[1] - plane.edges_v[0]
    fine = plane.edges_v[0] + (np.arange(20 * n) + 0.5) * cell / 20
    up, down = np.meshgrid(fine, fine, indexing="ij")
    density = np.repeat(np.repeat(plane.content_um, 20, 0), 20, 1) / 400.0
    i, j = (np.arange(20 * n) // 20,) * 2
    density = np.where((i[:, None] == j) & (up > down), 2.0 * density, np.where(up > down, density, 0.0))
    density += np.where(up == down, np.repeat(np.diag(plane.content_um), 20)[:, None] / 400.0, 0.0)
    low, high = np.sort(rng.uniform(-1.0, 1.0, (2, 12)), axis=0)
    summed = [np.sum(density[(up <= h) & (down >= b)]) for h, b in zip(high, low, strict=True)]
    assert plane.everett_um(high, low) == pytest.approx(np.array(summed), abs=4e-3)
    assert plane.everett_um(high, high) == pytest.approx(np.zeros(12), abs=1e-15)


@pytest.mark.parametrize("kind", ["gaussian", "lorentzian", "stack"])
def test_larger_reversals_wipe_out_the_smaller(kind: str) -> None:
    run = _stack().run if kind == "stack" else _plane(kind).run
    short = run(np.array([0.0, 0.9, -0.8, 0.85]))
    detour = run(np.array([0.0, 0.9, -0.8, 0.3, -0.2, 0.1, -0.1, 0.2, 0.0, 0.85]))
    assert detour[-1] == pytest.approx(short[-1], abs=1e-12)
    passed = run(np.array([0.0, 0.5, -0.3, 0.2, -0.7, 1.0, 0.4]))
    direct = run(np.array([0.0, 1.0, 0.4]))
    assert passed[-1] - passed[-2] == pytest.approx(direct[-1] - direct[-2], abs=1e-12)


@pytest.mark.parametrize("kind", ["gaussian", "lorentzian", "stack"])
def test_loops_between_the_same_extremes_are_congruent(kind: str) -> None:
    run = _stack().run if kind == "stack" else _plane(kind).run
    loop = np.array([0.4, 0.1, -0.2, 0.1, 0.4])
    from_above = run(np.concatenate([[0.0, -1.0, 1.0, -0.2], loop]))[-5:]
    from_below = run(np.concatenate([[0.0, 1.0, -1.0], loop]))[-5:]
    assert from_above[0] - from_below[0] != pytest.approx(0.0, abs=1e-3)
    assert from_above - from_above[0] == pytest.approx(from_below - from_below[0], abs=1e-12)
    assert from_above[-1] == pytest.approx(from_above[0], abs=1e-12)  # closed


@pytest.mark.parametrize("kind", ["gaussian", "lorentzian", "stack", "bouc_wen", "generalised"])
def test_neither_time_nor_the_number_of_samples_matters(kind: str) -> None:
    run = _of(kind)
    coarse = run(np.array(_RANDOM_TURNS))
    fine = run(_fine(_RANDOM_TURNS, 17))
    assert np.max(np.abs(fine[::17] - coarse)) < 1e-9
    slowed = run(np.repeat(np.array(_RANDOM_TURNS), 3))
    assert np.max(np.abs(slowed[::3] - coarse)) < 1e-9


def _of(kind: str) -> Run:
    if kind == "bouc_wen":
        return BoucWen(1.0, 0.15, 0.3, 1.4, 0.7, 0.2).run
    if kind == "generalised":
        stack = _stack()
        plays = (0.4, stack.thresholds_v, stack.weights_um_per_v)
        return GeneralisedPlays(*plays, 1.0, (0.1, 0.05), -0.1).run
    return _stack().run if kind == "stack" else _plane(kind).run


@pytest.mark.parametrize("exponent", [1.0, 1.6, 3.0])
def test_bouc_wen_solves_its_equation(exponent: float) -> None:
    loops = BoucWen(1.0, 0.2, 0.3, exponent, 0.8, -0.3)
    turns = [0.0, 0.9, -0.7, 0.5, -0.2, 0.4, -1.0]
    drive = _fine(turns)
    z, expected = 0.0, [0.0]
    for start, end in itertools.pairwise(turns):
        du = (end - start) / 0.3

        def rate(_: float, y: np.ndarray, du: float = du) -> np.ndarray:
            return du * (1.0 - np.abs(y) ** exponent * (-0.3 + 0.8 * np.sign(y * du)))

        along = solve_ivp(rate, (0.0, 1.0), [z], t_eval=np.arange(1, 41) / 40, rtol=1e-10, atol=1e-12)
        expected += along.y[0].tolist()
        z = expected[-1]
    assert np.max(np.abs(loops.run(drive) - (drive - 0.2 * np.array(expected)))) < 1e-7


def test_plays_that_widen_with_the_rate_lag_more_when_fast() -> None:
    stack = PlayStack(0.0, np.array([0.1]), np.array([1.0]))
    cycle = _fine([0.0, 1.0, -1.0, 1.0], 500)
    slow = RateDependentPlays(stack, 0.2, 1e3).run(cycle)
    assert np.max(np.abs(slow - play_outputs(cycle, stack.thresholds_v)[:, 0])) < 1e-5
    step_s = 1e-3  # the last sweep goes at 4 V/s: half width 0.1 (1 + 0.2 * 4)
    fast = RateDependentPlays(stack, 0.2, step_s).run(cycle)
    assert fast[-1] == pytest.approx(1.0 - 0.18, abs=1e-9)


def test_generalised_plays_follow_their_envelopes() -> None:
    loops = GeneralisedPlays(0.0, np.array([0.2]), np.array([1.0]), 1.0, (0.1, 0.05), 0.3)
    out = loops.run(_fine([0.0, 1.0, -1.0], 100))
    assert out[100] == pytest.approx(1.15 - 0.3 - 0.2)  # widest at the upper end
    assert out[-1] == pytest.approx(-1.0 * (1.0 - 0.1 + 0.05) + 0.2)  # not widened at the lower

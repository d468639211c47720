"""The third world's hysteresis and creep against brute force."""

from __future__ import annotations

import numpy as np
import pytest

from test.hidden.third.creep_kernel import power_law
from test.hidden.third.masing import masing
from test.hidden.third.other_forms import OTHER_FORMS
from test.hidden.third.path_dynamics import domain_walls
from test.hidden.third.virgin_curves import FAMILIES, VirginCurve

_CURVES = [VirginCurve(family, 0.01, 0.006, 30.0, 1.8) for family in FAMILIES]


def _path(seed: int, n_turns: int = 60, n_between: int = 9) -> np.ndarray:
    turns = np.concatenate([[0.0], np.random.default_rng(seed).uniform(-100.0, 100.0, n_turns)])
    return np.interp(np.arange(n_turns * n_between + 1) / n_between, np.arange(n_turns + 1), turns)


@pytest.mark.parametrize("curve", _CURVES, ids=FAMILIES)
def test_a_branch_of_masing_is_a_sum_of_plays(curve: VirginCurve) -> None:
    voltage_v = _path(1)
    edges_v = np.linspace(0.0, 110.0, 4001)
    thresholds_v, weights = 0.5 * (edges_v[1:] + edges_v[:-1]), np.diff(curve.slope(edges_v))
    at_v, expected = np.zeros_like(thresholds_v), []
    for value in voltage_v:
        at_v = np.clip(at_v, value - thresholds_v, value + thresholds_v)
        expected.append(curve.slope_um_per_v * value + weights @ at_v)
    np.testing.assert_allclose(masing(voltage_v, curve), expected, atol=3e-5 * np.ptp(expected))


@pytest.mark.parametrize("curve", _CURVES, ids=FAMILIES)
def test_what_a_larger_loop_closes_is_forgotten(curve: VirginCurve) -> None:
    plain = np.array([0.0, 80.0, -40.0, 60.0, 20.0])
    # Two loops on the way up from -40, of which nothing is left beyond their turns; the second lies in the first.
    with_loops = np.array([0.0, 80.0, -40.0, 10.0, -30.0, 5.0, -20.0, 60.0, 20.0])
    assert masing(with_loops, curve)[[-2, -1]] == pytest.approx(masing(plain, curve)[[-2, -1]], rel=1e-12)
    returned = masing(np.array([0.0, 80.0, 30.0, 55.0, 30.0, 70.0, 30.0]), curve)
    assert returned[4] == pytest.approx(returned[2], rel=1e-12)
    assert returned[6] == pytest.approx(returned[2], rel=1e-12)


def test_loops_between_the_same_voltages_are_congruent_and_other_forms_are_not() -> None:
    curve = _CURVES[0]
    # The same excursion by 20 V back from a rising and from a falling branch.
    path = [*np.linspace(0.0, -100.0, 200), *np.linspace(-100.0, 0.0, 200), *np.linspace(0.0, -20.0, 80)]
    path += [*np.linspace(-20.0, 100.0, 300), *np.linspace(100.0, -20.0, 300), *np.linspace(-20.0, 0.0, 80)]
    path += [*np.linspace(0.0, -20.0, 80)]
    voltage_v = np.array(path)

    def heights(response: np.ndarray) -> tuple[float, float]:
        return float(response[399] - response[479]), float(response[-81] - response[-1])

    first, second = heights(masing(voltage_v, curve))
    assert first == pytest.approx(second, rel=1e-9)
    for form in OTHER_FORMS.values():
        first, second = heights(form(voltage_v, curve, 100.0))
        assert abs(first - second) > 1e-3 * first


@pytest.mark.parametrize("order", [0.004, 0.02, 0.08])
def test_creep_is_the_power_law_to_a_thousandth(order: float) -> None:
    step_s, duration_s = 1e-4, 60.0
    modes = power_law(order, 1e-2, step_s, duration_s)
    time_s = np.geomspace(0.1 * step_s, duration_s, 500)
    np.testing.assert_allclose(modes.step_response(time_s), (time_s / 1e-2) ** order, rtol=1e-3)
    # A ramp's response is the law's integral, t^(1 + order) / (1 + order), also on the grid.
    ramp_s = step_s * np.arange(20_000)
    wanted = ramp_s[1:] * (ramp_s[1:] / 1e-2) ** order / (1.0 + order)
    np.testing.assert_allclose(modes.respond(ramp_s, step_s)[1:], wanted, rtol=1e-3)


def test_domain_walls_at_rest_are_a_masing_response_and_widen_by_the_rate() -> None:
    curve = _CURVES[3]
    time_s = np.arange(3001) * 1e-3
    triangle_v = np.interp(time_s, [0.0, 1.0, 2.0, 3.0], [0.0, 100.0, 0.0, 100.0])
    slow = domain_walls(triangle_v, curve, 100.0, 0.0, 1e-3)
    np.testing.assert_allclose(slow, masing(triangle_v, curve), atol=2e-3 * np.ptp(slow))

    def wide(scale: float) -> VirginCurve:
        return VirginCurve(curve.family, curve.slope_um_per_v, curve.bend_um_per_v, curve.knee_v * scale)

    # At 100 V/s and 2 ms/V thresholds are wider by a fifth, up and down.
    fast = domain_walls(triangle_v, curve, 100.0, 2e-3, 1e-3)
    np.testing.assert_allclose(fast, masing(triangle_v, wide(1.2)), atol=2e-3 * np.ptp(slow))
    assert np.max(np.abs(fast - slow)) > 5e-3 * np.ptp(slow)

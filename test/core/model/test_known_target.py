"""Targets on even samples: limited without a shift, resampled without a loss, refused where they cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.errors import ParameterError
from fomrc_core.model.known_target import KnownTarget, known_target

STEP_S = 1e-3


def even(desired_um: np.ndarray, **told: float | bool) -> KnownTarget:
    return known_target(STEP_S * np.arange(desired_um.size), desired_um, **told)  # type: ignore[arg-type]


def sine(frequency_hz: float, n_samples: int, phase: float = 0.0) -> np.ndarray:
    return np.sin(2.0 * np.pi * frequency_hz * STEP_S * np.arange(n_samples) + phase)


def test_a_bandwidth_leaves_what_is_below_half_of_it_and_nothing_above_it() -> None:
    slow, fast = sine(10.0, 1000, 0.4), sine(60.0, 1000)
    limited = even(slow + fast, bandwidth_hz=50.0, is_periodic=True)
    np.testing.assert_allclose(limited.desired_um, slow, atol=1e-12)
    assert limited.taken_off_um == pytest.approx(1.0, rel=1e-2)


def test_a_limited_course_is_not_shifted_in_time() -> None:
    since_s = STEP_S * np.arange(2001) - 1.0
    pulse = np.exp(-0.5 * (since_s / 0.005) ** 2)
    limited = even(pulse, bandwidth_hz=40.0).desired_um
    np.testing.assert_allclose(limited, limited[::-1], atol=1e-12)
    assert int(np.argmax(limited)) == 1000


@pytest.mark.parametrize("is_periodic", [False, True])
def test_a_sine_resampled_is_that_sine(is_periodic: bool) -> None:
    target = even(sine(20.0, 1000, 0.3), rate_hz=10_000.0, is_periodic=is_periodic)
    assert target.step_s == pytest.approx(1e-4, rel=1e-12)
    np.testing.assert_allclose(target.desired_um, np.sin(2.0 * np.pi * 20.0 * target.time_s + 0.3), atol=2e-5)
    assert target.desired_um.size == (10_000 if is_periodic else 9991)


def test_a_coarser_rate_leaves_out_what_it_does_not_hold() -> None:
    target = even(sine(5.0, 1000) + sine(180.0, 1000), rate_hz=200.0, is_periodic=True)
    np.testing.assert_allclose(target.desired_um, np.sin(2.0 * np.pi * 5.0 * target.time_s), atol=1e-3)
    assert target.taken_off_um > 0.9


def test_a_period_keeps_its_length_at_a_rate_that_does_not_divide_it() -> None:
    target = even(sine(10.0, 100), rate_hz=3333.0, is_periodic=True)
    assert target.desired_um.size == 333
    assert target.desired_um.size * target.step_s == pytest.approx(0.1, rel=1e-12)


def test_uneven_samples_are_resampled_or_refused() -> None:
    time_s = np.sort(np.random.default_rng(0).uniform(0.0, 1.0, 400))
    desired_um = np.sin(2.0 * np.pi * time_s)
    with pytest.raises(ParameterError, match=r"not evenly spaced: after sample \d+.*--rate HZ"):
        known_target(time_s, desired_um)
    target = known_target(time_s, desired_um, rate_hz=500.0)
    np.testing.assert_allclose(target.desired_um, np.sin(2.0 * np.pi * target.time_s), atol=1e-3)


def test_a_last_row_that_repeats_the_first_is_seen() -> None:
    assert not even(sine(10.0, 100), is_periodic=True).rests_at_seam
    assert even(np.append(sine(10.0, 100), 0.0), is_periodic=True).rests_at_seam


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"bandwidth_hz": 201.0}, "bandwidth_hz: out of range, got 201.0 .*at most 200 Hz"),
        ({"bandwidth_hz": 0.0}, "bandwidth_hz"),
        ({"bandwidth_hz": float("nan")}, "bandwidth_hz"),
        ({"rate_hz": -1.0}, "rate_hz"),
        ({"rate_hz": 1e12}, "rate_hz"),
        ({"rate_hz": 1e-3}, "rate_hz"),
    ],
)
def test_rates_and_bandwidths_out_of_range_are_refused(told: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        even(sine(10.0, 100), **told)

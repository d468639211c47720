"""Linear terms: what a mode is, what of it is inverted, and that its memory moves as one."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.effects.charge_leak import ChargeLeak
from fomrc_core.effects.drive_resonance import DriveResonance
from fomrc_core.effects.unnamed_drive import UnnamedDrive
from fomrc_core.errors import ParameterError

_STEP_S = 2e-3


def drive_v(n: int = 1500) -> np.ndarray:
    rng = np.random.default_rng(1)
    return np.asarray(np.sin(0.03 * np.arange(n)) + np.repeat(rng.normal(size=n // 30), 30))


def answered(effect, values: np.ndarray) -> np.ndarray:
    return effect.run(effect.initial_state(), values, np.full(values.size, _STEP_S))


def test_a_leak_is_one_term_and_a_resonance_two() -> None:
    v = drive_v()
    leak = UnnamedDrive((-1.0,), (1.0 / 0.3,), (0.0,), (0.0,))
    np.testing.assert_allclose(answered(leak, v), answered(ChargeLeak(0.3), v), atol=1e-12)
    omega, damping = 2.0 * np.pi * 20.0, 0.3
    decay, swing = damping * omega, np.sqrt(1.0 - damping**2) * omega
    # w^2 / (s^2 + 2 d w s + w^2) is the real part of p / (p - s) and d / sqrt(1 - d^2) of what is a quarter behind it
    share = damping / np.sqrt(1.0 - damping**2)
    found = UnnamedDrive((1.0, share), (decay, decay), (swing, swing), (1.0, 2.0))
    same = UnnamedDrive((1.0, -share), (decay, decay), (swing, swing), (1.0, 2.0))
    wanted = answered(DriveResonance(20.0, damping), v)
    assert min(np.max(np.abs(answered(each, v) - wanted)) for each in (found, same)) < 1e-10


def test_its_response_is_that_of_a_slow_sine() -> None:
    effect = UnnamedDrive((-0.2, 0.4, 0.3), (3.0, 80.0, 80.0), (0.0, 200.0, 200.0), (0.0, 1.0, 2.0))
    t = _STEP_S * np.arange(8000)
    frequency = 2.0
    found = answered(effect, np.sin(2.0 * np.pi * frequency * t))[4000:]
    waves = np.exp(-2j * np.pi * frequency * t[4000:])
    gain = 2j * np.mean(found * waves)
    assert gain == pytest.approx(complex(effect.response(np.array([frequency]))[0]), abs=2e-3)


@pytest.mark.parametrize("step_s", [1e-4, 2e-3, 0.1])
def test_what_is_inverted_is_undone_at_any_sample_rate(step_s: float) -> None:
    effect = UnnamedDrive((-0.3, 0.4, 0.1), (3.0, 80.0, 80.0), (0.0, 200.0, 200.0), (0.0, 1.0, 2.0))
    assert effect.can_invert
    v, steps = drive_v(), np.full(1500, step_s)
    wanted = effect.run(effect.initial_state(), v, steps)
    again = effect.invert(effect.initial_state(), wanted, steps)
    np.testing.assert_allclose(again, v, atol=1e-9)


def test_what_lets_nothing_through_at_once_or_turns_too_far_is_not_inverted() -> None:
    assert not UnnamedDrive((1.0,), (50.0,), (0.0,), (1.0,)).can_invert
    assert not UnnamedDrive((0.9,), (5.0,), (300.0,), (1.0,)).can_invert
    assert UnnamedDrive((-1.0,), (3.0,), (0.0,), (0.0,)).can_invert


def test_terms_of_one_mode_move_together() -> None:
    effect = UnnamedDrive((0.1, 0.2, 0.3), (3.0, 80.0, 80.0), (0.0, 200.0, 200.0), (0.0, 1.0, 2.0))
    logs = effect.memory()
    np.testing.assert_allclose(np.exp(logs), [3.0, 80.0, 200.0])
    moved = effect.with_memory(logs + np.log([2.0, 1.0, 3.0]))
    assert moved.decays_per_s == pytest.approx((6.0, 80.0, 80.0))
    assert moved.swings_per_s == pytest.approx((0.0, 600.0, 600.0))
    assert moved.weights == effect.weights


def test_lists_of_other_lengths_are_refused() -> None:
    with pytest.raises(ParameterError, match="as many as there are weights"):
        UnnamedDrive((0.1,), (3.0, 4.0), (0.0,), (0.0,))

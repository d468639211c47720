"""Kernels for steps in a few parts against those for samples: the same, to rounding, for whatever parts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fomrc_core.operators.creep import PREVIOUS, creep_block, creep_modes, integrate_step, mode_states
from fomrc_core.operators.creep_batch import integrate, integrate_parts
from fomrc_core.operators.hysteresis import (
    OperatorSum,
    hysteresis_block,
    move_plays,
    move_plays_at_once,
    move_plays_batch,
    move_widened_plays_batch,
    play_states,
)


def _steps_s(rng: np.random.Generator, n: int, kind: str) -> np.ndarray:
    if kind == "alike":
        return np.full(n, 1e-3)
    if kind == "jittering":  # no step length comes again
        return rng.uniform(0.5e-3, 2e-3, n)
    parts = rng.integers(1, 21, n)  # more lengths than are kept
    return np.repeat(1e-3 / parts, parts)[:n]


@settings(deadline=None, max_examples=40)  # the first call compiles
@given(
    seed=st.integers(0, 10_000),
    order=st.sampled_from([0.0, 0.02, 0.4, 1.0]),
    n=st.integers(1, 700),
    kind=st.sampled_from(["alike", "jittering", "parts"]),
)
def test_creep_of_parts_is_that_of_samples(seed: int, order: float, n: int, kind: str) -> None:
    rng = np.random.default_rng(seed)
    values, steps_s = np.cumsum(rng.normal(size=n)), _steps_s(rng, n, kind)
    one, other = (creep_block(creep_modes(order)) for _ in range(2))
    wanted = np.array([integrate_step(one, 0, v, dt) for v, dt in zip(values, steps_s, strict=True)])
    found = values.copy()
    integrate_parts(other, 0, found, steps_s, found)
    size = float(np.max(np.abs(wanted)))
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-11 * size)
    np.testing.assert_allclose(mode_states(other), mode_states(one), rtol=1e-9, atol=1e-11 * size)
    assert other[PREVIOUS] == one[PREVIOUS]


def test_it_goes_on_by_the_sample_and_leaves_nothing_that_is_slow_to_reckon_with() -> None:
    rng = np.random.default_rng(3)
    steps_s, values = _steps_s(rng, 900, "parts"), np.concatenate((rng.normal(size=300), np.zeros(600)))
    one, other = (creep_block(creep_modes(0.05)) for _ in range(2))
    out, parts = np.empty(900), np.empty(900)
    integrate(one, 0, values, steps_s, out)
    integrate_parts(other, 0, values, steps_s, parts)
    for block in (one, other):
        assert not np.any((mode_states(block) != 0.0) & (np.abs(mode_states(block)) < 1e-290))
    after = [integrate_step(block, 0, 1.0, 7e-4) for block in (one, other)]
    assert after[0] == pytest.approx(after[1], rel=1e-11)


@settings(deadline=None, max_examples=40)  # the first call compiles
@given(seed=st.integers(0, 10_000), n_plays=st.integers(0, 40), n=st.integers(1, 300))
def test_plays_at_once_are_plays_one_by_one(seed: int, n_plays: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    form = OperatorSum(0.7, np.sort(rng.uniform(0.01, 5.0, n_plays)), rng.normal(size=n_plays))
    values = np.cumsum(rng.normal(size=n))
    steps, batch, whole, widened = (hysteresis_block(form) for _ in range(4))
    one_by_one, factors = hysteresis_block(form), rng.uniform(0.5, 2.0, n)
    wanted = np.array([move_plays(steps, 0, value) for value in values])
    out = np.empty((3, n))
    move_plays_batch(batch, 0, values, out[0])
    move_plays_at_once(whole, 0, values, np.empty(0), out[1])
    move_plays_at_once(widened, 0, values, np.ones(n), out[2])
    size = 1.0 + float(np.max(np.abs(wanted)))
    np.testing.assert_allclose(out, np.broadcast_to(wanted, out.shape), rtol=0.0, atol=1e-13 * size)
    assert np.array_equal(out[1], out[2]), "factors of one change no bit"
    for block in (batch, whole, widened):
        assert np.array_equal(play_states(block), play_states(steps))
    move_widened_plays_batch(one_by_one, 0, values, factors, out[0])
    move_plays_at_once(whole := hysteresis_block(form), 0, values, factors, out[1])
    np.testing.assert_allclose(out[1], out[0], rtol=0.0, atol=1e-13 * (1.0 + float(np.max(np.abs(out[0])))))
    assert np.array_equal(play_states(whole), play_states(one_by_one))

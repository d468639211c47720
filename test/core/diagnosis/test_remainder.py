"""What is left: noise of any colour follows from nothing, a missed cause from what it is made of."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from fomrc_core.diagnosis.remainder import DrivenRecord, dependences

_N = 6000


def drive(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    time_s = np.arange(_N) * 2e-3
    levels = rng.uniform(0.0, 10.0, 41)
    return time_s, np.interp(np.arange(_N), np.linspace(0, _N, 41), levels)


def coloured(rng: np.random.Generator, rho: float) -> np.ndarray:
    return lfilter([np.sqrt(1.0 - rho**2)], [1.0, -rho], rng.standard_normal(_N + 500))[500:]


def record(time_s: np.ndarray, voltage_v: np.ndarray, residual_um: np.ndarray) -> DrivenRecord:
    return DrivenRecord(time_s, voltage_v, 1.2 * voltage_v, residual_um, np.ones(_N, dtype=np.bool_))


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.95])
def test_noise_of_any_colour_follows_from_nothing(rho):
    p_values = []
    for seed in range(40):
        rng = np.random.default_rng(900 + seed)
        time_s, voltage_v = drive(rng)
        p_values += [d.p_value for d in dependences([record(time_s, voltage_v, coloured(rng, rho))])]
    # 240 tests, dependent within a record: 1 % would be 2.4, three standard deviations more are 7.1
    assert np.count_nonzero(np.array(p_values) < 0.01) <= 7


@pytest.mark.parametrize(
    ("on", "signal"),
    [
        ("rate", lambda t, v: np.gradient(v, t)),
        ("displacement", lambda t, v: (v - 5.0) ** 3),
        ("past of the drive", lambda t, v: v - lfilter([0.01], [1.0, -0.99], v)),
    ],
)
def test_what_was_missed_is_seen_in_what_it_is_made_of(on, signal):
    p_values, shares = [], []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        time_s, voltage_v = drive(rng)
        missed = signal(time_s, voltage_v)
        missed = 0.5 * (missed - missed.mean()) / np.std(missed)
        found = {d.on: d for d in dependences([record(time_s, voltage_v, coloured(rng, 0.5) + missed)])}
        p_values.append(found[on].p_value)
        shares.append(found[on].share)
    assert np.median(p_values) < 0.01
    # a quarter beside one of noise is a fifth of the power
    assert 0.1 < np.median(shares) < 0.3


def test_the_size_of_the_units_does_not_matter():
    rng = np.random.default_rng(5)
    time_s, voltage_v = drive(rng)
    residual = coloured(rng, 0.3) + 0.3 * np.gradient(voltage_v, time_s)
    small = dependences([record(time_s, voltage_v, residual)])
    large = dependences([record(1e4 * time_s, 1e3 * voltage_v, 1e-6 * residual)])
    for one, other in zip(small, large, strict=True):
        assert other.p_value == pytest.approx(one.p_value, rel=1e-6)
        assert other.share == pytest.approx(one.share, rel=1e-6)

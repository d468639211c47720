"""Random models and signals for property tests, exact ties and repeated values among them."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

Array = NDArray[np.float64]


@st.composite
def elements(draw: st.DrawFn, *, least: int = 0, most: int = 12) -> tuple[Array, Array]:
    """Gains [um/V] over three decades and saturations [V]; thresholds come from few values, so they tie."""
    n = draw(st.integers(least, most))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    kappa = 10.0 ** rng.uniform(-1.0, 2.0, n + 1)
    if draw(st.booleans()):
        kappa[:n] = 2.0 ** rng.integers(-2, 5, n)  # products with powers of two are exact: exact ties
        saturation = rng.choice([0.0625, 0.125, 0.25, 0.5], n)
    else:
        saturation = rng.choice(rng.uniform(0.02, 2.0, max(n // 2, 1)), n) / kappa[:n]
    return kappa, saturation


@st.composite
def steps(draw: st.DrawFn, n_samples: int) -> Array:
    """Step lengths [s]: uniform, two alternating, jittered, or spread over five decades."""
    kind = draw(st.sampled_from(["uniform", "alternating", "jittered", "spread"]))
    base = draw(st.sampled_from([1e-4, 1e-3, 7e-3, 1.0]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    if kind == "uniform":
        return np.full(n_samples, base)
    if kind == "alternating":
        return np.where(np.arange(n_samples) % 2 == 0, base, 1.5 * base)
    if kind == "jittered":
        return base * rng.uniform(0.7, 1.3, n_samples)
    return base * 10.0 ** rng.uniform(-2.0, 3.0, n_samples)


@st.composite
def signals(draw: st.DrawFn, *, most: int = 300, scale: float = 2.0) -> Array:
    """Random walks, jumps between few levels (repeats and exact returns), triangles; shape (n_samples,)."""
    n = draw(st.integers(2, most))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    kind = draw(st.sampled_from(["walk", "levels", "triangle"]))
    if kind == "walk":
        walk = np.cumsum(rng.standard_normal(n))
        return scale * walk / np.max(np.abs(walk))
    if kind == "levels":
        return scale * rng.integers(-8, 9, n) / 8.0
    k = np.arange(n)
    return scale * (1.0 - k / (2.0 * n)) * (2.0 * np.abs((k / 40.0) % 2.0 - 1.0) - 1.0)


def relative(found: Array, wanted: Array) -> float:
    """Largest difference over the largest wanted value."""
    return float(np.max(np.abs(found - wanted)) / max(np.max(np.abs(wanted)), 1e-300))

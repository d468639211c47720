"""Stages of several axes of another form than the library's: masses, springs and Bouc-Wen springs at the drives.

    M x'' + C x' + K x = B f(u),   f = u - h,   h' = a u' (1 - |h / h0| (0.5 sign(u' h) + 0.5)),

solved by scipy as a state space with held drives. Nothing here is of the library.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.signal
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATE_HZ = 4000.0
N_SAMPLES = 2048
N_LINES = 900
NOISE = 0.005


@dataclass(frozen=True)
class Stage:
    """A stage: matrices of the state space, what its modes truly are, and the springs' shares at the drives."""

    a: Array
    b: Array
    c: Array
    frequency_hz: Array
    damping: Array
    spring: tuple[float, float]


def stage(n_axes: int, seed: int) -> Stage:
    """Return a random stage with one mode for each axis, spread over 150 to 1500 Hz, damped by 0.5 to 2 %."""
    rng = np.random.default_rng(seed)
    hz = 150.0 * (10.0 ** ((np.arange(n_axes) + rng.uniform(0.1, 0.6, n_axes)) / n_axes))
    turn = scipy.linalg.expm(_skew(rng, n_axes, 0.5))
    omega = 2.0 * np.pi * hz
    stiffness = turn @ np.diag(omega**2) @ turn.T
    spread = _skew(rng, n_axes, 0.1)
    zeta = rng.uniform(0.005, 0.02, n_axes)
    damper = turn @ (np.diag(2.0 * zeta * omega) + spread @ spread.T) @ turn.T
    drive = np.diag(omega**2) @ (np.eye(n_axes) + 0.1 * rng.normal(size=(n_axes, n_axes)))
    zero, one = np.zeros((n_axes, n_axes)), np.eye(n_axes)
    a = np.block([[zero, one], [-stiffness, -damper]])
    b = np.vstack([zero, drive])
    poles = scipy.linalg.eigvals(a)
    poles = poles[poles.imag > 0]
    poles = poles[np.argsort(np.abs(poles))]
    return Stage(a, b, np.hstack([one, zero]), np.abs(poles) / (2.0 * np.pi), -poles.real / np.abs(poles), (0.05, 0.3))


def at_level(truth: Stage, change: float) -> Stage:
    """Return the stage with springs by which all its frequencies are changed, relatively, and what its modes then are.

    Dampers stay, so that damping changes the other way.
    """
    n = truth.b.shape[1]
    a = truth.a.copy()
    a[n:, :n] *= (1.0 + change) ** 2
    poles = scipy.linalg.eigvals(a)
    poles = poles[poles.imag > 0]
    poles = poles[np.argsort(np.abs(poles))]
    return Stage(a, truth.b, truth.c, np.abs(poles) / (2.0 * np.pi), -poles.real / np.abs(poles), truth.spring)


def _skew(rng: np.random.Generator, n: int, size: float) -> Array:
    upper = np.triu(rng.normal(size=(n, n)), 1) * size
    return upper - upper.T


def multisine(n_axes: int, rms_v: float, seed: int) -> Array:
    """Return a random-phase multisine for each axis, (N_SAMPLES, n_axes)."""
    rng = np.random.default_rng(seed)
    spectrum = np.zeros((N_SAMPLES // 2 + 1, n_axes), complex)
    spectrum[1 : N_LINES + 1] = np.exp(2j * np.pi * rng.random((N_LINES, n_axes)))
    u = np.fft.irfft(spectrum, n=N_SAMPLES, axis=0)
    return u / u.std(axis=0) * rms_v


def bouc_wen(u: Array, spring: tuple[float, float]) -> Array:
    """Return what hysteretic springs take for drives u, (n, n_axes), each jump in closed form."""
    slope, most = spring[0], spring[0] * spring[1]
    h, last = np.zeros(u.shape[1]), np.zeros(u.shape[1])
    out = np.empty_like(u)
    for k, now in enumerate(u):
        way, sense = np.abs(now - last), np.sign(now - last)
        along = sense * h
        # springs let go along a line, and bend once they are stretched the other way
        back = np.minimum(way, np.maximum(-along, 0.0) / slope)
        along = along + slope * back
        bent = most - (most - along) * np.exp(-slope * (way - back) / most)
        along = np.where(way > back, bent, along)
        h, last = sense * along, now
        out[k] = h
    return out


def record(
    truth: Stage, rms_v: float, seed: int, *, n_periods: int = 2, noise: float = NOISE, delay_s: float = 0.0
) -> tuple[Array, Array]:
    """Return drives and displacements in steady state, (N_SAMPLES, n_axes, n_periods); delays under a sample."""
    n_axes = truth.b.shape[1]
    u = multisine(n_axes, rms_v, seed)
    long = np.tile(u, (n_periods + 2, 1))
    force = long - bouc_wen(long, truth.spring)
    direct = np.zeros((n_axes, n_axes))
    # a hold that begins late: the rest of the one before it, then itself, each held over its part of the sample
    step_s = 1.0 / RATE_HZ
    whole, late = (
        scipy.signal.cont2discrete((truth.a, truth.b, truth.c, direct), t, method="zoh")
        for t in (step_s, step_s - delay_s)
    )
    before = np.vstack([np.zeros((1, n_axes)), force[:-1]])
    drives = np.hstack([whole[1] - late[1], late[1]])
    system = (whole[0], drives, truth.c, np.zeros((n_axes, 2 * n_axes)), step_s)
    _, y = scipy.signal.dlsim(system, np.hstack([before, force]))[:2]
    y = y[2 * N_SAMPLES :]
    y = y + noise * y.std(axis=0) * np.random.default_rng(seed + 10_000).normal(size=y.shape)
    shape = (n_periods, N_SAMPLES, n_axes)
    return long[2 * N_SAMPLES :].reshape(shape).transpose(1, 2, 0), y.reshape(shape).transpose(1, 2, 0)

"""Hidden causes in stages of three axes, each axis two masses on springs with a Bouc-Wen spring at its drive.

    M x'' + C x' + K x + K3 (x_flexure)^3 = B (u - h(u)),   x = (actuator ends, platform ends),

solved as a state space with held drives, the cubic force held over a quarter of a sample. The healthy stage is what a
model is identified from beforehand; the cause sits in the stage that is recorded afterwards. No code and no form of
the library: it knows modes, and nothing of masses.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from test.hidden.axes_truth import N_SAMPLES, NOISE, RATE_HZ, bouc_wen, multisine

Array = NDArray[np.float64]

N_AXES = 3
LEVELS_V = (0.5, 1.0, 2.0)
CAUSES = (
    "nothing",
    "static_coupling",
    "drive_coupling",
    "dynamic_coupling",
    "softening_modes",
    "missing_mode",
    "axis_sign",
    "axis_scale",
    "swapped_axes",
    "noncollocated_sensor",
)
# What a diagnosis must name, and in which form where it has one.
NAMES = {
    "nothing": None,
    "static_coupling": ("cross_coupling", "static"),
    "drive_coupling": ("cross_coupling", "static"),
    "dynamic_coupling": ("cross_coupling", "dynamic"),
    "softening_modes": ("softening_modes", None),
    "missing_mode": ("missing_mode", None),
    "axis_sign": ("axis_scale", None),
    "axis_scale": ("axis_scale", None),
    "swapped_axes": ("swapped_axes", None),
    "noncollocated_sensor": ("noncollocated_sensor", None),
}
_PARTS = 4  # of a sample, over which the cubic force is held


@dataclass(frozen=True)
class TwoMassStage:
    """Masses, springs and dampers of the degrees of freedom; where forces act, and what sensors see.

    Attributes:
        mass, spring, damper: (n, n), scaled so that a drive of 1 V moves about 1 um.
        drive: force of each voltage, (n, 3).
        seen: displacement of each sensor, (3, n).
        cubic: force of each degree of freedom's flexure for the cube of its displacement, (n,).
        play: slope and reach of the springs that give way at the drives.
    """

    mass: Array
    spring: Array
    damper: Array
    drive: Array
    seen: Array
    cubic: Array
    play: tuple[float, float]


def healthy(seed: int) -> TwoMassStage:
    """Return a stage: two modes for each axis between 200 and 1500 Hz, weak guides between the axes."""
    rng = np.random.default_rng([seed, 17])
    n = 2 * N_AXES
    mass, spring = np.eye(n), np.zeros((n, n))
    drive = np.zeros((n, N_AXES))
    low_hz = np.array([230.0, 320.0, 440.0]) * rng.uniform(0.93, 1.07, N_AXES)
    high_hz = np.array([750.0, 960.0, 1230.0]) * rng.uniform(0.93, 1.07, N_AXES)
    for k in range(N_AXES):
        p, q, share = k, N_AXES + k, rng.uniform(0.5, 1.0)
        mass[q, q] = share
        # two springs whose modes are the two frequencies: actuator to ground, link between the ends
        a, b = (2.0 * np.pi * low_hz[k]) ** 2, (2.0 * np.pi * high_hz[k]) ** 2
        # a + b = (ka + kl) / 1 + kl / share,  a b = ka kl / share
        roots = np.roots([1.0 / share + 1.0, -(a + b), a * b * share])
        link = float(np.max(roots.real)) if np.all(np.isreal(roots)) else float(np.abs(roots[0]))
        ground = a * b * share / link
        spring[p, p] += ground + link
        spring[q, q] += link
        spring[p, q] -= link
        spring[q, p] -= link
        drive[p, k] = ground
    guide = rng.normal(size=(N_AXES, N_AXES)) * 0.01 * np.sqrt(np.outer(np.diag(spring)[:3], np.diag(spring)[:3]))
    guide = np.triu(guide, 1)
    spring[:N_AXES, :N_AXES] += guide + guide.T
    squares, shapes = scipy.linalg.eigh(spring, mass)
    zeta = rng.uniform(0.006, 0.015, n)
    damper = mass @ shapes @ np.diag(2.0 * zeta * np.sqrt(squares)) @ shapes.T @ mass
    seen = np.hstack([np.eye(N_AXES), np.zeros((N_AXES, N_AXES))])
    return TwoMassStage(mass, spring, damper, drive, seen, np.zeros(n), (0.05, 0.3))


def hide(stage: TwoMassStage, cause: str, seed: int) -> TwoMassStage:
    """Return the stage with a cause of a size and place drawn from the seed."""
    rng = np.random.default_rng([seed, 23, CAUSES.index(cause)])
    k = int(rng.integers(N_AXES))
    sign = float(rng.choice([-1.0, 1.0]))
    if cause == "nothing":
        return stage
    if cause in ("static_coupling", "drive_coupling"):
        mix = np.eye(N_AXES)
        mix[k, (k + int(rng.integers(1, N_AXES))) % N_AXES] = sign * rng.uniform(0.02, 0.08)
        if cause == "static_coupling":
            return replace(stage, seen=mix @ stage.seen)
        return replace(stage, drive=stage.drive @ mix)
    if cause == "dynamic_coupling":
        # one platform on two axes whose centre of mass is off the line between them
        i, j = N_AXES + k, N_AXES + (k + 1) % N_AXES
        mass = stage.mass.copy()
        mass[i, j] = mass[j, i] = sign * rng.uniform(0.04, 0.12) * np.sqrt(mass[i, i] * mass[j, j])
        return replace(stage, mass=mass)
    if cause == "softening_modes":
        # at the highest level the spring gives way by this share, on average over a normal motion: 3 c rms^2 / k
        hardest = multisine(N_AXES, max(LEVELS_V), seed)
        rms = float(_moved(stage, np.tile(hardest, (2, 1)))[N_SAMPLES:].std(axis=0)[k])
        cubic = np.zeros(2 * N_AXES)
        cubic[k] = -rng.uniform(0.006, 0.02) * stage.spring[k, k] / (3.0 * rms**2)
        return replace(stage, cubic=cubic)
    if cause == "missing_mode":
        return _with_attached_mass(stage, k, rng.uniform(0.05, 0.15), rng.uniform(520.0, 640.0), 0.01)
    if cause in ("axis_sign", "axis_scale"):
        gain = np.ones(N_AXES)
        gain[k] = -1.0 if cause == "axis_sign" else 1.0 + sign * rng.uniform(0.05, 0.4)
        return replace(stage, seen=gain[:, None] * stage.seen)
    if cause == "swapped_axes":
        order = np.arange(N_AXES)
        other = (k + int(rng.integers(1, N_AXES))) % N_AXES
        order[[k, other]] = order[[other, k]]
        return replace(stage, seen=stage.seen[order]) if sign > 0.0 else replace(stage, drive=stage.drive[:, order])
    assert cause == "noncollocated_sensor"
    seen = stage.seen.copy()
    seen[k, k], seen[k, N_AXES + k] = 0.0, 1.0
    return replace(stage, seen=seen)


def _with_attached_mass(stage: TwoMassStage, k: int, share: float, hz: float, zeta: float) -> TwoMassStage:
    """Return the stage with a small mass that hangs on a spring and a damper at one axis's actuator end."""
    n = stage.mass.shape[0]
    m = share * stage.mass[k, k]
    spring, damper = m * (2.0 * np.pi * hz) ** 2, 2.0 * zeta * m * 2.0 * np.pi * hz
    pair = np.zeros(n + 1)
    pair[k], pair[n] = 1.0, -1.0

    def grown(matrix: Array, value: float) -> Array:
        return np.asarray(np.pad(matrix, ((0, 1), (0, 1))) + value * np.outer(pair, pair))

    mass = np.pad(stage.mass, ((0, 1), (0, 1)))
    mass[n, n] = m
    return replace(
        stage,
        mass=mass,
        spring=grown(stage.spring, spring),
        damper=grown(stage.damper, damper),
        drive=np.pad(stage.drive, ((0, 1), (0, 0))),
        seen=np.pad(stage.seen, ((0, 0), (0, 1))),
        cubic=np.pad(stage.cubic, (0, 1)),
    )


def record(stage: TwoMassStage, rms_v: float, seed: int, *, n_periods: int = 2) -> tuple[Array, Array]:
    """Return drives and displacements in steady state, (N_SAMPLES, 3, n_periods)."""
    u = multisine(N_AXES, rms_v, seed)
    long = np.tile(u, (n_periods + 2, 1))
    y = _moved(stage, long - bouc_wen(long, stage.play))[2 * N_SAMPLES :]
    y = y + NOISE * y.std(axis=0) * np.random.default_rng(seed + 10_000).normal(size=y.shape)
    shape = (n_periods, N_SAMPLES, N_AXES)
    return long[2 * N_SAMPLES :].reshape(shape).transpose(1, 2, 0), y.reshape(shape).transpose(1, 2, 0)


def _moved(stage: TwoMassStage, force_v: Array) -> Array:
    """Return what the sensors see of a stage from rest, its linear part solved exactly for held forces."""
    n = stage.mass.shape[0]
    inverse = scipy.linalg.inv(stage.mass)
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stage.spring, -inverse @ stage.damper]])
    b = np.vstack([np.zeros((n, n)), inverse])
    step = 1.0 / (_PARTS * RATE_HZ)
    whole = scipy.linalg.expm(np.block([[a, b], [np.zeros((n, 3 * n))]]) * step)
    forward, pushed = whole[: 2 * n, : 2 * n], whole[: 2 * n, 2 * n :]
    state, out = np.zeros(2 * n), np.empty((force_v.shape[0], n))
    forces = force_v @ stage.drive.T
    for k in range(force_v.shape[0]):
        out[k] = state[:n]
        for _ in range(_PARTS):
            state = forward @ state + pushed @ (forces[k] - stage.cubic * state[:n] ** 3)
    return np.asarray(out @ stage.seen.T)

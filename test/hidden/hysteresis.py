"""Hysteresis of the truth, in three forms, none of them a short sum of play operators.

`RelayPlane` is a Preisach plane with a continuous density, evaluated without any grid from its Everett
integral over the stack of past reversals. `MaxwellChain` is a hundred stop elements of random strength in the
displacement domain, solved implicitly. `EnvelopePlays` is a generalised play population whose two envelopes
differ.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from scipy.optimize import brentq


@njit(cache=True)
def _twice_integrated(width: float, share: float, decay_1: float, decay_2: float) -> tuple[float, float]:
    """Return G(D) = int_0^D f(d)(D-d) dd and K(D) = int_0^D f(d)(D-d)^2 dd.

    f(d) = (1-share) exp(-d/decay_1) + share (d/decay_2) exp(-d/decay_2).
    """
    c, e = decay_1, np.exp(-width / decay_1)
    g1 = c * width - c * c * (1.0 - e)
    k1 = c * width * width - 2.0 * c * g1
    b, q = decay_2, np.exp(-width / decay_2)
    g2 = b * width - 2.0 * b * b + (2.0 * b * b + b * width) * q
    k2 = b * width**2 - 4.0 * b * b * width + 6.0 * b**3 - (6.0 * b**3 + 2.0 * b * b * width) * q
    return (1.0 - share) * g1 + share * g2, (1.0 - share) * k1 + share * k2


@njit(cache=True)
def _run_plane(
    drive: np.ndarray, slope: float, scale: float, share: float, decay_1: float, decay_2: float, skew: float
) -> np.ndarray:
    out = np.empty_like(drive)
    at = np.empty(4096)  # past reversals not yet wiped out, each smaller than the one before
    value = np.empty(4096)  # relay output at each
    n = 0
    heading = 0
    last, last_out = 0.0, 0.0
    for k in range(drive.size):
        u = drive[k]
        if u != last:
            turned = 1 if u > last else -1
            virgin = n == 0 and (last == 0.0 or (last > 0.0) == (u > last))
            if not virgin and turned != heading:
                at[n], value[n] = last, last_out
                n += 1
            heading = turned
            # Passing an older reversal of the same kind wipes out the loop between.
            while n >= 2 and (u - at[n - 2]) * heading >= 0.0:
                n -= 2
            if n == 1 and abs(u) >= abs(at[0]):
                n = 0
            if n == 0:
                g, m = _twice_integrated(2.0 * abs(u), share, decay_1, decay_2)
                sign = 1.0 if u > 0.0 else -1.0
                last_out = scale * (sign * 0.5 * g + 0.125 * skew * m)
            else:
                g, m = _twice_integrated(abs(u - at[n - 1]), share, decay_1, decay_2)
                last_out = value[n - 1] + heading * scale * g * (1.0 + skew * 0.5 * (u + at[n - 1]))
            last = u
        out[k] = slope * u + last_out
    return out


@dataclass(frozen=True)
class RelayPlane:
    """Continuous Preisach plane, density scale * f(width) * (1 + skew * centre), plus a reversible slope.

    With no skew the density depends on the relay's width alone: loops are symmetric and congruent.
    """

    slope_um_per_v: float
    scale: float
    share: float
    decay_1_v: float
    decay_2_v: float
    skew_per_v: float = 0.0

    def run(self, drive_v: np.ndarray) -> np.ndarray:
        """Return the hysteretic response [um s^-a] to a drive [V] that starts relaxed."""
        return _run_plane(
            drive_v,
            self.slope_um_per_v,
            self.scale,
            self.share,
            self.decay_1_v,
            self.decay_2_v,
            self.skew_per_v,
        )

    def branch(self, width_v: float) -> float:
        """Return the change [um s^-a] along a branch of some width [V]."""
        g, _ = _twice_integrated(width_v, self.share, self.decay_1_v, self.decay_2_v)
        return self.slope_um_per_v * width_v + self.scale * g


@njit(cache=True)
def _run_chain(drive: np.ndarray, stiffness: np.ndarray, strength: np.ndarray, spring: float) -> np.ndarray:
    out = np.empty_like(drive)
    n = stiffness.size
    force = np.zeros(n)
    y = 0.0
    last = 0.0
    for k in range(drive.size):
        if drive[k] != last:
            move = 0.0
            # Newton on a monotone, piecewise linear balance approaches from one side and ends exactly.
            for _ in range(200):
                balance = spring * (y + move) - drive[k]
                slope = spring
                for i in range(n):
                    f = force[i] + stiffness[i] * move
                    if f > strength[i]:
                        balance += strength[i]
                    elif f < -strength[i]:
                        balance -= strength[i]
                    else:
                        balance += f
                        slope += stiffness[i]
                change = -balance / slope
                move += change
                if abs(change) < 1e-13:
                    break
            for i in range(n):
                force[i] = min(strength[i], max(-strength[i], force[i] + stiffness[i] * move))
            y += move
            last = drive[k]
        out[k] = y
    return out


@dataclass(frozen=True)
class MaxwellChain:
    """Springs that slip at a force, in parallel with a spring that does not; the drive balances their sum."""

    stiffness_v_per_um: np.ndarray
    strength_v: np.ndarray
    spring_v_per_um: float

    def run(self, drive_v: np.ndarray) -> np.ndarray:
        """Return the hysteretic response [um s^-a] to a drive [V] that starts relaxed."""
        return _run_chain(drive_v, self.stiffness_v_per_um, self.strength_v, self.spring_v_per_um)


@njit(cache=True)
def _run_envelopes(
    drive: np.ndarray,
    slope: float,
    radius: np.ndarray,
    weight: np.ndarray,
    bend: float,
    reach: float,
    is_mirrored: bool,
) -> np.ndarray:
    out = np.empty_like(drive)
    z = np.zeros(radius.size)
    for k in range(drive.size):
        u = drive[k]
        bulge = bend * reach * np.tanh(u / reach) ** 2
        falling = u if is_mirrored else u + bulge  # held from above while falling
        rising = u - bulge if is_mirrored else u  # pushed from below while rising
        total = slope * u
        for i in range(radius.size):
            z[i] = max(rising - radius[i], min(falling + radius[i], z[i]))
            total += weight[i] * z[i]
        out[k] = total
    return out


@dataclass(frozen=True)
class EnvelopePlays:
    """Generalised plays: the falling envelope bulges away from the rising one, or the other way round."""

    slope_um_per_v: float
    radius_v: np.ndarray
    weight_um_per_v: np.ndarray
    bend: float
    reach_v: float
    is_mirrored: bool

    def run(self, drive_v: np.ndarray) -> np.ndarray:
        """Return the hysteretic response [um s^-a] to a drive [V] that starts relaxed."""
        return _run_envelopes(
            drive_v,
            self.slope_um_per_v,
            self.radius_v,
            self.weight_um_per_v,
            self.bend,
            self.reach_v,
            self.is_mirrored,
        )


def draw_plane(stroke_um: float, width_ratio: float, range_v: float, rng: np.random.Generator) -> RelayPlane:
    """Draw a symmetric plane whose major loop over a range has this stroke and relative width."""
    while True:
        share = rng.uniform(0.0, 1.0)
        decay_1, decay_2 = range_v * np.exp(rng.uniform(np.log(0.15), np.log(1.0), 2))
        full, _ = _twice_integrated(range_v, share, decay_1, decay_2)
        half, _ = _twice_integrated(0.5 * range_v, share, decay_1, decay_2)
        scale = width_ratio * stroke_um / (full - 2.0 * half)
        slope = (stroke_um - scale * full) / range_v
        if slope > 0.4 * stroke_um / range_v:
            return RelayPlane(slope, scale, share, decay_1, decay_2)


def draw_chain(
    stroke_um: float, width_ratio: float, range_v: float, n_elements: int, rng: np.random.Generator
) -> MaxwellChain:
    """Draw a chain whose major loop over a range has this stroke and relative width."""
    slip_um, stiffness = np.zeros(0), np.zeros(0)

    def branch(width_um: float, share: float) -> float:
        # Masing: a branch is the first loading, doubled.
        return 2.0 * (share * np.sum(stiffness * np.minimum(0.5 * width_um, slip_um)) + (1 - share) * 0.5 * width_um)

    def loop_width(share: float) -> float:
        top = branch(stroke_um, share)
        middle = brentq(lambda width: branch(width, share) - 0.5 * top, 0.0, stroke_um)
        return 1.0 - 2.0 * middle / stroke_um

    most = 1.0 - 1e-3
    while slip_um.size == 0 or loop_width(most) < 1.02 * width_ratio:  # too few slip early: draw again
        slip_um = stroke_um * rng.beta(1.0, rng.uniform(1.0, 2.5), n_elements) + 1e-3 * stroke_um
        stiffness = rng.gamma(3.0, 1.0, n_elements)
        stiffness /= stiffness.sum()
    share = brentq(lambda s: loop_width(s) - width_ratio, 1e-6, most)
    scale = range_v / branch(stroke_um, share)
    return MaxwellChain(scale * share * stiffness, scale * share * stiffness * slip_um, scale * (1.0 - share))


def envelopes_of(plane: RelayPlane, largest_v: float, n_elements: int, bend: float, is_mirrored: bool) -> EnvelopePlays:
    """Turn a symmetric plane into plays (density f at twice the radius) and bend one of their envelopes."""
    cell = largest_v / n_elements
    radius = (np.arange(n_elements) + 0.5) * cell
    width = 2.0 * radius
    density = (1.0 - plane.share) * np.exp(-width / plane.decay_1_v)
    density += plane.share * (width / plane.decay_2_v) * np.exp(-width / plane.decay_2_v)
    return EnvelopePlays(plane.slope_um_per_v, radius, plane.scale * density * 2.0 * cell, bend, largest_v, is_mirrored)


@dataclass(frozen=True)
class WarpedDrive:
    """Symmetric hysteresis behind a curved drive (electrostriction): u + quadratic u^2 / reach."""

    inner: RelayPlane | MaxwellChain
    bend: float
    reach_v: float

    def run(self, drive_v: np.ndarray) -> np.ndarray:
        """Return the hysteretic response [um s^-a] to a drive [V] that starts relaxed."""
        return self.inner.run(drive_v + self.bend * drive_v**2 / self.reach_v)


def asymmetric(
    base: RelayPlane | MaxwellChain, form: str, amount: float, largest_v: float
) -> RelayPlane | EnvelopePlays | WarpedDrive:
    """Return an asymmetric form: "skewed_plane", "bent_envelope" (both of a plane) or "warped_drive"."""
    if form == "warped_drive":
        return WarpedDrive(base, amount, largest_v)
    if not isinstance(base, RelayPlane):
        raise TypeError(f"form {form!r} is of a relay plane")
    if form == "skewed_plane":
        return replace(base, skew_per_v=amount / largest_v)
    if form == "bent_envelope":
        return envelopes_of(base, 1.2 * largest_v, 160, abs(amount), amount < 0.0)
    raise ValueError(f"unknown form {form!r}")

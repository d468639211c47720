"""The stage of the study: amplifier, continuous hysteresis, power-law creep, a mass; and what befalls it.

Nothing of it is the product's: the hysteresis is a Preisach plane without elements, the creep one convolution, the
differential equations are integrated by Runge and Kutta's rule on a finer grid.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from test.hidden.creep import fractional_integral
from test.hidden.dynamics import first_order, mass_spring_damper
from test.hidden.hysteresis import RelayPlane, draw_plane
from test.hidden.noise import Noise, draw_noise

KINDS = (
    "gain",
    "amplifier",
    "load",
    "sensor_scale",
    "resonance",
    "creep",
    "hum",
    "clock",
    "loose_contact",
)
_OVERSAMPLING = 4
# A load is put down and an ageing goes on for a while.
_LOAD_RISE_S, _AGEING_S = 0.05, 20.0


@dataclass(frozen=True)
class Change:
    """What befalls a stage.

    Args:
        kind: one of KINDS.
        since_s: from when on [s].
        size: in the unit of the kind.
    """

    kind: str
    since_s: float
    size: float


@dataclass(frozen=True)
class Stage:
    """One stage. Without dynamics it may be simulated at any rate, for a whole day."""

    hysteresis: RelayPlane
    creep_order: float
    cutoff_hz: float
    frequency_hz: float
    damping_ratio: float
    noise: Noise
    largest_v: float
    is_quasistatic: bool = False

    def displacement_um(self, voltage_v: np.ndarray, rate_hz: float, change: Change | None = None) -> np.ndarray:
        """Return where it is at each sample [um], noise not yet on it."""
        if self.is_quasistatic:
            return fractional_integral(self.hysteresis.run(voltage_v), self.creep_order, 1.0 / rate_hz)
        n_fine = (voltage_v.size - 1) * _OVERSAMPLING + 1
        fine = np.interp(np.arange(n_fine) / _OVERSAMPLING, np.arange(voltage_v.size), voltage_v)
        step_s = 1.0 / (rate_hz * _OVERSAMPLING)
        at = n_fine if change is None else round(change.since_s / step_s)
        kind = "" if change is None else change.kind
        size = 0.0 if change is None else change.size
        driven = first_order(fine, 2.0 * np.pi * self.cutoff_hz, step_s)
        if kind == "amplifier":
            slower = first_order(fine[at:] - driven[at], 2.0 * np.pi * self.cutoff_hz / (1.0 + size), step_s)
            # begins where the faster one stands
            lead = (fine[at] - driven[at]) * np.exp(
                -2.0 * np.pi * self.cutoff_hz / (1.0 + size) * step_s * np.arange(n_fine - at)
            )
            driven[at:] = driven[at] + slower - lead
        bent = self.hysteresis.run(driven)
        moved = fractional_integral(bent, self.creep_order, step_s)
        if kind == "creep":
            # What changes from then on creeps more; what changed before goes on as it did.
            later = np.concatenate((np.zeros(at), bent[at:] - bent[at]))
            order = self.creep_order
            moved = moved - fractional_integral(later, order, step_s) + fractional_integral(later, order + size, step_s)
        changed_hz = self.frequency_hz * (1.0 - size) if kind == "resonance" else self.frequency_hz
        moved = _shaken(moved, self.frequency_hz, changed_hz, at, self.damping_ratio, step_s)
        return self._sensed(moved, voltage_v.size, rate_hz, change)

    def _sensed(self, moved: np.ndarray, n: int, rate_hz: float, change: Change | None) -> np.ndarray:
        time_s = np.arange(n) / rate_hz
        if change is None:
            return moved[::_OVERSAMPLING]
        after_s = np.maximum(time_s - change.since_s, 0.0)
        sensed = moved[::_OVERSAMPLING]
        if change.kind == "clock":
            told_s = time_s - change.size * after_s
            return np.interp(told_s, np.arange(moved.size) / (rate_hz * _OVERSAMPLING), moved)
        if change.kind == "gain":
            return sensed * (1.0 - change.size * np.minimum(after_s / _AGEING_S, 1.0))
        if change.kind == "sensor_scale":
            return np.where(after_s > 0.0, sensed * (1.0 + change.size), sensed)
        if change.kind == "load":
            return sensed + change.size * np.minimum(after_s / _LOAD_RISE_S, 1.0)
        if change.kind == "hum":
            return sensed + change.size * np.sin(2.0 * np.pi * 50.02 * after_s)
        if change.kind == "loose_contact":
            return sensed - change.size * _interrupted(after_s, rate_hz)
        return sensed

    def measured_um(self, moved_um: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return what the sensor reads [um]."""
        return moved_um + self.noise.draw(moved_um.size, rng)


def _shaken(
    values: np.ndarray, before_hz: float, after_hz: float, at: int, damping_ratio: float, step_s: float
) -> np.ndarray:
    if after_hz == before_hz or at >= values.size:
        return mass_spring_damper(values, before_hz, damping_ratio, step_s)
    return _two_masses(values, before_hz, after_hz, at, damping_ratio, step_s)


@njit(cache=True)
def _two_masses(
    values: np.ndarray, before_hz: float, after_hz: float, at: int, damping_ratio: float, step_s: float
) -> np.ndarray:
    # Semi-implicit midpoint in small parts: stable, and of second order.
    out = np.empty_like(values)
    z, s = values[0], 0.0
    out[0] = z
    n_parts = 4
    h = step_s / n_parts
    for k in range(1, values.size):
        w = 2.0 * np.pi * (before_hz if k < at else after_hz)
        for part in range(n_parts):
            u = values[k - 1] + (values[k] - values[k - 1]) * (part + 0.5) / n_parts
            zm = z + 0.5 * h * s
            sm = s + 0.5 * h * (w * w * (u - z) - 2.0 * damping_ratio * w * s)
            z += h * sm
            s += h * (w * w * (u - zm) - 2.0 * damping_ratio * w * sm)
        out[k] = z
    return out


def _interrupted(after_s: np.ndarray, rate_hz: float) -> np.ndarray:
    """Return where contact is lost: for some milliseconds, a few times a second."""
    rng = np.random.default_rng(7)
    lost = np.zeros(after_s.size)
    k = int(np.searchsorted(after_s, 0.0, side="right"))
    while k < after_s.size:
        k += 1 + int(rng.exponential(0.3) * rate_hz)
        n = 1 + int(rng.exponential(0.004) * rate_hz)
        lost[k : k + n] = 1.0
        k += n
    return lost


def draw_stage(seed: int, noise_um: float = 1e-3) -> Stage:
    """Draw a stage of about 8 um over 5 V."""
    rng = np.random.default_rng((seed, 17))
    plane = draw_plane(rng.uniform(5.0, 12.0), rng.uniform(0.08, 0.18), 5.0, rng)
    return Stage(
        plane,
        rng.uniform(0.008, 0.03),
        rng.uniform(150.0, 400.0),
        rng.uniform(200.0, 350.0),
        rng.uniform(0.02, 0.08),
        draw_noise(noise_um, rng),
        2.5,
    )


def sized(stage: Stage, voltage_v: np.ndarray, rate_hz: float, kind: str, since_s: float, rms_um: float) -> Change:
    """Return the change that moves what the sensor reads by so much rms in the half minute after it [um]."""
    first = {
        "gain": 1e-2,
        "amplifier": 0.3,
        "load": 1e-2,
        "sensor_scale": 1e-2,
        "resonance": 0.05,
        "creep": 2e-3,
        "hum": 1e-2,
        "clock": 1e-4,
        "loose_contact": 1e-1,
    }
    size = first[kind]
    end = round((since_s + 30.0) * rate_hz)
    begin = round(since_s * rate_hz)
    plain = stage.displacement_um(voltage_v[:end], rate_hz)
    for _ in range(4):
        change = Change(kind, since_s, size)
        moved = stage.displacement_um(voltage_v[:end], rate_hz, change) - plain
        found_um = float(np.sqrt(np.mean(moved[begin:] ** 2)))
        size *= rms_um / found_um
        size = min(size, {"resonance": 0.6, "creep": 0.2}.get(kind, np.inf))
    return replace(change, size=size)

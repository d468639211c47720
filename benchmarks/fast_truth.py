"""A fast stage that shares no code with the project: plays, creep, amplifier, a mass that rings, a delay.

Voltage straight between samples, or held from each on; each step in 40 parts. The amplifier and the mass are
discretised by scipy for inputs linear over a part, creep is the convolution with its full memory, and plays are clipped
one part after the other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import cont2discrete, fftconvolve, lfilter

_N_PARTS = 40


def plays_of_elements(kappa_um_per_v: np.ndarray, saturation_v: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Slope, thresholds and weights of the plays whose first rise is that of Maxwell elements, (15)-(17).

    On the first rise each element takes min(y / kappa, u_s): the voltage at displacement y is their sum and y / kappa
    of the last. Where an element saturates the slope of y over the voltage changes, by the weight of a play.
    """
    kappa, held_v = np.asarray(kappa_um_per_v, float), np.asarray(saturation_v, float)
    order = np.argsort(kappa[:-1] * held_v)
    kappa, last, held_v = kappa[:-1][order], kappa[-1], held_v[order]
    bends_um = kappa * held_v
    bends_v = np.array([np.sum(np.minimum(y / kappa, held_v)) + y / last for y in bends_um])
    slopes = np.array([1.0 / (np.sum(1.0 / kappa[k:]) + 1.0 / last) for k in range(kappa.size + 1)])
    return float(slopes[0]), bends_v, np.diff(slopes)


@dataclass(frozen=True)
class FastStage:
    """A stage relaxed at first.

    Attributes:
        slope_um_per_v: of the displacement beside the plays.
        thresholds_v: of the plays, shape (n_plays,).
        weights_um_per_v: their weights, shape (n_plays,).
        creep_order: of the power law t^alpha; used where there are no ``lags``.
        lags: (share, time constant [s]) of creep as a few exponentials.
        square_per_um: displacement x + q x^2, which no play holds.
        amplifier_hz, resonance_hz, damping, delay_s: of the dynamics; an amplifier or a mass of 0 Hz is none.
        is_held: whether the converter holds each voltage until the next sample.
    """

    slope_um_per_v: float
    thresholds_v: np.ndarray
    weights_um_per_v: np.ndarray
    creep_order: float = 0.0
    lags: tuple[tuple[float, float], ...] = ()
    square_per_um: float = 0.0
    amplifier_hz: float = 0.0
    resonance_hz: float = 0.0
    damping: float = 0.02
    delay_s: float = 0.0
    is_held: bool = False

    def displacement_um(self, step_s: float, voltage_v: np.ndarray) -> np.ndarray:
        """Displacement at each sample [um], the voltage rising from zero over the first step, or held at it."""
        return self.between_samples_um(step_s, voltage_v)[_N_PARTS - 1 :: _N_PARTS]

    def between_samples_um(self, step_s: float, voltage_v: np.ndarray) -> np.ndarray:
        """Displacement at the end of each of 40 parts of a step [um]."""
        part_s = step_s / _N_PARTS
        at = np.arange(1, voltage_v.size * _N_PARTS + 1) / _N_PARTS
        drive = np.interp(at, np.arange(voltage_v.size + 1), np.concatenate(([0.0], voltage_v)))
        if self.is_held:
            drive = np.repeat(np.concatenate(([0.0], voltage_v[:-1])), _N_PARTS)
        if self.amplifier_hz:
            drive = _filtered([1.0], [1.0 / (2.0 * np.pi * self.amplifier_hz), 1.0], part_s, drive)
        moved = self._crept(part_s, self._plays(drive))
        moved = moved + self.square_per_um * moved**2
        if self.resonance_hz:
            omega = 2.0 * np.pi * self.resonance_hz
            moved = _filtered([1.0], [1.0 / omega**2, 2.0 * self.damping / omega, 1.0], part_s, moved)
        late = np.concatenate(([0.0], moved))
        times = part_s * np.arange(late.size)
        return np.interp(part_s * np.arange(1, late.size) - self.delay_s, times, late)

    def _plays(self, drive: np.ndarray) -> np.ndarray:
        plays = np.zeros(self.thresholds_v.size)
        out = np.empty(drive.size)
        low, high = drive[:, None] - self.thresholds_v, drive[:, None] + self.thresholds_v
        for k in range(drive.size):
            plays = np.minimum(np.maximum(plays, low[k]), high[k])
            out[k] = self.weights_um_per_v @ plays
        return self.slope_um_per_v * drive + out

    def _crept(self, part_s: float, moved: np.ndarray) -> np.ndarray:
        if self.lags:
            return moved + sum(share * _filtered([1.0], [time_s, 1.0], part_s, moved) for share, time_s in self.lags)
        ramp = (part_s * np.arange(moved.size + 1)) ** (1.0 + self.creep_order) / math.gamma(2.0 + self.creep_order)
        slopes = np.diff(moved, prepend=0.0) / part_s
        return fftconvolve(slopes, np.diff(ramp))[: moved.size]


def _filtered(numerator: list[float], denominator: list[float], part_s: float, values: np.ndarray) -> np.ndarray:
    above, below, _ = cont2discrete((numerator, denominator), part_s, method="foh")
    return lfilter(np.ravel(above), below, np.concatenate(([0.0], values)))[1:]

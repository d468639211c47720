"""How fast an integral correction may be on a stage that rings or answers late: gain margin of 6 dB, from the model.

The loop is L(s) = w_b / s G(s) exp(-s T_l), G the linear dynamics of the model. From the frequency on at which its
phase first comes to -180 degrees its gain has to stay below one half, at whatever phase: what rings there has a phase
that a delay of some tenths of a millisecond turns.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fomrc_core.effects import Effect
from fomrc_core.model.loop_filters import joint_response

LEAST_MARGIN = 2.0  # 6 dB
# A voltage counts from the tick after a measurement on, is held for a period, and shows in the next measurement.
_LATE_PERIODS = 2.0
_N_FREQUENCIES = 200_001
_LOWEST_HZ = 1e-3
_BEYOND = 5.0  # of the sample rate: what rings beyond has no share in the loop


def largest_bandwidth_hz(effects: Sequence[Effect], period_s: float) -> float:
    """Return the largest bandwidth of an integral correction that leaves a gain margin of 6 dB [Hz].

    Args:
        effects: of the model; linear ones count.
        period_s: period of the loop and of the sensor [s].
    """
    frequency_hz = np.geomspace(_LOWEST_HZ, _BEYOND / period_s, _N_FREQUENCIES)
    around = [_near(effect.response(frequency_hz), frequency_hz) for effect in effects]
    frequency_hz = np.unique(np.concatenate((frequency_hz, *around)))
    gain = joint_response(tuple(effects), frequency_hz)
    phase = np.unwrap(np.angle(gain)) - 2.0 * np.pi * frequency_hz * _LATE_PERIODS * period_s - 0.5 * np.pi
    beyond = int(np.argmax(phase <= -np.pi)) if np.any(phase <= -np.pi) else frequency_hz.size - 1
    loop = np.abs(gain[beyond:]) / frequency_hz[beyond:]
    return float(1.0 / (LEAST_MARGIN * np.max(loop)))


def _near(gain: np.ndarray | None, frequency_hz: np.ndarray) -> np.ndarray:
    """Return more frequencies [Hz] around the peak of an effect, for a light mode is narrower than the grid."""
    if gain is None:
        return np.zeros(0)
    peak_hz = float(frequency_hz[int(np.argmax(np.abs(gain)))])
    return peak_hz * np.linspace(0.999, 1.001, 2001)

"""Which way a stage moves with its voltage: a sign is wrong where it moves the other way."""

from __future__ import annotations

import numpy as np

from fomrc_core.compute.arrays import Array

_SURELY = -0.5  # correlation from which on a displacement is taken to fall
_SLOW_SHARE = 0.1  # of the drive's power, from its lowest frequencies on


def falls_with_voltage(voltage_v: Array, displacement_um: Array) -> bool:
    """Return whether a displacement falls where the voltage rises, in the whole and in what is slow.

    Beyond a resonance a sound stage moves against its drive, but not where the drive is slowest.

    Args:
        voltage_v: drive [V], shape (n_samples,).
        displacement_um: displacement [um], shape (n_samples,).
    """
    v, x = voltage_v - np.mean(voltage_v), displacement_um - np.mean(displacement_um)
    if not float(v @ x) < _SURELY * float(np.linalg.norm(v)) * float(np.linalg.norm(x)):
        return False
    window = np.hanning(v.size)
    drive, moved = np.fft.rfft(window * v)[1:], np.fft.rfft(window * x)[1:]
    power = np.cumsum(np.abs(drive) ** 2)
    n_slow = int(np.searchsorted(power, _SLOW_SHARE * power[-1])) + 1
    return float(np.sum((np.conj(drive) * moved).real[:n_slow])) < 0.0

"""A stage of relays that creeps, its amplifier and what a monitor says of its drive: laboratory records to judge by."""

from __future__ import annotations

import numpy as np

from fomrc_core.records.recording import Recording
from test.hidden.creep import fractional_integral
from test.hidden.hysteresis import RelayPlane

STEP_S, N, NOISE_UM = 4e-3, 2500, 1e-3
ORDER = 0.02
TIME_S = STEP_S * np.arange(N)
Array = np.ndarray


def drive_v(seed: int, largest_v: float = 1.0) -> Array:
    """Return five sines of 0.2 to 3 Hz that begin softly [V]."""
    rng = np.random.default_rng(seed)
    waves = [rng.uniform(0.3, 0.6) * np.sin(2.0 * np.pi * f * TIME_S) for f in rng.uniform(0.2, 3.0, 5)]
    shape = np.sum(waves, axis=0) * np.minimum(1.0, TIME_S / 0.5)
    return np.asarray(largest_v * shape / np.max(np.abs(shape)))


def lagged(command_v: Array, cutoff_hz: float) -> Array:
    """Return what an amplifier of one pole makes of a command that is straight between the samples [V]."""
    kept = np.exp(-2.0 * np.pi * cutoff_hz * STEP_S)
    gone = (1.0 - kept) / (2.0 * np.pi * cutoff_hz * STEP_S)
    voltage = command_v.copy()
    for k in range(1, command_v.size):
        voltage[k] = kept * voltage[k - 1] + (gone - kept) * command_v[k - 1] + (1.0 - gone) * command_v[k]
    return np.asarray(voltage)


def recording(driven_v: Array, recorded_v: Array, seed: int) -> Recording:
    """Return what a sensor of 1 nm reads of the stage, beside what is recorded of its drive."""
    moved = RelayPlane(1.0, 0.8, 0.3, 0.5, 0.9).run(driven_v)
    noise = NOISE_UM * np.random.default_rng(1000 + seed).standard_normal(driven_v.size)
    reading = fractional_integral(moved - moved[0], ORDER, STEP_S) + noise
    return Recording(TIME_S[: driven_v.size], recorded_v, reading, name=f"drive_{seed}")


def driven(seed: int, largest_v: float, cutoff_hz: float = 0.0) -> Recording:
    """Return a record of a command, behind an amplifier where there is a cutoff."""
    command = drive_v(seed, largest_v)
    return recording(lagged(command, cutoff_hz) if cutoff_hz else command, command, seed)


def monitored(seed: int, noise_v: float) -> Recording:
    """Return a record of which the drive is what a noisy monitor read."""
    drive = drive_v(seed)
    return recording(drive, drive + noise_v * np.random.default_rng(seed).standard_normal(N), seed)

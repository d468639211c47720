"""A sensor at the end of its range whose reading still has noise on it: it lies flat while the drive goes on.

An amplifier at its end looks much the same, and is a cause to be found, not a fault of the data. What tells them apart
is creep: the actuator goes on creeping under an amplifier that stands still, and a sensor at its end shows none of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.runs import runs_of
from fomrc_core.records.noise import difference_noise_um
from fomrc_core.records.recording import Recording

_N_SIGMA = 4.0
_N_RUN_MIN = 8
_N_FLAT_MIN = 40
# Creep of an order of 0.005, less than any ceramic's, from an eighth of a plateau on: 1 % of the stroke.
_LEAST_CREEP = 0.01
_GONE_ON = 30.0  # times the noise: what the drive would have moved meanwhile
_SHARE_OF_GAIN = 0.3  # of the mean gain: the least slope of a loop behind a turn


@dataclass(frozen=True)
class NoisyEnd:
    """A reading a sensor does not pass: level [um], number of samples there, and the first of them [s]."""

    name: str
    level_um: float
    n_samples: int
    first_s: float


def noisy_end(recording: Recording) -> NoisyEnd | None:
    """Return the end of a sensor's range at which readings lie flat but for noise; None where there is none."""
    x, v = recording.measured_um, recording.voltage_v
    noise = difference_noise_um(recording)
    stroke, span = float(np.ptp(x)), float(np.ptp(v))
    if not noise > 0.0 or not span > 0.0:
        return None
    for name, sign in (("highest", 1.0), ("lowest", -1.0)):
        found = _flat_end(sign * x, sign * v, noise, _SHARE_OF_GAIN * stroke / span)
        if found is None:
            continue
        flat, level = found
        if _creeps(x[flat], noise, stroke):
            continue
        return NoisyEnd(name, sign * level, int(flat.size), float(recording.time_s[flat[0]]))
    return None


def _flat_end(x: Array, v: Array, noise: float, gain: float) -> tuple[np.ndarray, float] | None:
    """Return the samples of long flat stretches at the upper end, and their level; None where there are too few."""
    top = float(np.max(x))
    near = x > top - 3.0 * _N_SIGMA * noise
    level = float(np.median(x[near]))
    flat = np.abs(x - level) < _N_SIGMA * noise
    arrivals = runs_of(near)[:, 0]
    chosen = []
    for start, stop in runs_of(flat):
        # since the reading came up there: noise that leaves it for a moment begins no stretch of its own, in which a
        # drive that turns again within a play would look as if it went on
        arrival = int(arrivals[np.searchsorted(arrivals, start, side="right") - 1])
        highest_v = float(np.max(v[start:stop]))
        rises = min(highest_v - v[start], highest_v - v[arrival]), highest_v - float(v[stop - 1])
        # flat before the turn and behind it: plays are flat behind it only
        if stop - start >= _N_RUN_MIN and min(rises) * gain > 0.5 * _GONE_ON * noise:
            chosen.append(np.arange(start, stop))
    count = sum(c.size for c in chosen)
    return (np.concatenate(chosen), level) if count >= _N_FLAT_MIN else None


def _creeps(flat_um: Array, noise: float, stroke: float) -> bool:
    """Return whether readings show creep, or are too noisy or too few to tell that they do not."""
    n = flat_um.size // 4
    means = [float(np.mean(part)) for part in np.array_split(flat_um, 4)]
    error = noise / np.sqrt(n)
    least = _LEAST_CREEP * stroke
    return 6.0 * error > least or float(np.ptp(means)) > 0.5 * least or float(np.ptp(means)) > 8.0 * error

"""Readings that leave their neighbours on both sides and come back: spikes, and dropouts to one value.

A few samples are an excursion where they lie above (or below) both neighbours on either side by more than noise, the
drive and the local roughness of the record give:

- noise: in proportion to the robust spread of second differences, at a false alarm rate of one in a thousand records;
- drive: in proportion to the bends of what follows the drive about the place; the factor is learnt from the record,
  for lag and ringing differ. A smooth motion, however fast, is no excursion but at its turns, and there it bends;
- roughness: several times what three quarters of the second differences about the place stay below, so that ringing,
  hum and noise that grows are no spikes, be they correlated as they may. A spike has no like in its surroundings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from fomrc_core.compute.arrays import Array, Mask

Index = NDArray[np.int64]

N_BURST_MAX = 4  # samples: what stays away for longer may be a real motion, unless it is exactly constant
_FALSE_ALARMS = 1e-3  # a record
_N_AROUND = 24  # samples on either side that say how rough the record is there
_N_RINGING = 16  # samples after a bend of the drive in which its consequences are looked for
_ROUGH_SHARE = 0.75
# Of Gaussian noise three quarters of second differences stay below 2.8 standard deviations: 11 of them; of a random
# walk 6.5 of its steps. Of ringing the share is more than half of the largest.
_ROUGHER = 4.0
_DRIVE_FACTOR = 3.0  # a step that overshoots by all of its height, and an amplifier that does so too
_DRIVE_FACTOR_MIN = 1.0
_N_BENDS_MIN = 100  # bends the factor can be learnt from
_BEND_QUANTILE = 0.99
_N_STEPS_MIN = 4  # steps a record makes of itself; a load put on and taken off is two
_N_STEPS = 3.0  # of a quantised sensor
_LEAST_SHARE = 3e-4  # of the range: smaller ones move no parameter, and rounding and kinks of hysteresis are there
_CANDIDATE_SHARE_MAX = 0.2  # where more samples look like excursions the record is like that


@dataclass(frozen=True, eq=False)
class Surroundings:
    """A record less what follows its drive, and how large an excursion must be in it to be one.

    Attributes:
        displacement_um: readings, or what a model left of them [um], shape (n_samples,).
        rest_um: the same less what follows the drive [um], shape (n_samples,).
        floor_um: what noise and rounding give anywhere [um].
        bend_um: bends of what follows the drive about each sample [um], shape (n_samples,).
        drive_factor: excursions per bend that the drive makes in this record [1].
        noise_um: robust spread of the fastest changes, as if white [um].
        gain: range of the readings over that of the drive [um/V].
    """

    displacement_um: Array
    rest_um: Array
    floor_um: float
    bend_um: Array
    drive_factor: float
    noise_um: float
    gain: float

    @classmethod
    def of(
        cls, voltage_v: Array, displacement_um: Array, followed_um: Array, step_um: float, span_um: float | None = None
    ) -> Surroundings:
        """Return the surroundings of readings or of a residual.

        Args:
            voltage_v: drive [V], shape (n_samples,).
            displacement_um: the readings, or what a model left of them [um], shape (n_samples,).
            followed_um: what of them follows the drive [um], shape (n_samples,).
            step_um: step of the sensor [um]; nan where it has none.
            span_um: range of the record [um]; that of the readings where not given.
        """
        from scipy.ndimage import maximum_filter1d  # slow to import; no node that only drives needs it

        rest = displacement_um - followed_um
        second = np.diff(rest, 2)
        noise = 1.4826 * float(np.median(np.abs(second))) / np.sqrt(6.0)
        # an excursion is above four neighbours: two of them at once more than this has the probability asked for
        level = np.sqrt(2.0) * -float(ndtri(_FALSE_ALARMS / (2.0 * N_BURST_MAX * rest.size)))
        own = _span(displacement_um)
        span = own if span_um is None else span_um
        floor = max(level * noise, _N_STEPS * step_um if np.isfinite(step_um) else 0.0, _LEAST_SHARE * span)
        bend = np.zeros(rest.size)
        # the filter may follow some of the record better than the rest: a bend counts with the gain of the whole too
        gain = own / (_span(voltage_v) or 1.0)
        bend[1:-1] = np.maximum(np.abs(np.diff(followed_um, 2)), gain * np.abs(np.diff(voltage_v, 2)))
        around = _N_RINGING + N_BURST_MAX
        # looked for after the bend: the window reaches back by the ringing and ahead by a burst
        bend = maximum_filter1d(bend, around + 3, origin=(_N_RINGING - N_BURST_MAX) // 2, mode="nearest")
        found = cls(displacement_um, rest, floor, bend, _DRIVE_FACTOR, noise, gain)
        size = np.max([excess(rest, displacement_um, m) for m in range(1, N_BURST_MAX + 1)], axis=0)
        bent = (bend > floor) & (size > 0.0)
        if np.count_nonzero(bend > floor) >= _N_BENDS_MIN:
            ratios = np.where(bent, size / np.maximum(bend, 1e-300), 0.0)[bend > floor]
            # the tail of what the drive does: three times what all but one in a hundred stay below
            learnt = 3.0 * float(np.quantile(ratios, _BEND_QUANTILE))
            factor = min(max(learnt, _DRIVE_FACTOR_MIN), _DRIVE_FACTOR)
            found = cls(displacement_um, rest, floor, bend, factor, noise, gain)
        return found

    def least_um(self, samples: Index) -> Array:
        """Return how large an excursion must be at samples to be one [um], local roughness not counted."""
        return np.maximum(self.floor_um, self.drive_factor * self.bend_um[samples])

    def roughness_um(self, samples: Index) -> Array:
        """Return what three quarters of the second differences about samples stay below [um]."""
        second = np.abs(np.diff(self.rest_um, 2))
        reach = np.concatenate((np.arange(-_N_AROUND, -4), np.arange(N_BURST_MAX + 3, N_BURST_MAX + 3 + _N_AROUND)))
        found = np.empty(samples.size)
        for part in np.array_split(np.arange(samples.size), samples.size // 50_000 + 1):
            at = np.clip(samples[part, None] + reach, 0, second.size - 1)
            found[part] = np.quantile(second[at], _ROUGH_SHARE, axis=1)
        return found


def own_steps_um(around: Surroundings, excluded: Index) -> Array:
    """Return the sizes of the one-way steps a record makes that are not its drive's [um], rising, shape (n_steps,).

    Args:
        around: the record.
        excluded: samples a step to which does not count, for it is the one in question.
    """
    change = np.diff(around.rest_um)
    own = change[2:-2]
    others = [change[2 + k : change.size - 2 + k] for k in (-2, -1, 1, 2)]
    even = np.median(others, axis=0)
    wild = np.maximum.reduce([np.abs(c - even) for c in others])
    step = np.abs(own - even)
    at = np.arange(2, change.size - 2)
    counts = np.ones(around.rest_um.size, dtype=np.bool_)
    counts[excluded] = False
    return np.sort(step[(wild < step / 3.0) & (step > around.least_um(at)) & counts[at + 1]])


def are_like_steps(size_um: Array, steps_um: Array) -> Mask:
    """Return which jumps are like the steps a record makes of its own, as a coarse converter does, shape (n_jumps,).

    Those are: at least as many steps of half their size and more as jumps of their size. There and back, or a reading
    that stays and goes on in a jump, is no fault of a record that is like that everywhere.

    Args:
        size_um: of each jump [um], shape (n_jumps,).
        steps_um: of the record, rising, as ``own_steps_um`` gives them [um].
    """
    n_steps = steps_um.size - np.searchsorted(steps_um, 0.5 * size_um)
    order = np.argsort(np.argsort(-size_um, kind="stable"), kind="stable")
    return np.asarray(n_steps >= np.maximum(_N_STEPS_MIN, order + 1))


def _span(values: Array) -> float:
    """Return the range of all but one in a hundred values on either side: a spike does not count."""
    low, high = np.quantile(values, (0.01, 0.99))
    return float(high - low) or float(np.ptp(values))


def excess(rest_um: Array, displacement_um: Array, n_burst: int) -> Array:
    """Return by how much bursts stand out [um], by the first sample of each, zero where they do not, (n_samples,).

    The least of three: how far all of the burst lies above (or below) both neighbours on either side, what follows the
    drive taken out; and, nothing taken out, how far above the next neighbour on either side, and how far from the
    cubic through the four. A step of the drive fails the first, a motion that does not follow the drive as others do
    (a stage that meets a stop, an amplifier at its end) the others.

    Args:
        rest_um: readings less what follows the drive [um], shape (n_samples,).
        displacement_um: the readings [um], shape (n_samples,).
        n_burst: samples of a burst.
    """
    n = rest_um.size
    found = np.zeros(n)
    if n < n_burst + 4:
        return found
    first, stop = 2, n - n_burst - 1
    offsets = np.array([-2.0, -1.0, float(n_burst), n_burst + 1.0])
    neighbours = [rest_um[first + int(k) : stop + int(k)] for k in offsets]
    readings = [displacement_um[first + int(k) : stop + int(k)] for k in offsets]
    highest, lowest = np.maximum.reduce(neighbours), np.minimum.reduce(neighbours)
    above, below = np.full(stop - first, np.inf), np.full(stop - first, np.inf)
    high, low = np.maximum(readings[1], readings[2]), np.minimum(readings[1], readings[2])
    for k in range(n_burst):
        reading = displacement_um[first + k : stop + k]
        off = reading - _cubic(readings, offsets, float(k))
        here = rest_um[first + k : stop + k]
        above = np.minimum.reduce((above, here - highest, reading - high, off))
        below = np.minimum.reduce((below, lowest - here, low - reading, -off))
    found[first:stop] = np.maximum(0.0, np.maximum(above, below))
    return found


def _cubic(values: list[Array], at: Array, where: float) -> Array:
    """Return the cubic through values at four places, at another place (Lagrange)."""
    weights = [float(np.prod((where - np.delete(at, k)) / (at[k] - np.delete(at, k)))) for k in range(at.size)]
    return np.asarray(sum(w * v for w, v in zip(weights, values, strict=True)))


def find_excursions(around: Surroundings) -> Mask:
    """Return the samples that are excursions of a few samples, shape (n_samples,)."""
    found = np.zeros(around.rest_um.size, dtype=np.bool_)
    for n_burst in range(1, N_BURST_MAX + 1):
        size = excess(around.rest_um, around.displacement_um, n_burst)
        candidates = np.flatnonzero(size > around.floor_um)
        candidates = candidates[size[candidates] > around.least_um(candidates)]
        if candidates.size > _CANDIDATE_SHARE_MAX * size.size:
            continue
        candidates = candidates[size[candidates] > _ROUGHER * around.roughness_um(candidates)]
        if candidates.size:
            steps = own_steps_um(around, np.array([], dtype=np.int64))
            candidates = candidates[~are_like_steps(size[candidates], steps)]
        for k in range(n_burst):
            found[candidates + k] = True
    return found

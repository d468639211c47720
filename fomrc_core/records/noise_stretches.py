"""Stretches of a record in which nothing but noise is left: repeats less their common part, rests less their creep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.runs import runs_of
from fomrc_core.records.noise_spectrum import NoiseStretch
from fomrc_core.records.recording import Recording
from fomrc_core.records.repeats import Repeat
from fomrc_core.records.sensor_step import sensor_step_um

_N_DRIFT = 4
# What is left after the slow functions has to be mostly noise: eight samples for each of them.
N_STRETCH_MIN = 8 * _N_DRIFT
# The part of a stretch that is too young: creep changes there faster than the slow functions can follow.
_YOUNG = 8
_USABLE_SHARE = 0.9
# rms of the first block over the rest that not even a random walk (four degrees of freedom a block) shows more often
# than once in a thousand: the root of the 99.9 % quantile of F with 4 and 28 degrees of freedom
_TRANSIENT = 2.5
_N_TRIMS = 4
_ROUNDING = 1e-9
_REST_BLOCK = 32
_MISMATCH_MAX = 1e-3
# Scatter of the changes around one, in median deviations of 32: a Gaussian noise holds no part of its power beyond.
_FAR_OUT = 6.0
_MOST_OF_POWER = 0.5
_FEW = 0.05  # of the samples: what comes once


@dataclass(frozen=True)
class Rest:
    """A stretch at constant drive: samples ``start`` to ``stop`` (exclusive)."""

    start: int
    stop: int


def find_rests(voltage_v: Array) -> tuple[Rest, ...]:
    """Return the stretches in which the drive stands still, commanded or but for read-back noise, in order of time.

    Args:
        voltage_v: drive [V], shape (n_samples,).
    """
    v = np.asarray(voltage_v, dtype=np.float64)
    span = float(np.ptp(v))
    if v.size < N_STRETCH_MIN or span == 0.0:
        return ()
    still = np.abs(np.diff(v)) <= _ROUNDING * float(np.max(np.abs(v)))
    found = [Rest(a, b + 1) for a, b in runs_of(still).tolist() if b + 1 - a >= N_STRETCH_MIN]
    return tuple(found) if found else _noisy_rests(v, span)


def _noisy_rests(v: Array, span: float) -> tuple[Rest, ...]:
    """Return rests of a drive that was read back: blocks of the smallest spread whose means agree."""
    n_blocks = v.size // _REST_BLOCK
    blocks = v[: n_blocks * _REST_BLOCK].reshape(n_blocks, _REST_BLOCK)
    spread, mean = np.std(blocks, axis=1), np.mean(blocks, axis=1)
    noise = float(np.min(spread))
    if noise > _MISMATCH_MAX * span:
        return ()
    # a slow even motion has a small spread too, but its steps within a block correlate: their mean does not vanish
    drift = np.abs(blocks[:, _REST_BLOCK // 2 :].mean(axis=1) - blocks[:, : _REST_BLOCK // 2].mean(axis=1))
    # the spread of a mean of half a block is noise / sqrt(16), of the difference of two sqrt(2) more; four sigma
    quiet = (spread <= 2.0 * noise) & (drift <= 8.0 * noise * np.sqrt(2.0 / 16.0))
    steady = quiet[1:] & quiet[:-1] & (np.abs(np.diff(mean)) <= 8.0 * noise * np.sqrt(2.0 / _REST_BLOCK))
    return tuple(Rest(a * _REST_BLOCK, (b + 1) * _REST_BLOCK) for a, b in runs_of(steady).tolist() if b > a)


def stretches_of_rests(
    recording: Recording, rests: Sequence[Rest], is_usable: Mask | None = None
) -> tuple[NoiseStretch, ...]:
    """Return what is left of the displacement in each rest when creep is taken out.

    Noise as slow as the rest goes with the creep.
    """
    x, usable = _filled(recording, is_usable)
    step_um = sensor_step_um(x[usable])
    found = []
    for rest in rests:
        if np.mean(usable[rest.start : rest.stop]) < _USABLE_SHARE:
            continue
        values = x[rest.start : rest.stop]
        left = _relaxed(values[:, None])
        if left is not None and not _jumps(left, step_um):
            found.append(NoiseStretch(left, values[values.size - left.size :], 1.0, _N_DRIFT))
    return tuple(found)


def stretches_of_repeats(
    recording: Recording, repeats: Sequence[Repeat], is_usable: Mask | None = None
) -> tuple[NoiseStretch, ...]:
    """Return what differs between the copies of each repeat, drift of creep taken out.

    Where a repeat holds two settled periods or more it is the displacement less its mean period: all of the noise that
    is not periodic, slow noise below one cycle a period too (Pintelon & Schoukens, "System Identification", 2012,
    ch. 2). Else it is the difference of the two copies. Only what comes after the highest and lowest voltage of the
    stretch is used, for before that hysteresis remembers the past; creep of that past decays from there.
    """
    x, usable = _filled(recording, is_usable)
    v = recording.voltage_v
    step_um = sensor_step_um(x[usable])
    found = []
    for repeat in repeats:
        period, end = repeat.period_samples, repeat.stop + repeat.period_samples
        first = repeat.settled
        if np.mean(usable[first:end]) < _USABLE_SHARE:
            continue
        is_read_back = repeat.mismatch_v > _ROUNDING * float(np.max(np.abs(v)))
        n_periods = int((end - first - (end - first) // _YOUNG) // period)
        if n_periods >= 2:
            age = end - n_periods * period - first
            first = end - n_periods * period
            columns = np.column_stack((x[first:end], v[first:end])) if is_read_back else x[first:end, None]
            left = _relaxed(columns, age, n_periods)
            gain = n_periods / (n_periods - 1.0)
        else:
            columns = np.column_stack([c[first + period : end] - c[first : repeat.stop] for c in (x, v)])
            left = _relaxed(columns / np.sqrt(2.0) if is_read_back else columns[:, :1] / np.sqrt(2.0))
            gain = 1.0
        if left is not None and not _jumps(left, step_um):
            stop = end if n_periods >= 2 else repeat.stop
            found.append(NoiseStretch(left, x[stop - left.size : stop], gain, _N_DRIFT))
    return tuple(found)


def _relaxed(columns: Array, age: int = 0, n_periods: int = 0) -> Array | None:
    """Return the first column without creep, and without what follows the other columns; None where too short.

    Creep that began at one moment is, once it is an eighth as old as it gets, a cubic polynomial of the logarithm of
    its age to some 1e-3 of what it does meanwhile, be it a power law, logarithmic or a spectrum of relaxations. A mean
    period is taken out of the polynomial as well as of the values.

    Args:
        columns: displacement [um], then what it follows, shape (n_samples, n_columns).
        age: samples since the creep began.
        n_periods: number of periods in the samples; 0 where they are not periodic.
    """
    n = columns.shape[0]
    skipped = max(0, (n + age) // _YOUNG - age) if n_periods == 0 else 0
    for _ in range(_N_TRIMS):
        if n - skipped < N_STRETCH_MIN:
            return None
        ages = np.arange(age + skipped, age + n, dtype=np.float64) + 1.0
        drift = np.column_stack((_creep(ages), columns[skipped:, 1:]))
        values = columns[skipped:, 0]
        if n_periods:
            both = _without_mean_period(np.column_stack((values, drift[:, 1:])), n_periods)
            values, drift = both[:, 0], both[:, 1:]
        left = np.asarray(values - drift @ np.linalg.lstsq(drift, values, rcond=None)[0], dtype=np.float64)
        if n_periods or not _starts_wild(left):
            break
        skipped += left.size // _YOUNG
    return left


def _without_mean_period(columns: Array, n_periods: int) -> Array:
    folded = columns.reshape(n_periods, -1, columns.shape[1])
    return np.asarray((folded - folded.mean(axis=0)).reshape(columns.shape), dtype=np.float64)


def _creep(ages: Array) -> Array:
    """Return powers 0 to 3 of the logarithm of ages in samples, scaled to one, shape (n_samples, 4)."""
    u = np.log(ages)
    u = (u - u[0]) / (u[-1] - u[0]) * 2.0 - 1.0
    return np.column_stack([u**k for k in range(_N_DRIFT)])


def _starts_wild(left: Array) -> bool:
    block = left.size // _YOUNG
    return float(np.std(left[:block])) > _TRANSIENT * float(np.std(left[block:]))


def _jumps(left: Array, step_um: float) -> bool:
    """Return whether most of the power of the changes from sample to sample is in few that stand out around them.

    A lead that opened in one copy and closed again, a load that was laid on: these come once, and are no noise, which
    changes by about as much at each sample, be it white, flicker or a walk. Scatter is taken around each change, for
    noise that grows with displacement; readings of a sensor with steps change by a step or not at all.
    """
    change = np.abs(np.diff(left))
    around = median_filter(change, size=_REST_BLOCK, mode="reflect") / 0.6745
    least = 2.0 * step_um if np.isfinite(step_um) else 0.0
    stands_out = change > np.maximum(_FAR_OUT * around, least)
    if np.count_nonzero(stands_out) > _FEW * change.size:
        return False  # steps of a sensor, what else is read taken out
    return float(np.sum(change[stands_out] ** 2)) > _MOST_OF_POWER * float(np.sum(change**2))


def _filled(recording: Recording, is_usable: Mask | None) -> tuple[Array, Mask]:
    """Return the displacement with what is not usable bridged by straight lines, and the mask."""
    x = recording.measured_um
    if is_usable is None or bool(np.all(is_usable)):
        return x, np.ones(x.size, dtype=np.bool_)
    good = np.flatnonzero(is_usable)
    return np.interp(np.arange(x.size), good, x[good]), np.asarray(is_usable, dtype=np.bool_)

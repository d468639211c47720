"""Whether what is left is larger where the drive moves far from sample to sample.

A sensor's noise does not know how far the drive moves: it may be slow, and it may grow with the displacement, but what
is new in it from sample to sample is as large where the drive stands as where it jumps. What a model gets wrong of a
fast motion is not, and often follows from nothing that a regression of its sign could tell: an error in time that
changes over a record, a drive read at the wrong moment. Where no repeat shows the noise apart from a model such an
error would pass for slow noise.

The residual is whitened first, or noise that wanders would be large by chance where the drive is fast. The statistic is
Spearman's: ranks of the square of what is new against ranks of the drive's step, what the displacement says of either
taken out, its mean over blocks against their spread.

An error of slow motion is small from sample to sample and hidden by the noise there. Means over several samples have
less of the noise and all of the error: the same is asked of them, over four times as many again and again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import rankdata
from scipy.stats import t as student

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.least_squares import shortest_weights
from fomrc_core.diagnosis.remainder import Dependence, DrivenRecord, blocks_of, hats_over
from fomrc_core.records.sensor_step import sensor_step_um
from fomrc_core.records.whitening import burg

ON = "how far the drive moves between samples, as where a clock jitters or samples are lost"
_QUIET_SHARE = 1.0 / 3.0  # of the samples, those about which the drive moves least
_LEAST_BLOCKS = 4
_MOST_ORDER = 8  # of the whitening filter: a sensor's filter and a slow wander
_LEAST_SAMPLES = 50
ON_MEANS = "how far the drive moves in some time, as where what follows it slowly is not right"
_AVERAGED = (4, 16, 64)  # samples to a mean: noise falls by half from each to the next
_LEAST_MEANS = 200  # of a record: eight to a block
_ROUNDING_SHARE = 0.1  # of the power of what is left


def unevenness(records: Sequence[DrivenRecord]) -> Dependence:
    """Return how much of the power of what is new in each sample is more than where the drive moves least, how surely.

    Args:
        records: with the residual of one and the same model.
    """
    return _uneven([record for record in records if not is_rounding(record)], ON)


def slow_unevenness(records: Sequence[DrivenRecord]) -> Dependence:
    """Return the same of means over several samples, over as many as say it most surely.

    Args:
        records: with the residual of one and the same model.
    """
    told = [record for record in records if not is_rounding(record)]
    total = sum(record.left_um2 for record in told)
    found = []
    for size in _AVERAGED:
        means = [_averaged(record, size) for record in told]
        means = [m for m in means if np.count_nonzero(m.is_used) >= _LEAST_MEANS]
        if not means or total == 0.0:
            break
        seen = _uneven(means, ON_MEANS)
        # of the power of the whole, means have what is slow
        slow = min(size * sum(mean.left_um2 for mean in means) / total, 1.0)
        found.append(replace(seen, share=seen.share * slow))
    if not found:
        return Dependence(ON_MEANS, 0.0, 1.0)
    surest = min(found, key=lambda one: one.p_value)
    return replace(surest, p_value=min(1.0, len(found) * surest.p_value))


def _averaged(record: DrivenRecord, size: int) -> DrivenRecord:
    """Return means over so many samples each; used where all of them are."""
    n = record.time_s.size // size * size
    time_s, voltage_v, predicted_um, residual_um, used = (
        values[:n].reshape(-1, size).mean(axis=1)
        for values in (record.time_s, record.voltage_v, record.predicted_um, record.residual_um, record.is_used)
    )
    return DrivenRecord(time_s, voltage_v, predicted_um, residual_um, used == 1.0)


def _uneven(records: Sequence[DrivenRecord], on: str) -> Dependence:
    correlations: list[float] = []
    excess = total = 0.0
    for record in records:
        block, is_inside = blocks_of(record.time_s.size)
        used = record.is_used & is_inside
        step_v = _step_about(record.voltage_v)
        is_still = not float(np.ptp(step_v[used])) > 0.0
        if np.count_nonzero(used) < _LEAST_SAMPLES or is_still:
            continue
        power = np.square(_white(record.residual_um - np.mean(record.residual_um[used]), used))[used]
        moved = hats_over(_unit(record.predicted_um[used]))
        of_power, of_step = (_partial_ranks(values, moved) for values in (power, step_v[used]))
        correlations += [float(np.mean((of_power * of_step)[block[used] == k])) for k in np.unique(block[used])]
        is_quiet = step_v[used] <= np.quantile(step_v[used], _QUIET_SHARE)
        excess += max(float(np.sum(power)) - power.size * float(np.mean(power[is_quiet])), 0.0)
        total += float(np.sum(power))
    values = np.array(correlations)
    spread = float(np.std(values, ddof=1)) if values.size >= _LEAST_BLOCKS else 0.0
    if spread == 0.0 or total == 0.0:
        return Dependence(on, 0.0, 1.0)
    p_value = float(student.sf(float(np.mean(values)) / (spread / np.sqrt(values.size)), values.size - 1))
    return Dependence(on, excess / total, p_value)


def is_rounding(record: DrivenRecord) -> bool:
    """Return whether readings are so coarse that what is left tells of them: they stand where the drive stands."""
    step_um = sensor_step_um((record.predicted_um + record.residual_um)[record.is_used])
    return step_um**2 / 12.0 > _ROUNDING_SHARE * float(np.var(record.residual_um[record.is_used]))


def _white(residual_um: Array, used: Mask) -> Array:
    """Return what is new in each sample, shape (n_samples,)."""
    process = burg([residual_um[used]], _MOST_ORDER)
    return process.whiten(residual_um) if process.innovation_um2 > 0.0 else residual_um


def _step_about(voltage_v: Array) -> Array:
    """Return the larger of the drive's steps to a sample and from it [V], shape (n_samples,)."""
    steps_v = np.abs(np.diff(voltage_v))
    return np.asarray(np.maximum(np.append(steps_v[:1], steps_v), np.append(steps_v, steps_v[-1:])))


def _unit(values: Array) -> Array:
    span = float(np.ptp(values))
    return (values - np.min(values)) / span if span > 0.0 else np.zeros(values.size)


def _partial_ranks(values: Array, columns: Array) -> Array:
    """Return ranks less what columns say of them, of deviation 1, shape (n_samples,)."""
    ranks = np.asarray(rankdata(values), dtype=np.float64)
    rest = ranks - columns @ shortest_weights(columns, ranks)
    spread = float(np.std(rest))
    return np.asarray(rest / spread if spread > 0.0 else rest)

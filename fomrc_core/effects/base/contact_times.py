"""When a lead was open: the displacement stands while the drive moves on, and jumps to where it should be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.evidence import RecordEvidence

_MEDIAN_TO_RMS = 1.4826  # of normal numbers
_JUMP = 6.0  # rms of what changes from sample to sample: no normal number in a long record is as large
_STANDS = 4.0  # noise: how far a reading strays from a level
_MOST = 12  # openings of a record; more that look like it are the way of the stage, as play or a converter's steps
_FAR_MORE = 4.0  # times what the stage misses in its own way, which is about as much each time
_MOST_TRIED = 300  # jumps, the largest: of more the lead's are among them, or it is not what is wrong
_CREEPS = 0.1  # of the jump that ends a stand: so far the stage creeps on at the voltage that stays
_SLOWLY = 16  # samples over which noise that wanders strays
_LEAST_SAMPLES = 3  # that stand: two alike are chance
_LEFT = 0.1  # of what the drive has done meanwhile: the least that is left of it when it jumps
_GOES_ON = 0.3  # of the drive's way: less is a stage that stands and creeps
_IS_BACK = 0.5  # of what the drive did meanwhile comes back soon, and no more than twice of it
_MOVES = 6.0  # noise: what the drive would have moved the stage by
_MISSED = 0.25  # of what the drive did meanwhile: the least that is left over; where it turns a model moves by less
_UNSEEN = 40.0  # noise: the same over the last samples of a stand that ends without a jump, as at no turn of the drive


def open_times(record: RecordEvidence, noise_um: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return when a lead opens and closes [s], each before the next; two empty lists where none does.

    Args:
        record: with what the model left over.
        noise_um: noise floor [um].
    """
    time_s, measured_um = record.time_s, record.predicted_um + record.residual_um
    jumps_um = np.diff(record.residual_um)
    noise_um = max(noise_um, _MEDIAN_TO_RMS * float(np.median(np.abs(jumps_um))) / np.sqrt(2.0))
    stray_um = _stray_um(record.residual_um, noise_um)
    jumped = np.flatnonzero(np.abs(jumps_um) > _JUMP * np.sqrt(2.0) * noise_um) + 1
    if jumped.size > _MOST_TRIED:
        jumped = np.sort(jumped[np.argsort(-np.abs(jumps_um[jumped - 1]))[:_MOST_TRIED]])
    span_v = float(np.ptp(record.voltage_v))
    um_per_v = float(np.ptp(record.predicted_um)) / span_v if span_v > 0.0 else 0.0
    went_on = _ends_of_stands(measured_um, um_per_v * record.voltage_v, noise_um)
    found: list[tuple[float, float]] = []
    missed_um: list[float] = []
    moved_um = um_per_v * record.voltage_v
    for end in np.union1d(jumped, went_on):
        reach_um = _STANDS * stray_um + _CREEPS * abs(measured_um[end] - measured_um[end - 1])
        begin = _begin_of_level(measured_um, moved_um, int(end), reach_um)
        if end - begin < _LEAST_SAMPLES or begin == 0:
            continue
        # on a ramp the level seems to begin before it does, and what the drive did since would be too much
        begin = _opening(measured_um, record.residual_um, begin, int(end))
        if end - begin < _LEAST_SAMPLES:
            continue
        level_um = float(np.mean(measured_um[begin : begin + _LEAST_SAMPLES]))
        step_um = record.predicted_um[begin] - record.predicted_um[begin - 1]
        share = (level_um - measured_um[begin - 1]) / step_um if step_um != 0.0 else 1.0
        share = min(max(share, 0.0), 1.0)
        # the lead opened between two samples: where a step fell between them, it opened before that, or after
        held_um = moved_um[begin - 1] + share * (moved_um[begin] - moved_um[begin - 1])
        unseen_um = moved_um[begin:end] - held_um
        n_unseen = np.count_nonzero(np.abs(unseen_um) > _STANDS * noise_um)
        # it misses what the drive does, and gets it back
        after = slice(end, end + max((end - begin) // 2, _LEAST_SAMPLES))  # behind a lag it takes some samples
        due_um = moved_um[after] - held_um
        back_um = measured_um[after] - measured_um[end - 1]
        back = np.divide(back_um, due_um, out=np.zeros(due_um.size), where=due_um != 0.0)
        most_um = float(np.max(np.abs(unseen_um)))
        left_out_um = most_um if end in went_on else abs(unseen_um[-1])
        left_um = record.residual_um[begin - 1 : end]
        # what moves as the model says it does is where the drive turns, and no level
        is_missed = left_out_um > _MOVES * noise_um and n_unseen >= _LEAST_SAMPLES
        is_missed = is_missed and float(np.max(np.abs(left_um - left_um[0]))) > _MISSED * most_um
        is_left = abs(measured_um[end] - measured_um[end - 1]) > _LEFT * abs(moved_um[end] - held_um)
        if not is_missed or not is_left or not np.any((back > _IS_BACK) & (back < 1.0 / _IS_BACK)):
            continue
        step_s = time_s[begin] - time_s[begin - 1]
        open_s = float(time_s[begin - 1] + share * step_s)
        if found and open_s <= found[-1][1]:
            if abs(open_s - found[-1][0]) > step_s:
                continue
            found.pop()  # it still stood where it seemed to be back: the drive had come by where it was
            missed_um.pop()
        found.append((open_s, float(0.5 * (time_s[end - 1] + time_s[end]))))
        missed_um.append(float(np.max(np.abs(unseen_um))))
    if len(found) > _MOST:
        usual_um = float(np.median(missed_um))
        found = [pair for pair, missed in zip(found, missed_um, strict=True) if missed > _FAR_MORE * usual_um]
    if len(found) > _MOST:
        return (), ()
    return tuple(pair[0] for pair in found), tuple(pair[1] for pair in found)


def _stray_um(residual_um: Array, noise_um: float) -> float:
    """Return how far noise that wanders strays from a level [um]: farther than it changes from sample to sample."""
    changes_um = np.abs(residual_um[_SLOWLY:] - residual_um[:-_SLOWLY])
    return max(noise_um, _MEDIAN_TO_RMS * float(np.median(changes_um)) / np.sqrt(2.0)) if changes_um.size else noise_um


def _ends_of_stands(measured_um: Array, moved_um: Array, noise_um: float) -> NDArray[np.int64]:
    """Return the samples at which a stage goes on that stood while the drive moved.

    Where the drive comes by the place at which the lead opened when it closes, nothing jumps.
    """
    moves = np.abs(np.diff(measured_um)) > _JUMP * np.sqrt(2.0) * noise_um
    ends = np.flatnonzero(moves[2:] & ~moves[1:-1] & ~moves[:-2]) + _LEAST_SAMPLES
    unseen_um = np.abs(moved_um[ends - 1] - moved_um[ends - _LEAST_SAMPLES])
    may_be = unseen_um > _UNSEEN * noise_um
    return np.sort(ends[may_be][np.argsort(-unseen_um[may_be])[:_MOST_TRIED]])


@compiled
def _begin_of_level(measured_um: Array, moved_um: Array, end: int, reach_um: float) -> int:
    """Return the first sample of the level that ends before this one, on which the drive goes its way."""
    total, n, farthest_um = 0.0, 0, 0.0
    for k in range(end - 1, -1, -1):
        farthest_um = max(farthest_um, abs(moved_um[k] - moved_um[end - 1]))
        # the mean of a few errs as much as a reading does
        if n and abs(measured_um[k] - total / n) > reach_um * np.sqrt(1.0 + 1.0 / n) + _GOES_ON * farthest_um:
            return k + 1
        total, n = total + measured_um[k], n + 1
    return 0


def _opening(measured_um: Array, residual_um: Array, begin: int, end: int) -> int:
    """Return the first sample at which the stage stands: before it the model is followed, from it on a level is kept.

    What either leaves is least where they change (a sample at a time says nothing where the drive is slow).
    """
    start = max(2 * begin - end, 0)
    followed, stood = residual_um[start:end], measured_um[start:end]
    counts = np.arange(1, end - start + 1)
    scatter = np.cumsum(followed**2) - np.cumsum(followed) ** 2 / counts
    kept = (np.cumsum(stood[::-1] ** 2) - np.cumsum(stood[::-1]) ** 2 / counts)[::-1]
    first, last = _LEAST_SAMPLES, end - start - _LEAST_SAMPLES
    if last <= first:
        return begin
    return start + first + int(np.argmin(scatter[first - 1 : last - 1] + kept[first:last]))

"""When a lead was open before a stage that lags or rings: it neither stands nor jumps, and rings on once it is closed.

What is missed while the lead is open is the drive from where it opened, and what the stage misses is that behind its
own response. For each place where the residual stands out, all beginnings near it and all ends after them are tried,
each by how much of it they explain: a search over two numbers of which the response to one is a sum over the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.evidence import RecordEvidence

_MEDIAN_TO_RMS = 1.4826  # of normal numbers
_FAR = 6.0  # rms of noise: no normal number in a long record is as far out
_SETTLED = 0.05  # of its end: so near a response is there
_BEGUN = 0.1  # of its end: from here on it shows
_AT_ONCE = 0.9  # of its end after one step: nothing lags
_LONGEST = 1000  # samples of a response, and of an opening
_MOST_OUT = 0.5  # of a record stands out: more is no event
_MOST = 12  # openings of a record, as in contact_times.py
_BESIDE = 16  # samples before the residual stands out in which it begins: a mass follows with the third power of time
_LEAST_SHARE = 0.5  # of the power of what stands out there: less is something else
_TAIL = 32  # samples after it has closed by which an end is judged
_MOST_PLACES = 24  # asked in a record: of more that stand out a lead is not what is wrong
_MOST_TOGETHER = 3  # of one place: one opens while the stage still rings of another
_OF_ANOTHER = 0.9  # of that power is left by one more: it was none
_LEAST_GAIN, _MOST_GAIN = 0.4, 2.5  # of the actuator: loops are no wider


def open_times_behind(
    record: RecordEvidence, noise_um: float, response: Array
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return when a lead opens and closes [s], each before the next; two empty lists where none does, or nothing lags.

    Args:
        record: with what the model left over.
        noise_um: noise floor [um].
        response: what the stage shows of a step of the drive, of its end [1], shape (n_response,).
    """
    unsettled = np.flatnonzero(np.abs(response - 1.0) > _SETTLED)
    if not unsettled.size or response[0] > _AT_ONCE:
        return (), ()
    n_settles = int(min(unsettled[-1] + 1, response.size, _LONGEST))
    pulses = np.diff(response[:n_settles], prepend=0.0)
    n_late = int(np.argmax(np.abs(response) > _BEGUN))
    span_v = float(np.ptp(record.voltage_v))
    um_per_v = float(np.ptp(record.predicted_um)) / span_v if span_v > 0.0 else 0.0
    left_um = np.array(record.residual_um)
    spread_um = _MEDIAN_TO_RMS * float(np.median(np.abs(left_um - np.median(left_um))))
    far_um = _FAR * max(noise_um, spread_um)
    gains = (-_MOST_GAIN * um_per_v, -_LEAST_GAIN * um_per_v)
    if np.count_nonzero(np.abs(left_um) > far_um) > _MOST_OUT * left_um.size:
        return (), ()
    found: list[tuple[int, int]] = []
    at = 1
    for _ in range(_MOST_PLACES):
        out = np.flatnonzero(np.abs(left_um[at:]) > far_um)
        if not out.size:
            break
        first = at + int(out[0])
        stop = _end_of_group(np.abs(left_um) > far_um, first, n_settles)
        group = slice(max(first - n_late - _BESIDE, at), stop + 1)
        own, rest_um = _in_group(record.voltage_v, left_um, pulses, group, n_late, far_um, gains)
        before_um, after_um = left_um[group], rest_um[group]
        if own and float(after_um @ after_um) < (1.0 - _LEAST_SHARE) * float(before_um @ before_um):
            found += own
            left_um = rest_um
        at = stop + 1
    if not 0 < len(found) <= _MOST:
        return (), ()
    # between two samples it opened, and between two it closed
    middle_s = 0.5 * (record.time_s[:-1] + record.time_s[1:])
    return tuple(float(middle_s[a - 1]) for a, _ in found), tuple(float(middle_s[b - 1]) for _, b in found)


def _in_group(
    voltage_v: Array,
    left_um: Array,
    pulses: Array,
    group: slice,
    n_late: int,
    far_um: float,
    gains: tuple[float, float],
) -> tuple[list[tuple[int, int]], Array]:
    """Return the openings that explain what stands out in these samples, one after the other, and what they leave.

    Each is first sample open and first sample closed.
    """
    # Many arguments: a record, how its stage answers, and what stands out there.
    found: list[tuple[int, int]] = []
    rest_um, at = left_um.copy(), group.start
    while len(found) < _MOST_TOGETHER:
        out = np.flatnonzero(np.abs(rest_um[at : group.stop]) > far_um)
        if not out.size:
            break
        first = at + int(out[0])
        latest = max(min(first - n_late + _BESIDE, first), at)
        begins = np.arange(max(first - n_late - _BESIDE, at), latest + 1)
        begin, end, gain = _best(voltage_v, rest_um, pulses, begins, group.stop - 1)
        if end <= begin or not gains[0] < gain < gains[1]:
            break
        after_um = rest_um - gain * _missed(voltage_v, pulses, begin, end)
        if float(after_um[group] @ after_um[group]) > _OF_ANOTHER * float(rest_um[group] @ rest_um[group]):
            break  # what a time that is off by a part of a sample leaves of one is no other
        found.append((begin, end))
        rest_um, at = after_um, end + 1
    return found, rest_um


def _end_of_group(is_far: NDArray[np.bool_], start: int, n_settles: int) -> int:
    """Return the last sample that stands out before the residual rests for as long as the response takes."""
    far = np.flatnonzero(is_far[start:])
    rests = np.flatnonzero(np.diff(far) > n_settles)
    return start + int(far[rests[0]] if rests.size else far[-1])


def _missed(voltage_v: Array, pulses: Array, begin: int, end: int) -> Array:
    """Return what a stage of gain one misses of the drive while the lead is open, and after [V], (n_samples,)."""
    unseen_v = np.zeros(voltage_v.size)
    unseen_v[begin:end] = voltage_v[begin:end] - voltage_v[begin - 1]
    stop = min(end + pulses.size, voltage_v.size)
    missed_v = np.zeros(voltage_v.size)
    missed_v[begin:stop] = np.convolve(unseen_v[begin:stop], pulses)[: stop - begin]
    return missed_v


def _best(
    voltage_v: Array,
    left_um: Array,
    pulses: Array,
    begins: NDArray[np.int64],
    stop: int,
) -> tuple[int, int, float]:
    """Return first sample open, first sample closed, and gain [um/V] of the opening that explains most.

    Two equal numbers where none explains anything.
    """
    best, explained = (0, 0, 0.0), 0.0
    for begin in begins:
        last = min(stop + 1, begin + _LONGEST, left_um.size - 1)
        end, of_all, gain = _best_end(voltage_v, left_um, pulses, int(begin), last)
        if of_all > explained:
            best, explained = (int(begin), end, gain), of_all
    return best


@compiled
def _best_end(voltage_v: Array, left_um: Array, pulses: Array, begin: int, last: int) -> tuple[int, float, float]:
    # Response to all that was missed so far, a sample at a time. Each end is judged by what it explains, less what it
    # leaves, until some samples after it: beyond them another opening may follow.
    n = min(last + pulses.size, left_um.size) - begin
    missed = np.zeros(n)
    best_end, best, best_gain = begin, 0.0, 0.0
    for k in range(begin, last):
        unseen = voltage_v[k] - voltage_v[begin - 1]
        for j in range(min(pulses.size, n - (k - begin))):
            missed[k - begin + j] += unseen * pulses[j]
        power, common, whole = 0.0, 0.0, 0.0
        for j in range(min(k - begin + _TAIL, n)):
            power += missed[j] * missed[j]
            common += missed[j] * left_um[begin + j]
            whole += left_um[begin + j] * left_um[begin + j]
        if power > 0.0 and 2.0 * common * common > (best + whole) * power:
            best_end, best, best_gain = k + 1, 2.0 * common * common / power - whole, common / power
    return best_end, best, best_gain

"""Voltages sent and displacements measured, each at its own times, as one recording."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import FomrcError
from fomrc_core.records.recording import Recording

Array = NDArray[np.float64]

# Lags tried when voltage and displacement are brought together: message, stage and message again.
_LONGEST_LAG_PERIODS = 20
_LAGS_PER_PERIOD = 4
# Within a period about the best of these; between two of these no message of a timer's regularity changes its place.
_FINER_LAGS_PER_PERIOD = 32
_FEWEST_SAMPLES = 10
# Where readings are further apart than this the drive is told in between as well. Between turns the order of voltages
# is all that hysteresis knows, and creep does not tell so short a ramp from its steps; every sample more is one that
# does not count, and a record of which a tenth does not is no record.
_LOST_PERIODS = 10.0
# A voltage that held for less was stamped at the time of another.
_SHORTEST_STEP_PERIODS = 1e-3


def heard_recording(sent: Array, seen: Array, period_s: float, name: str) -> Recording:
    """Return what was sent and measured, at the times of the displacements: no reading is changed or moved.

    A voltage holds until the next one, so at any time it is known which one the stage had; a displacement between two
    readings is not known. Where the voltage turned between two readings, and where readings are missing, there are
    samples whose displacement does not count: the stage went there, and its hysteresis remembers it.

    Args:
        sent: times [s] and voltages [V], shape (n_sent, 2), times rising.
        seen: times [s] and displacements [um], shape (n_seen, 2), times rising.
        period_s: nominal period of the voltages [s].
        name: name of the recording.

    Raises:
        FomrcError: fewer than ten displacements were measured while voltages were sent.
    """
    lag_s = held_lag_s(sent, seen, period_s)
    went_in_s = sent[:, 0] + lag_s
    inside = (seen[:, 0] >= went_in_s[0]) & (seen[:, 0] <= went_in_s[-1] + period_s)
    if np.count_nonzero(inside) < _FEWEST_SAMPLES:
        raise FomrcError("voltage and displacement were not measured at the same time: are both clocks set?")
    read_s, read_um = seen[inside, 0] - seen[inside, 0][0], seen[inside, 1]
    went_in_s -= seen[inside, 0][0]
    held = np.searchsorted(went_in_s, read_s, side="right") - 1
    turns_s = went_in_s[np.setdiff1d(_turning(sent[: held[-1], 1]), held)]
    at_s = np.union1d(turns_s[turns_s > 0.0], _lost_s(read_s, period_s))
    at_s = at_s[_is_apart(at_s, read_s, _SHORTEST_STEP_PERIODS * period_s)]
    held = np.concatenate((held, np.searchsorted(went_in_s, at_s, side="right") - 1))
    time_s = np.concatenate((read_s, at_s))
    order = np.argsort(time_s, kind="stable")
    moved_um = np.concatenate((read_um, np.interp(at_s, read_s, read_um)))
    counts = order < read_s.size if at_s.size else None
    return Recording(time_s[order], sent[held, 1][order], moved_um[order], is_valid=counts, name=name)


def _lost_s(read_s: Array, period_s: float) -> Array:
    """Return times within stretches without readings, rising: as many as tell creep how the drive went on."""
    gaps = np.flatnonzero(np.diff(read_s) > _LOST_PERIODS * period_s)
    step_s = _LOST_PERIODS * period_s
    return np.concatenate([np.empty(0), *(np.arange(read_s[k] + step_s, read_s[k + 1], step_s) for k in gaps)])


def _turning(voltage_v: Array) -> NDArray[np.intp]:
    """Return where a voltage is the last before it turns."""
    moves = np.flatnonzero(np.diff(voltage_v))
    is_up = np.diff(voltage_v)[moves] > 0.0
    return np.asarray(moves[1:][is_up[1:] != is_up[:-1]])


def _is_apart(at_s: Array, read_s: Array, shortest_s: float) -> NDArray[np.bool_]:
    """Return which of these times, rising, are a sample of their own beside the readings and the next of them."""
    after = np.searchsorted(read_s, at_s).clip(1, read_s.size - 1)
    is_apart = (at_s - read_s[after - 1] > shortest_s) & (read_s[after] - at_s > shortest_s)
    return np.asarray(is_apart & (np.diff(at_s, append=np.inf) > shortest_s))


def held_lag_s(sent: Array, seen: Array, period_s: float) -> float:
    """Return the lag [s] at which displacement follows the voltage held best.

    Where both tick at one rate, every lag of a part of a period gives each reading the same voltage. The middle of
    that part is returned: there a timer's jitter changes least.

    Args:
        sent: times [s] and voltages [V], shape (n_sent, 2).
        seen: times [s] and displacements [um], shape (n_seen, 2).
        period_s: nominal period of the voltages [s].
    """
    change_um = np.diff(seen[:, 1])

    def score(lag_s: float) -> float:
        held = np.searchsorted(sent[:, 0] + lag_s, seen[:, 0], side="right") - 1
        return float(change_um @ np.diff(sent[np.maximum(held, 0), 1]))

    coarse_s = period_s / _LAGS_PER_PERIOD * np.arange(_LONGEST_LAG_PERIODS * _LAGS_PER_PERIOD + 1)
    near_s = coarse_s[int(np.argmax([score(lag_s) for lag_s in coarse_s]))]
    fine = np.arange(-_FINER_LAGS_PER_PERIOD, _FINER_LAGS_PER_PERIOD + 1)
    lags_s = near_s + period_s / _FINER_LAGS_PER_PERIOD * fine
    scores = np.array([score(lag_s) for lag_s in lags_s])
    best = int(np.argmax(scores))
    is_less = np.flatnonzero(scores < scores[best] * (1.0 - 1e-9))
    before, after = is_less[is_less < best], is_less[is_less > best]
    first = int(before[-1]) + 1 if before.size else 0
    last = int(after[0]) - 1 if after.size else lags_s.size - 1
    return float(0.5 * (lags_s[first] + lags_s[last]))


def best_lag_s(sent: Array, seen: Array, period_s: float) -> float:
    """Return the lag [s] at which displacement, straight between its readings, follows voltage best.

    Args:
        sent: times [s] and voltages [V], shape (n_sent, 2).
        seen: times [s] and displacements [um], shape (n_seen, 2).
        period_s: nominal period [s].
    """
    change_v = np.diff(sent[:, 1])
    best, best_score = 0.0, -np.inf
    for k in range(_LONGEST_LAG_PERIODS * _LAGS_PER_PERIOD + 1):
        lag_s = k * period_s / _LAGS_PER_PERIOD
        score = float(change_v @ np.diff(np.interp(sent[:, 0] + lag_s, seen[:, 0], seen[:, 1])))
        if score > best_score * (1.0 + 1e-6):
            best, best_score = lag_s, score
    return best

"""Times at which something befell a record, each moved by itself to where it leaves least: a jump has no derivative.

Those that gain nothing are no times of anything.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from fomrc_core.effects.base.cause import Cause
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import centred, squared_error
from fomrc_core.fitting.trial_model import TrialModel, predict_passing, stage_of
from fomrc_core.model.simulation import Before

_MOVES = (8.0, 6.0, 4.0, 3.0, 2.0, 1.5, 1.0, 0.5, 0.25, 0.125)  # samples a time is moved by
_MOST_TRIALS = 600  # a simulation each


def with_times_moved(model: TrialModel, record: FitRecord, index: int) -> TrialModel:
    """Return the model with the times of its causes in one record where they leave least, the idle ones gone.

    Each time in turn goes where it leaves least of all places within some samples, the near ones asked as well as the
    far ones: a drive comes by one voltage often, and a step that is too long leads into the next valley. A moment from
    which on one level is another goes to any place of the record, where cumulated sums ask for it. No time goes
    to or from where the record's samples are not looked at: there nothing holds it, and it would make up for what is
    wrong elsewhere.

    Args:
        model: of this record alone, or of several of which this is one.
        record: the record.
        index: which it is in the model.
    """
    for cause in model.causes_in(index):
        if any(getattr(cause, name) for name in cause.moved_times):
            model = _without_idle(_moved(model, record, index, cause), record, index, cause.name)
        elif cause.moved_moments:
            model = _moved(model, record, index, cause)
    return model


def with_times_moved_in_all(model: TrialModel, records: Sequence[FitRecord]) -> TrialModel:
    """Return the model with the times of its causes in each of its first records, these, where they leave least."""
    for index, record in enumerate(records):
        model = with_times_moved(model, record, index)
    return model


def with_moments_placed(model: TrialModel, records: Sequence[FitRecord]) -> TrialModel:
    """Return the model with each moment of its causes in these records, its first, where cumulated sums put it.

    A moment that was read from what a bent base had left may be any number of samples off, with nothing to gain by a
    few: of all places the best is asked, and only that.
    """
    for index, record in enumerate(records):
        for cause in model.causes_in(index):
            if cause.moved_moments:
                model = _moved(model, record, index, cause, moves=(), n_most=1)
    return model


def _far_change(model: TrialModel, record: FitRecord, index: int, cause: Cause, name: str) -> float:
    """Return by how much [s] a moment has to move to where what is left asks for it, 0.0 where it stands there.

    What changes at a moment is taken for one level from there on, so that what any other place would leave is a
    cumulated sum of what this one leaves.
    """
    if name not in cause.moved_moments:
        return 0.0
    moment_s, time_s, used = float(getattr(cause, name)), record.time_s, record.is_used
    later = next(_changed(cause, {name: 2.0 * float(time_s[-1]) - float(time_s[0])}), None)
    is_after = used & (time_s > moment_s)
    if later is None or not np.any(is_after):
        return 0.0
    here_um, _ = predict_passing(model.alone(index), record, 0)
    never_um, _ = predict_passing(model.with_cause(later, index).alone(index), record, 0)
    level_um = float(np.median((never_um - here_um)[is_after]))
    left_um = centred(record.measured_um - here_um, used)
    begin = int(np.searchsorted(time_s, moment_s))
    n_between = np.concatenate(([0], np.cumsum(used)))
    n_between -= n_between[begin]
    between_um = np.concatenate(([0.0], np.cumsum(np.where(used, left_um, 0.0))))
    between_um -= between_um[begin]
    # moved later the samples between come to the level, moved sooner they lose it; the mean goes with them
    n_used = max(int(np.count_nonzero(used)), 1)
    gain = 2.0 * level_um * between_um - level_um**2 * (np.abs(n_between) - n_between**2 / n_used)
    best = int(np.argmax(gain[: time_s.size]))
    return float(time_s[best] - moment_s) if gain[best] > 0.0 else 0.0


def _without_idle(model: TrialModel, record: FitRecord, index: int, name: str) -> TrialModel:
    """Return the model without the times, one of each list together, that gain no more than such times do by chance."""
    cause = _cause(model, index, name)
    error, n_used = _error(model, record, index), max(int(np.count_nonzero(record.is_used)), 2)
    chance = math.exp(len(cause.moved_times) * math.log(n_used) / n_used)  # of either error (Schwarz, 1978)
    for at in reversed(range(len(getattr(cause, cause.moved_times[0])))):
        lists_s = {listed: getattr(cause, listed) for listed in cause.moved_times}
        shorter_s = {listed: (*times_s[:at], *times_s[at + 1 :]) for listed, times_s in lists_s.items()}
        fewer = next(_changed(cause, shorter_s), None)
        if fewer is None or not _is_seen(record, *(times_s[at] for times_s in lists_s.values())):
            continue
        option = model.with_cause(fewer, index)
        option_error = _error(option, record, index)
        if option_error <= chance * error:
            model, cause, error = option, fewer, option_error
    return model


def _cause(model: TrialModel, index: int, name: str) -> Cause:
    return next(cause for cause in model.causes_in(index) if cause.name == name)


def _moved(
    model: TrialModel,
    record: FitRecord,
    index: int,
    cause: Cause,
    moves: tuple[float, ...] = _MOVES,
    n_most: int = _MOST_TRIALS,
) -> TrialModel:
    """Return the model with each time of a cause moved by the best of so many samples, a moment to any place as well.

    No other round begins after so many trials.
    """
    step_s = float(np.median(record.steps_s))
    changes_s = [sign * samples * step_s for samples in moves for sign in (1.0, -1.0)]
    error, n_trials = _error(model, record, index), 0
    # times move nothing that comes before their cause in the chain
    before = Before(predict_passing(model.alone(index), record, 0)[1], stage_of(cause))
    # beginning and end of one event make up for each other; events apart from one another do not
    open_places = {at for _, at in _numbers(cause, record)}
    while open_places and n_trials < n_most:
        moved_places = set()
        for name, at in _numbers(cause, record):
            if at not in open_places:
                continue
            best = error, model, cause
            far_s = _far_change(model, record, index, cause, name)
            errors = {0.0: error}
            for change_s in (*changes_s, far_s) if far_s else changes_s:
                for trial in _with_one_moved(cause, (name, at), change_s, record):
                    option = model.with_cause(trial, index)
                    errors[change_s] = _error(option, record, index, before)
                    n_trials += 1
                    if errors[change_s] < best[0]:
                        best = errors[change_s], option, trial
            if best[1] is not model:
                moved_places.add(at)
            elif between_s := _between_s(errors, _MOVES[-1] * step_s):
                for trial in _with_one_moved(cause, (name, at), between_s, record):
                    option = model.with_cause(trial, index)
                    best = min(best, (_error(option, record, index, before), option, trial), key=lambda b: b[0])
            error, model, cause = best
        open_places = moved_places
    return model


def _between_s(errors: Mapping[float, float], near_s: float) -> float:
    """Return where between the least moves of a time, none of which gains, it leaves least [s]; 0.0 where it stands.

    Between two samples the drive goes straight, so that the squared error is a parabola there: where it goes by a whole
    step in one of them a sixteenth of a sample is as much of the step.
    """
    if near_s not in errors or -near_s not in errors:
        return 0.0
    sooner, here, later = errors[-near_s], errors[0.0], errors[near_s]
    bend = sooner - 2.0 * here + later
    return 0.5 * near_s * (sooner - later) / bend if bend > 0.0 else 0.0


def _numbers(cause: Cause, record: FitRecord) -> list[tuple[str, int | None]]:
    """Return what is moved of a cause: places in its lists, moments within the record, and how long they take."""
    listed = [(name, at) for name in cause.moved_times for at in range(len(getattr(cause, name)))]
    moments = [name for name in cause.moved_moments if getattr(cause, name) < record.time_s[-1]]
    return [*listed, *((name, None) for name in (*moments, *cause.moved_durations))]


def _with_one_moved(
    cause: Cause, number: tuple[str, int | None], change_s: float, record: FitRecord
) -> Iterator[Cause]:
    """Yield the cause with one of its times moved; nothing where it cannot be there, or nobody looks there.

    What takes longer is tried where it begins as before, and where its moments come as much earlier: a jump between two
    levels that stands for a rise stands in its middle.
    """
    name, at = number
    if name in cause.moved_durations:
        before_s = float(getattr(cause, name))
        after_s = max(before_s + change_s, 0.0)
        if after_s != before_s:
            moments = {m: float(getattr(cause, m)) for m in cause.moved_moments}
            earlier_s = {m: (t, t + before_s - after_s) for m, t in moments.items() if t < record.time_s[-1]}
            sooner = {m: pair[1] for m, pair in earlier_s.items() if _is_seen(record, *pair)}
            yield from _changed(cause, {name: after_s})
            yield from _changed(cause, {name: after_s, **sooner})
    elif at is None:
        before_s = float(getattr(cause, name))
        if _is_seen(record, before_s, before_s + change_s):
            yield from _changed(cause, {name: before_s + change_s})
    else:
        times_s = list(getattr(cause, name))
        before_s, times_s[at] = times_s[at], times_s[at] + change_s
        if _is_seen(record, before_s, times_s[at]):
            yield from _changed(cause, {name: tuple(times_s)})


def _changed(cause: Cause, times_s: Mapping[str, float | tuple[float, ...]]) -> Iterator[Cause]:
    try:
        yield replace(cause, **times_s)
    except ParameterError:
        return


def _is_seen(record: FitRecord, *times_s: float) -> bool:
    """Return whether the samples about these times are all looked at."""
    last = record.time_s.size - 1
    after = np.clip(np.searchsorted(record.time_s, times_s), 1, last)
    return bool(np.all(record.is_used[after]) and np.all(record.is_used[after - 1]))


def _error(model: TrialModel, record: FitRecord, index: int, before: Before | None = None) -> float:
    predicted_um, _ = predict_passing(model.alone(index), record, 0, before=before)
    return squared_error((record,), (centred(record.measured_um - predicted_um, record.is_used),))

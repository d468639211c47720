"""Times at which something befell a record, each moved by itself to where it leaves least: a jump has no derivative."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fomrc_core.effects.base.cause import Cause
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import residuals, squared_error
from fomrc_core.fitting.trial_model import TrialModel

_FARTHEST, _NEAREST = 8.0, 0.1  # samples a time is moved by: at first, and when no move is worth more
_MOST_TRIALS = 600  # a simulation each


def with_times_moved(model: TrialModel, record: FitRecord, index: int) -> TrialModel:
    """Return the model with the times of its causes in one record where they leave least, all else held.

    Each time in turn goes a step earlier and later; where none gains the step is halved.

    Args:
        model: of this record alone, or of several of which this is one.
        record: the record.
        index: which it is in the model.
    """
    for cause in model.causes_in(index):
        if any(getattr(cause, name) for name in cause.moved_times):
            model = _moved(model, record, index, cause)
    return model


def _moved(model: TrialModel, record: FitRecord, index: int, cause: Cause) -> TrialModel:
    step_s = _FARTHEST * float(np.median(record.steps_s))
    least_s = _NEAREST / _FARTHEST * step_s
    error, n_trials = _error(model, record, index), 0
    while step_s >= least_s and n_trials < _MOST_TRIALS:
        is_better = False
        for name in cause.moved_times:
            for at in range(len(getattr(cause, name))):
                for change_s in (step_s, -step_s):
                    trial = _with_one_moved(cause, name, at, change_s)
                    if trial is None:
                        continue
                    option = model.with_cause(trial, index)
                    option_error = _error(option, record, index)
                    n_trials += 1
                    if option_error < error:
                        model, cause, error, is_better = option, trial, option_error, True
                        break
        if not is_better:
            step_s *= 0.5
    return model


def _with_one_moved(cause: Cause, name: str, at: int, change_s: float) -> Cause | None:
    times_s = list(getattr(cause, name))
    times_s[at] += change_s
    try:
        return replace(cause, **{name: tuple(times_s)})
    except ParameterError:
        return None


def _error(model: TrialModel, record: FitRecord, index: int) -> float:
    return squared_error((record,), residuals(model.alone(index), (record,)))

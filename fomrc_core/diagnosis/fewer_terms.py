"""Terms without a name that are not missed once all others are fitted anew: as few stay as do about as well held out.

Terms are chosen with memories and swings where a grid has them, and one more is spent on what those are beside the
right ones. Once their memories are fitted it says nothing, or says the same thing twice: a swing beside one that no
record is long enough to tell from it.
"""

from __future__ import annotations

import numpy as np

from fomrc_core.diagnosis.data_split import DataSplit, held_squared_error
from fomrc_core.diagnosis.held_out_score import WORTHWHILE_LOG_GAIN
from fomrc_core.diagnosis.terms_fit import fitted_beside, terms_in
from fomrc_core.effects import Effect
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.linear_part import residuals, squared_error
from fomrc_core.fitting.trial_model import TrialModel


def with_fewer_terms(extended: TrialModel, split: DataSplit) -> TrialModel:
    """Return the model without the terms that are not missed, the least of them first; as it is where each is.

    Args:
        extended: a model with terms, fitted together with its plays.
        split: records; those held out say what is missed.
    """
    least = held_squared_error(extended, split.held)
    while sum(effect.n_terms for effect in terms_in(extended)) > 1:
        fewer = min(_without_one(extended), key=lambda model: _learned_error(model, split))
        try:
            fitted = fitted_beside(fewer, split.train)
            error = np.inf if fitted is None else held_squared_error(fitted, split.held)
        except ParameterError:
            break  # weights beyond all bounds: the records do not tell what is left from what plays can do
        if fitted is None or error > least * np.exp(WORTHWHILE_LOG_GAIN):
            break
        extended, least = fitted, min(least, error)
    return extended


def _without_one(model: TrialModel) -> list[TrialModel]:
    """Return the models without one of the terms, nothing fitted anew."""
    return [_without(model, effect, k) for effect in terms_in(model) for k in range(effect.n_terms)]


def _without(model: TrialModel, effect: Effect, number: int) -> TrialModel:
    kept = [k for k in range(effect.n_terms) if k != number]
    if not kept:
        return model.without(effect.name)
    return model.with_cause(effect.with_terms(kept, np.array(getattr(effect, effect.main_parameter))[kept]))


def _learned_error(model: TrialModel, split: DataSplit) -> float:
    try:
        return squared_error(split.train, residuals(model, split.train))
    except ParameterError:
        return np.inf

"""Terms without a name and the base beside them, fitted together: weights of terms, of plays, and creep order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.least_squares import normal_equations, signed_weights
from fomrc_core.diagnosis.element_weights import without_idle
from fomrc_core.effects import Effect
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.base_fit import rebased
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import (
    MAX_ORDER,
    MIN_ORDER,
    centred,
    order_slope,
    record_columns,
    residuals,
    squared_error,
)
from fomrc_core.fitting.trial_model import TrialModel, predict

_MOST_STEPS = 6
_MOST_HALVINGS = 4
_LEAST_GAIN = 0.01  # of the squared error: less is not worth another step, nor plays chosen once more
_LONGEST_ORDER_STEP = 0.05  # far from the answer a linear step in the order overshoots
_LOG_DIFFERENCE = 1e-3  # of a memory's logarithm
_LONGEST_LOG_STEP = 0.5  # a slope says nothing of a rate several times as fast
_SHARE_OF_DIFFERENCE = 1e-4  # of the span a term may move: far above rounding, far below what bends


def terms_in(model: TrialModel) -> tuple[Effect, ...]:
    """Return the effects of a model that are sums of terms without a name."""
    return tuple(effect for effect in model.effects if effect.n_terms)


def fitted_beside(model: TrialModel, records: tuple[FitRecord, ...]) -> TrialModel | None:
    """Return the model with terms, plays and creep order fitted together, the weights of plays not negative.

    A term acts on what plays and creep move, so that its weight and theirs are factors of each other: a step that holds
    one in the other's direction goes too far by as much as both are changed. So the direction of each weight is taken
    where the others are, a step that does not gain is halved, and plays are chosen anew from the grid once it is still.

    Args:
        model: with its terms, near their weights; its plays' of either sign.
        records: what to fit.
    """
    begun = _with_elements(rebased(model, records))
    if begun is None:
        return None
    still = _descended(begun, records)
    if _error(still, records) > (1.0 - _LEAST_GAIN) * _error(begun, records):
        return still
    again = _with_elements(rebased(still, records))
    return still if again is None else min((still, _descended(again, records)), key=lambda m: _error(m, records))


def _error(model: TrialModel, records: tuple[FitRecord, ...]) -> float:
    return squared_error(records, residuals(model, records))


def _with_elements(model: TrialModel) -> TrialModel | None:
    """Return the model with the instantaneous part no inverse can do without; None where plays have no weight."""
    if not float(np.sum(model.weights[model.columns.is_plain])) > 0.0:
        return None  # terms that leave nothing to the actuator
    return without_idle(model)


def _descended(model: TrialModel, records: tuple[FitRecord, ...]) -> TrialModel:
    """Return the model at the end of steps that gain, each to the best weights of the linear model about it."""
    error = _error(model, records)
    for _ in range(_MOST_STEPS):
        there = _best_about(model, records)
        if there is None:
            break
        here = (model.weights, np.array([model.creep_order]), *(_numbers(e) for e in terms_in(model)))
        found, share = None, 1.0
        for _ in range(_MOST_HALVINGS):
            mixed = [a + share * (b - a) for a, b in zip(here, there, strict=True)]
            try:
                trial = _with(model, mixed)
                after = _error(trial, records)
            except ParameterError:
                after = np.inf
            if after < error:
                found = (trial, after)
                break
            share *= 0.5
        if found is None:
            break
        is_still = found[1] > (1.0 - _LEAST_GAIN) * error
        model, error = found
        if is_still:
            break
    cleaned = _with_elements(model)
    return model if cleaned is None else cleaned


def _numbers(effect: Effect) -> Array:
    """Return what is fitted of an effect: the weights of its terms, then the logarithms of its memory."""
    return np.concatenate((getattr(effect, effect.main_parameter), effect.memory()))


def _with_numbers(effect: Effect, numbers: Array) -> Effect:
    n_terms = effect.n_terms
    return effect.with_terms(range(n_terms), numbers[:n_terms]).with_memory(numbers[n_terms:])


def _with(model: TrialModel, parts: Sequence[Array]) -> TrialModel:
    """Return the model with these weights of plays, creep order, weights of each effect's terms."""
    weights, order, *of_terms = parts
    changed = replace(model, weights=weights, creep_order=float(order[0]))
    for effect, own in zip(terms_in(model), of_terms, strict=True):
        changed = changed.with_cause(_with_numbers(effect, own))
    return changed


def _best_about(model: TrialModel, records: tuple[FitRecord, ...]) -> list[Array] | None:
    """Return weights of plays, creep order, numbers of each effect where the model linear about this one fits best."""
    effects = terms_in(model)
    n_columns, n_order = model.weights.size, 0 if model.replaces_creep else 1

    def rows(index: int, record: FitRecord) -> tuple[Array, Array, Mask]:
        moved_um = predict(model, record, index)
        columns = [record_columns(model, record, index)]
        if n_order:
            columns.append(order_slope(model, record, index)[:, None])
        columns += [term_directions(model, effect, record, index) for effect in effects]
        left = centred(record.measured_um - moved_um, record.is_used)
        return centred(np.column_stack(columns), record.is_used), left, record.is_used

    equations = normal_equations(rows(i, r) for i, r in enumerate(records))
    of_terms = [_numbers(effect) for effect in effects]
    # what the model has already, put back: it is the whole weights that must not be negative
    present = np.concatenate((model.weights, np.zeros(n_order), *of_terms))
    is_positive = np.zeros(present.size, dtype=np.bool_)
    is_positive[:n_columns] = model.columns.is_plain
    best = signed_weights(equations.gram, equations.moment + equations.gram @ present, is_positive)
    if not np.all(np.isfinite(best)):
        return None
    change = float(np.clip(best[n_columns], -_LONGEST_ORDER_STEP, _LONGEST_ORDER_STEP)) if n_order else 0.0
    order = float(np.clip(model.creep_order + change, MIN_ORDER, MAX_ORDER))
    found = [best[:n_columns], np.array([order])]
    ends = np.cumsum([n_columns + n_order, *(w.size for w in of_terms)])
    for effect, now, first, end in zip(effects, of_terms, ends, ends[1:], strict=False):
        n_terms = effect.n_terms
        turn = np.clip(best[first + n_terms : end] - now[n_terms:], -_LONGEST_LOG_STEP, _LONGEST_LOG_STEP)
        found.append(np.concatenate((best[first : first + n_terms], now[n_terms:] + turn)))
    return found


def term_directions(model: TrialModel, effect: Effect, record: FitRecord, index: int) -> Array:
    """Return the displacement per unit of each weight and each logarithm of the memory, by differences.

    Shape (n_samples, n_numbers).

    Args:
        model: without the effect, or with other weights of it.
        effect: the terms, with the numbers about which.
        record: the record.
        index: which record it is.
    """
    numbers = _numbers(effect)
    sizes = np.full(numbers.size, _LOG_DIFFERENCE)
    sizes[: effect.n_terms] = effect.weight_of_span() * _SHARE_OF_DIFFERENCE
    here = predict(model.with_cause(effect), record, index, is_coarse=True)
    columns = np.empty((here.size, numbers.size))
    for k, size in enumerate(sizes):
        other = numbers.copy()
        other[k] += size
        there = predict(model.with_cause(_with_numbers(effect, other)), record, index, is_coarse=True)
        columns[:, k] = (there - here) / size
    return columns

"""When something is left that no cause explains: a few terms that follow it, chosen and sized on held-out data.

The terms are those an effect offers. They are chosen one by one by what each takes off the training error beside the
weights of the plays (orthogonal least squares: Chen, Billings and Luo, Int. J. Control 50 (1989) 1873-1896); how many
stay, and whether any does, is said by held-out data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.least_squares import NormalEquations, normal_equations, signed_weights
from fomrc_core.diagnosis.data_split import DataSplit, HeldOut, held_residuals
from fomrc_core.diagnosis.held_out_score import WORTHWHILE_LOG_GAIN, held_out_score
from fomrc_core.effects import Effect, effect_classes
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import centred, record_columns
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.residual import rms

_WORTH_TRYING = 1.1  # times the noise floor: less is what a floor is known to
_SIGNIFICANCE = 0.01  # of the gain on held-out data, shared by the terms offered (Bonferroni)
_MOST_TERMS = 8
_MOST_SAMPLES = 40_000  # of a record, spread evenly: a few terms need no more
_REST_S = 1e9  # before a record that begins at rest


@dataclass(frozen=True, eq=False)
class UnnamedExtension:
    """Terms that follow what no cause explains.

    Attributes:
        effect: the terms.
        words: what they depend on.
        rms_before_um: error on the quoted record without them [um].
        rms_after_um: error there with them [um].
        p_value: of the hypothesis that they gain nothing on held-out data.
    """

    effect: Effect
    words: str
    rms_before_um: float
    rms_after_um: float
    p_value: float

    def __str__(self) -> str:
        return (
            f"unnamed: what is left {self.words}: {1e3 * self.rms_before_um:.4g} -> {1e3 * self.rms_after_um:.4g} nm "
            f"rms with {self.effect.n_terms} terms that no cause stands for"
        )


def unnamed_extension(
    model: TrialModel, split: DataSplit, floor_um: float
) -> tuple[TrialModel, UnnamedExtension] | None:
    """Return the model with terms that follow what it leaves, and what they are; None where none surely gains.

    Args:
        model: with all causes that were found, its weights those of Maxwell elements.
        split: records.
        floor_um: noise floor [um].
    """
    before = held_residuals(model, split.held)
    if rms(np.concatenate(before)) < _WORTH_TRYING * floor_um:
        return None
    offered = _offered(model, split)
    if offered is None:
        return None
    learned = _equations(model, offered, [HeldOut(r, i) for i, r in enumerate(split.train)])
    held = _rows(model, offered, split.held)
    chosen = _chosen(learned, held, model.weights.size)
    if not chosen:
        return None
    extended = _fitted(model, offered, chosen, learned)
    score = held_out_score(before, held_residuals(extended, split.held))
    if score.p_value >= _SIGNIFICANCE / offered.n_terms or not score.is_worthwhile():
        return None
    effect = next(e for e in extended.effects if e.name == offered.name)
    quoted_before, quoted_after = (rms(np.concatenate(held_residuals(m, split.report))) for m in (model, extended))
    return extended, UnnamedExtension(effect, effect.words(), quoted_before, quoted_after, score.p_value)


def _offered(model: TrialModel, split: DataSplit) -> Effect | None:
    """Return all terms there are to choose from; None where nothing moves."""
    moved = [predict(model, record, i)[record.is_used] for i, record in enumerate(split.train)]
    span_um = max(float(np.max(np.abs(y))) for y in moved)
    if not span_um > 0.0:
        return None
    step_s = float(np.median(split.train[0].steps_s))
    longest_s = max(float(record.time_s[-1]) for record in split.train)
    offers = (kind.offered(span_um, step_s, longest_s) for kind in effect_classes().values())
    return next((offer for offer in offers if offer is not None), None)


def _rows(model: TrialModel, offered: Effect, parts: Sequence[HeldOut]) -> list[tuple[Array, Array]]:
    """Return for each stretch columns of plays and terms, and what they must fit, at samples spread evenly."""
    found = []
    for part in parts:
        record, index = part.record, part.index
        moved_um = predict(model, record, index)
        used = np.flatnonzero(record.is_used)
        at = used[:: max(1, -(-used.size // _MOST_SAMPLES))]
        terms = _terms(model, offered, record, index, moved_um, at)
        columns = np.column_stack((record_columns(model, record, index)[at], terms))
        every: Mask = np.ones(at.size, dtype=np.bool_)
        target = centred((record.measured_um - moved_um)[at], every)
        found.append((centred(columns, every), target))
    return found


def _terms(
    model: TrialModel, offered: Effect, record: FitRecord, index: int, moved_um: Array, at: NDArray[np.int64]
) -> Array:
    columns = []
    for k in range(offered.n_terms):
        one = offered.with_terms([k], np.ones(1))
        state = one.initial_state()
        if model.start_of(index) is not None:
            one.terms(state, moved_um[:1], np.array([_REST_S]))
        columns.append(one.terms(state, moved_um, record.steps_s)[at, 0])
    return np.column_stack(columns)


def _equations(model: TrialModel, offered: Effect, parts: Sequence[HeldOut]) -> NormalEquations:
    rows = _rows(model, offered, parts)
    return normal_equations((c, y, np.ones(y.size, dtype=np.bool_)) for c, y in rows)


def _chosen(learned: NormalEquations, held: list[tuple[Array, Array]], n_columns: int) -> list[int]:
    """Return the terms that stay: as few as do about as well on held-out data as the best number of them."""
    # beside the terms the weights of the plays may move: what those can do is taken out of every term
    beside = learned.without(n_columns)
    order: list[int] = []
    left = [_left(learned, held, n_columns, order)]
    n_offered = beside.moment.size
    for _ in range(min(_MOST_TERMS, n_offered)):
        before = beside.of(np.array(order, dtype=np.int64)).explained if order else 0.0
        gains = [beside.of(np.array([*order, k])).explained if k not in order else before for k in range(n_offered)]
        best = int(np.argmax(gains))
        if not gains[best] > before:
            break
        order.append(best)
        left.append(_left(learned, held, n_columns, order))
    errors = [sum(float(v @ v) for v in residuals) for residuals in left]
    best = int(np.argmin(errors))
    enough = errors[best] * np.exp(WORTHWHILE_LOG_GAIN)
    return order[: next(n for n in range(best + 1) if n == best or errors[n] <= enough)]


def _left(learned: NormalEquations, held: list[tuple[Array, Array]], n_columns: int, chosen: list[int]) -> list[Array]:
    """Return what plays and terms, fitted in training, leave of the held-out stretches [um]."""
    at = np.r_[np.arange(n_columns), n_columns + np.array(chosen, dtype=np.int64)].astype(np.int64)
    weights = learned.of(at).solution()
    return [y - c[:, at] @ weights for c, y in held]


def _fitted(model: TrialModel, offered: Effect, chosen: list[int], learned: NormalEquations) -> TrialModel:
    """Return the model with the terms, weights of elements not negative."""
    n_columns = model.weights.size
    at = np.r_[np.arange(n_columns), n_columns + np.array(chosen)]
    own = learned.of(at)
    # what the model has already, put back: it is the whole weights that must not be negative
    moment = own.moment + own.gram[:, :n_columns] @ model.weights
    is_positive = np.r_[model.columns.is_plain, np.zeros(len(chosen), dtype=np.bool_)]
    weights = signed_weights(own.gram, moment, is_positive)
    plain = model.columns.is_plain
    is_slope = plain & (model.columns.thresholds_v == 0.0)
    of_plays = weights[:n_columns]
    if not float(np.sum(of_plays[is_slope])) > 0.0:
        of_plays = model.weights  # without an instantaneous part there is no inverse
    kept = ~plain | is_slope | (of_plays > 0.0)
    effect = offered.with_terms(chosen, weights[n_columns:])
    return replace(model.with_cause(effect), columns=model.columns.chosen(kept), weights=of_plays[kept])

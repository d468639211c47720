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
from fomrc_core.compute.least_squares import NormalEquations, normal_equations
from fomrc_core.diagnosis.data_split import DataSplit, HeldOut, held_residuals, held_squared_error, quoted_residuals
from fomrc_core.diagnosis.drive_period import drive_period_v
from fomrc_core.diagnosis.extended_model import is_no_worse
from fomrc_core.diagnosis.fewer_terms import with_fewer_terms
from fomrc_core.diagnosis.held_out_score import WORTHWHILE_LOG_GAIN, held_out_score
from fomrc_core.diagnosis.terms_fit import fitted_beside, term_directions
from fomrc_core.effects import Covariate, Effect, Stage, effect_classes
from fomrc_core.effects.base.linear_terms import LinearTerms
from fomrc_core.effects.base.ringing import ringing_peaks_hz
from fomrc_core.effects.base.term_scales import TermScales
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.evidence import evidence_of
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import centred, order_slope, record_columns, residuals
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.residual import rms

_WORTH_TRYING = 1.1  # times the noise floor: less is what a floor is known to
# Of the gain on held-out data, divided by the sets of terms of which they choose one (Bonferroni). The terms of a set
# are chosen in training, however many are offered; held-out data choose how many stay.
_SIGNIFICANCE = 0.05
_MOST_TERMS = 8
_MOST_SAMPLES = 20_000  # of a record, spread evenly: a few terms need no more
_MOST_TURNS = 6
_REST_S = 1e9  # before a record that begins at rest


@dataclass(frozen=True, eq=False)
class UnnamedExtension:
    """Terms that follow what no cause explains.

    Attributes:
        effects: the terms, those of one signal in one effect.
        words: what they depend on.
        rms_before_um: error on the quoted record without them [um].
        rms_after_um: error there with them [um].
        p_value: of the hypothesis that they gain nothing on held-out data.
    """

    effects: tuple[Effect, ...]
    words: str
    rms_before_um: float
    rms_after_um: float
    p_value: float

    def __str__(self) -> str:
        return (
            f"unnamed: what is left {self.words}: {1e3 * self.rms_before_um:.4g} -> {1e3 * self.rms_after_um:.4g} nm "
            f"rms with {self.n_terms} terms that no cause stands for"
        )

    @property
    def n_terms(self) -> int:
        """Number of terms."""
        return sum(effect.n_terms for effect in self.effects)


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
    if not offered:
        return None
    extended = _extended(model, offered, split)
    if extended is None:
        return None
    extended = with_fewer_terms(extended, split)
    score = held_out_score(before, held_residuals(extended, split.held))
    is_sure = score.p_value < _SIGNIFICANCE / len(_sets(offered))
    if not is_sure or not score.is_worthwhile() or not is_no_worse(extended, model, split):
        return None
    names = {effect.name for effect in offered}
    effects = tuple(effect for effect in extended.effects if effect.name in names)
    words = "depends on " + "; on ".join(effect.words() for effect in effects)
    quoted_before, quoted_after = (rms(np.concatenate(quoted_residuals(m, split.report))) for m in (model, extended))
    return extended, UnnamedExtension(effects, words, quoted_before, quoted_after, score.p_value)


def _extended(model: TrialModel, offered: Sequence[Effect], split: DataSplit) -> TrialModel | None:
    """Return the model with the terms that stay; None where none does.

    What no cause explains has bent the weights of the plays and the creep order that were fitted without it, and terms
    would be spent on mending that. So both are fitted anew beside the terms, and the terms chosen again, those with a
    where the fit has moved it to as well, and where what is left now rings.
    """
    best, least = None, np.inf
    for _ in range(_MOST_TURNS):
        learned = _equations(model, offered, [HeldOut(r, i) for i, r in enumerate(split.train)])
        n_linear = learned.moment.size - sum(effect.n_terms for effect in offered)
        chosen = _chosen(learned, _rows(model, offered, split.held), n_linear, _sets(offered))
        if not chosen:
            break
        solution = learned.of(_places(chosen, n_linear)).solution()
        try:
            extended = fitted_beside(_with_terms(model, offered, chosen, solution[n_linear:]), split.train)
        except ParameterError:
            break  # weights beyond all bounds: the records do not tell the terms from what plays and creep can do
        if extended is None:
            break
        error = held_squared_error(extended, split.held)
        if not error < least:
            break
        is_still = error > least * np.exp(-WORTHWHILE_LOG_GAIN)
        best, least = extended, error
        if is_still:
            break
        offered = _offered(model, split, extended)
        model = replace(extended, effects=model.effects)
    return best


def _offered(model: TrialModel, split: DataSplit, found: TrialModel | None = None) -> list[Effect]:
    """Return all terms there are to choose from; none where nothing moves.

    Args:
        model: without terms.
        split: records.
        found: with terms that were chosen before, where some were.
    """
    moved = [predict(model, record, i)[record.is_used] for i, record in enumerate(split.train)]
    span_um = max(float(np.max(np.abs(y))) for y in moved)
    if not span_um > 0.0:
        return []
    step_s = float(np.median(split.train[0].steps_s))
    longest_s = max(float(record.time_s[-1]) for record in split.train)
    left_um = residuals(found or model, split.train)
    used = [v[r.is_used] for v, r in zip(left_um, split.train, strict=True)]
    period_v = drive_period_v([r.voltage_v[r.is_used] for r in split.train], used)
    ringing_hz = ringing_peaks_hz(evidence_of(found or model, split.train, left_um, split.noise_um))
    scales = TermScales(span_um, step_s, longest_s, _moving_columns(split), period_v, tuple(ringing_hz))
    offers = [offer for kind in effect_classes().values() if (offer := kind.offered(scales)) is not None]
    known = {effect.name: effect for effect in found.effects if isinstance(effect, LinearTerms)} if found else {}
    return [
        offer.and_modes_of(known[offer.name]) if isinstance(offer, LinearTerms) and offer.name in known else offer
        for offer in offers
    ]


def _moving_columns(split: DataSplit) -> dict[Covariate, tuple[float, float]]:
    """Return middle and half the range of the signals all records have and that move in training."""
    others = [part.record for part in (*split.held, *split.report)]
    found = {}
    for which in Covariate:
        learned = [record.covariates.of(which) for record in split.train]
        known = [
            signal[record.is_used] for signal, record in zip(learned, split.train, strict=True) if signal is not None
        ]
        if len(known) < len(learned) or any(record.covariates.of(which) is None for record in others):
            continue
        low, high = min(float(np.min(v)) for v in known), max(float(np.max(v)) for v in known)
        if np.isfinite(low) and np.isfinite(high) and high > low:
            found[which] = (0.5 * (low + high), 0.5 * (high - low))
    return found


def _rows(model: TrialModel, offered: Sequence[Effect], parts: Sequence[HeldOut]) -> list[tuple[Array, Array]]:
    """Return for each stretch columns of plays, creep order, terms, and what they must fit, at even samples."""
    found = []
    for part in parts:
        record, index = part.record, part.index
        moved_um = predict(model, record, index)
        used = np.flatnonzero(record.is_used)
        at = used[:: max(1, -(-used.size // _MOST_SAMPLES))]
        terms = [_terms(model, effect, record, index, moved_um, at) for effect in offered]
        linear = [record_columns(model, record, index)[at]]
        if not model.replaces_creep:
            linear.append(order_slope(model, record, index)[at, None])
        columns = np.column_stack((*linear, *terms))
        every: Mask = np.ones(at.size, dtype=np.bool_)
        target = centred((record.measured_um - moved_um)[at], every)
        columns = centred(columns, every)
        untaught = part.directions(model)
        if untaught is not None:
            beyond = np.linalg.qr(centred((untaught.columns[0] @ untaught.whitening)[at], every))[0]
            columns, target = columns - beyond @ (beyond.T @ columns), target - beyond @ (beyond.T @ target)
        found.append((columns, target))
    return found


def _terms(
    model: TrialModel, offered: Effect, record: FitRecord, index: int, moved_um: Array, at: NDArray[np.int64]
) -> Array:
    if offered.stage < Stage.MECHANICAL:
        # what it does the displacement shows behind hysteresis and creep alone
        nothing = offered.with_terms(range(offered.n_terms), np.zeros(offered.n_terms))
        return term_directions(model, nothing, record, index)[at, : offered.n_terms]
    columns = []
    covariate = record.covariates.of(offered.covariate)
    for k in range(offered.n_terms):
        one = offered.with_terms([k], np.ones(1))
        state = one.initial_state()
        if offered.acts_before_record() and model.start_of(index) is not None:
            one.terms(state, moved_um[:1], np.array([_REST_S]))
        columns.append(one.terms(state, moved_um, record.steps_s, covariate)[at, 0])
    return np.column_stack(columns)


def _equations(model: TrialModel, offered: Sequence[Effect], parts: Sequence[HeldOut]) -> NormalEquations:
    rows = _rows(model, offered, parts)
    return normal_equations((c, y, np.ones(y.size, dtype=np.bool_)) for c, y in rows)


def _chosen(
    learned: NormalEquations, held: list[tuple[Array, Array]], n_linear: int, among: Sequence[NDArray[np.int64]]
) -> list[int]:
    """Return the terms that stay: as few as do about as well on held-out data as the best number of them.

    Args:
        learned: equations of training.
        held: columns and target of held-out stretches.
        n_linear: number of columns before the terms.
        among: sets of terms to choose from; of what is chosen from each, held-out data say which does best.
    """
    # beside the terms the weights of the plays and the creep order may move: what they can do is no term's
    beside = learned.without(n_linear)
    found = [_chosen_among(beside, learned, held, n_linear, offered) for offered in among]
    return min(found, key=lambda each: each[1])[0]


def _chosen_among(
    beside: NormalEquations,
    learned: NormalEquations,
    held: list[tuple[Array, Array]],
    n_linear: int,
    offered: NDArray[np.int64],
) -> tuple[list[int], float]:
    order = [int(offered[k]) for k in beside.of(offered).taken_one_by_one(_MOST_TERMS)]
    left = [_left(learned, held, n_linear, order[:n]) for n in range(len(order) + 1)]
    errors = [sum(float(v @ v) for v in residuals) for residuals in left]
    best = int(np.argmin(errors))
    enough = errors[best] * np.exp(WORTHWHILE_LOG_GAIN)
    n_terms = next(n for n in range(best + 1) if n == best or errors[n] <= enough)
    return order[:n_terms], errors[n_terms]


def _sets(offered: Sequence[Effect]) -> list[NDArray[np.int64]]:
    """Return the sets of terms to choose from: with linear memory before hysteresis, with that behind it, with neither.

    Training data tell hardly which: a drive that overshoots and a mass that does differ in the loops of the overshoot,
    and a few swings of many periods bend to whatever is quick.
    """
    sizes = np.array([effect.n_terms for effect in offered])
    numbers = np.split(np.arange(int(np.sum(sizes))), np.cumsum(sizes)[:-1])
    linear = {effect.name for effect in offered if isinstance(effect, LinearTerms)}
    before = {effect.name for effect in offered if effect.name in linear and effect.stage < Stage.MECHANICAL}
    return [
        np.concatenate([own for own, effect in zip(numbers, offered, strict=True) if effect.name not in left_out])
        for left_out in (linear - before, before, linear)
    ]


def _places(chosen: list[int], n_linear: int) -> NDArray[np.int64]:
    """Return where the linear part and the chosen terms stand among the equations."""
    return np.concatenate((np.arange(n_linear), n_linear + np.array(chosen, dtype=np.int64)))


def _left(learned: NormalEquations, held: list[tuple[Array, Array]], n_linear: int, chosen: list[int]) -> list[Array]:
    """Return what plays, creep order and terms, fitted in training, leave of the held-out stretches [um]."""
    at = _places(chosen, n_linear)
    weights = learned.of(at).solution()
    return [y - c[:, at] @ weights for c, y in held]


def _with_terms(model: TrialModel, offered: Sequence[Effect], chosen: list[int], weights_um: Array) -> TrialModel:
    """Return the model with the chosen terms, those of one signal in one effect."""
    first = 0
    for effect in offered:
        own = [n for n, k in enumerate(chosen) if first <= k < first + effect.n_terms]
        if own:
            model = model.with_cause(effect.with_terms([chosen[n] - first for n in own], weights_um[own]))
        first += effect.n_terms
    return model

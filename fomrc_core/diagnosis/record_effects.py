"""Effects that belong to one record - a hum's phase, a load's moment - fitted to records that are held out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace

from fomrc_core.compute.least_squares import gram_of, whitening_of
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.fit_starts import sized
from fomrc_core.diagnosis.moved_times import with_times_moved, with_times_moved_in_all
from fomrc_core.diagnosis.prehistory_search import with_searched_past
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import screen
from fomrc_core.effects.base.cause import Cause
from fomrc_core.fitting.evidence import evidence_of
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.free_parameters import FreeParameter, free_parameters
from fomrc_core.fitting.joint_fit import Refit, effect_directions, fit_until_still, refit
from fomrc_core.fitting.linear_part import Tangent, residuals, squared_error
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.records.drive import learned_blocks

_MAX_TRIALS = 12  # instances simulated at full size, a simulation each
_MAX_STARTS = 3  # of them fitted
_MOST_TURNS, _STILL = 6, 0.99  # times moved and all else fitted in turn, until the error falls by less


def follow_held(model: TrialModel, split: DataSplit) -> TrialModel:
    """Return the model with the effects of single records fitted to the held-out records too, on half their blocks.

    The actuator's own parameters stay; phase of a hum or time of a load must be that of the record. What begins and
    ends within a block, as an open lead does, leaves nothing in the others: such times are sought in all of them, and
    each must earn its keep there.
    """
    kinds = {cause.name for index in range(len(split.train)) for _, cause in model.found(index)}
    if not kinds:
        return model
    for part in {h.index: h for h in (*split.held, *split.report)}.values():
        if part.index < len(split.train):
            continue
        one = part.record.using(part.record.is_used & learned_blocks(part.record.time_s.size))
        timed = {kind for kind in kinds if cause_classes()[kind].moved_times}
        untimed = sorted(kinds - timed)
        # beside a model that has changed since what it was fitted to then is another valley; and of several the first
        # was fitted where the others were not known yet
        asked_again = [kind for kind in untimed if len(kinds) > 1 or model.has(kind, part.index)]
        model = fit_one_record(model, one, part.index, kinds - timed)
        for kind in asked_again:
            model = _anew_where_better(model, one, part.index, kind)
        if any(cause.has_own_times() for cause in model.causes_in(part.index)):
            # a moment in a block nobody looked at is where its neighbours put it: it is moved where all can be seen
            alone = with_times_moved(model.alone(part.index), part.record, 0)
            model = model.with_record_of(alone, part.index)
        model = fit_one_record(model, part.record, part.index, timed)
        for kind in sorted(timed):
            if model.has(kind, part.index):
                model = _anew_where_better(model, part.record, part.index, kind)
    return model


def _anew_where_better(model: TrialModel, record: FitRecord, index: int, kind: str) -> TrialModel:
    """Return the model with a cause of one record sought as if it had not been found there, where that is better.

    What is left beside what was found shows only what that missed; and it was found beside what was known before.
    """
    anew = fit_one_record(model.without(kind, index), record, index, {kind})
    return anew if _error(anew.alone(index), record) < _error(model.alone(index), record) else model


def refollowed(model: TrialModel, split: DataSplit) -> TrialModel:
    """Return the model with the effects of held-out records fitted to them again from where they stand.

    They were fitted beside what was known before: what a further cause does there they had to make up for.
    """
    for part in {h.index: h for h in split.held}.values():
        if not len(split.train) <= part.index < len(model.record_effects) or not model.record_effects[part.index]:
            continue
        one = part.record.using(part.record.is_used & learned_blocks(part.record.time_s.size))
        kinds = {cause.name for cause in model.record_effects[part.index] if not cause.moved_times}
        model = model.with_record_of(_refit_own(model.alone(part.index), one, kinds), part.index)
    return model


def sought_again(final: Refit, split: DataSplit, cause: str, executor: Executor | None) -> Refit:
    """Return the joint refit with an effect of single records sought anew in every record, where that is better.

    The first search saw each record through a base that still bent to what the effect did in all of them, or beside
    another cause that made up for what it got wrong: a past whose length no longer matters does not come back by a fit.
    """
    model = final.model
    for index, record in enumerate(split.train):
        if model.has(cause, index):
            model = with_times_moved(model, record, index)
        if model.has(cause, index):
            model = _anew_where_better(model, record, index, cause)
    for _ in range(_MOST_TURNS):
        if model is final.model:
            break
        again = fit_until_still(model, split.train, executor)
        if again.squared_error >= final.squared_error:
            break
        is_still = again.squared_error > _STILL * final.squared_error
        final = again
        if is_still or not cause_classes()[cause].has_own_times():
            break
        # what is fitted beside a time had bent to where it was before: with that mended the time moves on
        model = with_times_moved_in_all(final.model, split.train)
    return final


def fit_one_record(model: TrialModel, record: FitRecord, index: int, kinds: set[str]) -> TrialModel:
    """Return the model with the record-bound effects of these kinds fitted to one record, all else held."""
    alone = model.alone(index)
    held = Tangent.none(alone, (record,))
    for name in sorted(kinds):
        present = PresentModel(alone, (record,), held, noise_um=0.0)
        trials = [t for t in screen(present, (name,)) if t.explained > 0.0 and t.cause.belongs_to_record()]
        known = _as_elsewhere(model, index, name, present)
        if not trials and not known:
            continue
        pasts = [t.cause for t in trials if isinstance(t.cause, Prehistory)]
        if pasts:
            pasts += _others(model, index, pasts[0].resting_v)
            beside = tuple(p for p in free_parameters(alone) if p.index == 0 and p.cause != name and _is_linear(p))
            start = with_searched_past(alone, 0, pasts, _error_beside(alone, record, beside))
            moved = _refit_own(start, record, kinds | {p.cause for p in beside})
            alone = min((alone, moved), key=lambda option: _error(option, record))
            continue
        # a signature is the effect's slope; how well an instance of full size does only its simulation tells
        options = [alone.with_cause(sized(trial), 0) for trial in trials[:_MAX_TRIALS]]
        options.sort(key=lambda option: _error(option, record))
        starts = [*options[:_MAX_STARTS], *(alone.with_cause(cause, 0) for cause in known)]
        fits = [_refit_own(start, record, kinds) for start in starts]
        # a time that is off by some samples may leave more than none at all: moved first, compared then
        best = _with_times_and_sizes(min(fits, key=lambda option: _error(option, record)), record, kinds)
        alone = min((alone, best), key=lambda option: _error(option, record))
    return model.with_record_of(alone, index)


def _is_linear(parameter: FreeParameter) -> bool:
    return parameter.spec.name in cause_classes()[parameter.cause].linear_parameters


def _error_beside(
    model: TrialModel, record: FitRecord, free: tuple[FreeParameter, ...]
) -> Callable[[TrialModel], float]:
    """Return what a model of one record leaves once these parameters have followed, as a function of it [um^2].

    A drift that was fitted beside a wrong past has bent to it, and holds any other for worse.
    """
    if not free:
        return lambda option: _error(option, record)
    columns = effect_directions(model, free, (record,))
    moving = Tangent(columns, whitening_of(gram_of([(columns[0], record.is_used)])))
    return lambda option: squared_error((record,), moving.remove((record,), residuals(option, (record,))))


def _with_times_and_sizes(model: TrialModel, record: FitRecord, kinds: set[str]) -> TrialModel:
    """Return the model of one record with times moved and sizes fitted in turn: each waits for the other."""
    error = _error(model, record)
    for _ in range(_MOST_TURNS):
        moved = with_times_moved(model, record, 0)
        fitted = _refit_own(moved, record, kinds)
        model = min((model, moved, fitted), key=lambda option: _error(option, record))
        before, error = error, _error(model, record)
        if error > _STILL * before:
            break
    return model


def _as_elsewhere(model: TrialModel, index: int, name: str, present: PresentModel) -> Sequence[Cause]:
    """Return a cause that was found in another record as it may act in this one."""
    found = next((cause for at, cause in model.found() if at not in (None, index) and cause.name == name), None)
    if found is None:
        return []
    evidence = evidence_of(present.model, present.records, present.residuals_um, present.noise_um)
    return found.in_other_record(evidence)


def _others(model: TrialModel, index: int, resting_v: float) -> list[Prehistory]:
    """Return the pasts of the other records: who measures does the same before each."""
    others = [start for i, start in enumerate(model.starts) if i != index and start is not None]
    return [replace(start, resting_v=resting_v) for start in others if not start.is_plain_rest]


def _error(model: TrialModel, record: FitRecord) -> float:
    return squared_error((record,), residuals(model, (record,)))


def _refit_own(model: TrialModel, record: FitRecord, kinds: set[str]) -> TrialModel:
    free = tuple(p for p in free_parameters(model) if p.index == 0 and p.cause in kinds)
    held = Tangent.none(model, (record,))
    return refit(model, (record,), held, n_iterations=8, free=free).model

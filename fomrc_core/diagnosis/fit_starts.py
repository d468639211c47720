"""Where the fits of a candidate cause begin: its trial instances at full size, joined over the records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.prehistory_search import way_v, with_searched_past
from fomrc_core.diagnosis.present_model import PresentModel
from fomrc_core.diagnosis.screening import Screened
from fomrc_core.effects import Effect
from fomrc_core.effects.base.cause import Cause
from fomrc_core.fitting.free_parameters import FreeParameter
from fomrc_core.fitting.joint_fit import scan
from fomrc_core.fitting.linear_part import Tangent, residuals, squared_error, tangent
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.records.drive import begins_at_zero

Array = NDArray[np.float64]

_MAX_STARTS = 12  # instances simulated at full size, a simulation each
_MAX_OTHER_FORMS = 4  # beside those, of forms that are not among them
N_STARTS = 3


def clear_error(start: TrialModel, split: DataSplit, directions: Tangent) -> float:
    """Return the squared error of a start once its linear part has followed [um^2]."""
    return squared_error(split.train, directions.remove(split.train, residuals(start, split.train)))


def fit_starts(
    model: TrialModel, trials: list[Screened], bound: bool, split: DataSplit, directions: Tangent
) -> list[TrialModel]:
    """Return models with an effect from which fits of it begin.

    Args:
        model: without it.
        trials: instances of it, the likeliest first.
        bound: whether it belongs to single records.
        split: records.
        directions: tangent of the model's linear part.
    """
    first = trials[0].cause
    if isinstance(first, Effect) and first.owns_columns:
        return _starts_with_columns(model, trials)
    if bound:
        return [_joined(model, group, split, directions) for group in _groups(trials)]
    if first.is_scanned:
        return [model.with_cause(trial.cause) for trial in trials[:2]]
    # A signature is the effect's slope; how well an instance of full size does only its simulation tells.
    likeliest = trials[:_MAX_STARTS]
    forms = {trial.cause.form() for trial in likeliest}
    likeliest += [trial for trial in trials[_MAX_STARTS:] if trial.cause.form() not in forms][:_MAX_OTHER_FORMS]
    options = [(model.with_cause(sized(trial)), trial.cause.form()) for trial in likeliest]
    if isinstance(first, Effect) and first.replaces_creep:
        # a signature is what it adds to the power law: in the place of that it begins as the same law
        longest_s = max(float(record.time_s[-1]) for record in split.train)
        shortest_s = min(float(np.median(record.steps_s)) for record in split.train)
        same = type(first).in_place_of_creep(model.creep_order, shortest_s, longest_s)
        options += [(model.with_cause(law), law.form()) for law in same]
    ordered = sorted(options[1:], key=lambda option: clear_error(option[0], split, directions))
    # a form of more parameters may do worse where it begins and better where it ends: the best of every form is tried
    starts, tried = [options[0][0]], {options[0][1]}
    for option, form in ordered:
        if form not in tried:
            starts.append(option)
            tried.add(form)
    starts += [option for option, _ in ordered if option not in starts][: max(N_STARTS - len(starts), 0)]
    return starts


def _groups(trials: list[Screened]) -> list[list[Screened]]:
    """Return the trials by form: what a fit of them moves, and whether a past went far or stayed near.

    Beyond the range of the drive an excursion of any size is the same past: a fit that gets there stays there.
    """
    farthest_v = max(way_v(trial.cause) for trial in trials)
    groups: dict[tuple[tuple[str, ...], bool], list[Screened]] = {}
    for trial in trials:
        is_far = way_v(trial.cause) > 0.5 * farthest_v
        groups.setdefault((trial.cause.free_names(), is_far), []).append(trial)
    for group in groups.values():
        seen = {trial.index for trial in group}
        group += [trial for trial in trials if trial.index not in seen]
    return list(groups.values())


def _joined(model: TrialModel, trials: list[Screened], split: DataSplit, directions: Tangent) -> TrialModel:
    """Return the model with the best trial of every record."""
    for index in sorted({trial.index for trial in trials if trial.index is not None}):
        pasts = [t.cause for t in trials if t.index == index and isinstance(t.cause, Prehistory)]
        if pasts:
            model = with_searched_past(model, index, pasts, lambda c: clear_error(c, split, directions))
            continue
        of_record = [t for t in trials if t.index == index][:_MAX_STARTS]
        clear_um = directions.remove(split.train, residuals(model, split.train))
        options = (_resized(model, t, clear_um, split, directions) for t in of_record)
        model = min(options, key=lambda option: option[0])[1]
    return model


def _resized(
    model: TrialModel, trial: Screened, clear_um: tuple[Array, ...], split: DataSplit, directions: Tangent
) -> tuple[float, TrialModel]:
    """Return the error of a trial of one record beside what was joined before it, sized to that, and the model."""
    option = model.with_cause(sized(trial), trial.index)
    then_um = directions.remove(split.train, residuals(option, split.train))
    gain = power = 0.0
    for record, before, after in zip(split.train, clear_um, then_um, strict=True):
        signature = (before - after)[record.is_used]
        gain += float(np.dot(before[record.is_used], signature))
        power += float(np.dot(signature, signature))
    error = squared_error(split.train, then_um)
    if not power > 0.0 or not gain > 0.0:
        return error, option
    again = replace(trial, amplitude=trial.amplitude * gain / power)
    return squared_error(split.train, clear_um) - gain**2 / power, model.with_cause(sized(again), trial.index)


def _starts_with_columns(model: TrialModel, trials: list[Screened]) -> list[TrialModel]:
    """Return the effect without its plays, and with the whole family of them as columns beside those of the model."""
    family = next((t for t in trials if isinstance(t.cause, Effect) and ColumnKinds.plays_of(t.cause).owners), None)
    if family is None:
        return [model.with_cause(sized(trials[0]))]
    assert isinstance(family.cause, Effect)
    nothing = np.zeros(0)
    bare = model.with_cause(family.cause.with_plays(nothing, nothing, nothing))
    return [bare, with_family(bare, family.cause)]


def with_family(model: TrialModel, effect: Effect) -> TrialModel:
    """Return the model with the plays of one of its effects as columns behind its own, their weights still zero."""
    columns = model.columns.joined(ColumnKinds.plays_of(effect))
    added = columns.thresholds_v.size - model.weights.size
    return replace(model, columns=columns, weights=np.concatenate((model.weights, np.zeros(added))))


def scanned(start: TrialModel, split: DataSplit, directions: Tangent, trial: Screened) -> TrialModel:
    """Return the start with the effect's main parameter scanned about its value."""
    spec = trial.cause.parameter(trial.cause.main_parameter)
    return scan(start, split.train, directions, FreeParameter(trial.name, trial.index, spec, 1.0))


def sized(trial: Screened) -> Cause:
    """Return the instance with its linear parameters scaled as the screening found."""
    changes = {}
    for name in trial.cause.linear_parameters:
        value = getattr(trial.cause, name)
        if isinstance(value, float) and value != 0.0:
            spec = trial.cause.parameter(name)
            changes[name] = min(max(value * trial.amplitude, spec.lower), spec.upper)
    return replace(trial.cause, **changes) if changes else trial.cause


def start_variants(present: PresentModel, split: DataSplit) -> list[tuple[TrialModel, Tangent]]:
    """Return the present model, and with the other assumption on how records of unsure start begin, with directions."""
    unsure = [i for i, r in enumerate(split.train) if not begins_at_zero(r.voltage_v)]
    same, flipped = (present.model, present.directions), present.model
    for i in unsure:
        start = present.model.start_of(i)
        if start is not None and not start.is_plain_rest:
            return [same]
        flipped = flipped.with_start(i, split.train[i].at_rest() if start is None else None)
    return [same, (flipped, tangent(flipped, split.train))] if unsure else [same]

"""From a model under fit to an extended model: non-negative elements and the effects found."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.data_split import SUBSTEPS, DataSplit, held_residuals, quoted_residuals
from fomrc_core.diagnosis.element_weights import with_element_weights
from fomrc_core.diagnosis.finer_grid import on_same_grid
from fomrc_core.diagnosis.record_effects import follow_held
from fomrc_core.diagnosis.search import SearchResult
from fomrc_core.diagnosis.wander_fit import beside_wander
from fomrc_core.effects import Effect
from fomrc_core.effects.base.cause import Cause
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.fitting.linear_part import Tangent, residuals, squared_error
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.operators.hysteresis import OperatorSum, elements_from_play_form

_MAX_TURNS = 6
# Of the sum of squares over the quoted record: as good a model does now a little better there, now a little worse.
_SURELY_WORSE = 1.1
_LEAST_GAIN = 1e-3  # of the squared error: less is not worth another turn


@dataclass(frozen=True, eq=False)
class Extension:
    """The extended model and the model it is the model of.

    Attributes:
        model: what simulators, compensators and nodes take.
        trial: the same as a model under fit, for residuals.
        is_base: whether it is the base as it was, nothing found.
    """

    model: PiezoModel
    trial: TrialModel
    is_base: bool = False


def never_worse(
    found: SearchResult, base: TrialModel, split: DataSplit, has_elements: bool = False
) -> tuple[SearchResult, Extension]:
    """Return the findings and the model of them that does no worse on held-out data than the base.

    What a search fits has weights of either sign; what is written must have those of Maxwell elements. A cause whose
    gain was owed to weights no element can have is no finding: the last is given back until the model gains. So it is
    where the model does surely worse on the record that is quoted, than the base or than without the last: of a record
    that neither taught nor chose, what surely loses there has none of its gain from what it is named for. Where nothing
    is found the base stands as it is.

    Args:
        found: causes found.
        base: model before them.
        split: records.
        has_elements: whether the base lacks elements that the model found has: a finding without any cause beside it.
    """
    before = replace(_extend(base, split), is_base=True)
    while found.steps or has_elements:
        extension = _fitted(found.model, before.trial, split)
        if is_no_worse(extension.trial, before.trial, split) and not _is_denied(found, extension.trial, split):
            return found, extension
        if not found.steps:
            break
        last = found.steps[-1]
        final = refit(on_same_grid(last.before, found.model, split), split.train, n_iterations=2)
        model = follow_held(final.model, split)
        found = replace(found, model=model, final=final, steps=found.steps[:-1], runner_up=last.accepted)
    return found, before


def _is_denied(found: SearchResult, model: TrialModel, split: DataSplit) -> bool:
    """Return whether the quoted record, where it is a third one, is predicted surely worse with the last finding."""
    chose = {part.index for part in split.held}
    if not found.steps or any(part.index in chose or part.index < len(split.train) for part in split.report):
        return False
    with_it, without = (_squares(quoted_residuals(each, split.report)) for each in (model, found.steps[-1].before))
    return with_it > _SURELY_WORSE * without


def is_no_worse(model: TrialModel, base: TrialModel, split: DataSplit) -> bool:
    """Return whether a model does no worse than another on held-out data, nor surely worse on what is quoted."""
    held, quoted = (
        [_squares(held_residuals(each, parts)) for each in (model, base)] for parts in (split.held, split.report)
    )
    return held[0] <= held[1] and quoted[0] <= _SURELY_WORSE * quoted[1]


def _squares(residuals_um: list[Array]) -> float:
    return float(sum(np.dot(v, v) for v in residuals_um))


def _fitted(model: TrialModel, base: TrialModel, split: DataSplit) -> Extension:
    """Return the extension fitted to the innovations of noise that wanders, where it does no worse than the base so.

    Nor surely worse than by least squares on the quoted record: where the form is not right, weights fitted to what is
    quick miss what is slow by any amount.
    """
    extension = _by_least_squares(model, split)
    trial = beside_wander(extension.trial, split)
    if trial is extension.trial or not is_no_worse(trial, base, split):
        return extension
    with_it, without = (_squares(quoted_residuals(each, split.report)) for each in (trial, extension.trial))
    return extension if with_it > _SURELY_WORSE * without else Extension(as_written(trial, split), trial)


def _by_least_squares(model: TrialModel, split: DataSplit) -> Extension:
    """Return the extension with effects and non-negative weights fitted in turn, while that gains in training."""
    best = _extend(model, split)
    error = squared_error(split.train, residuals(best.trial, split.train))
    for _ in range(_MAX_TURNS):
        # no direction of the linear part moves beside the effects
        still = Tangent.none(best.trial, split.train)
        moved = refit(best.trial, split.train, still, n_iterations=4).model
        other = _extend(moved, split)
        error_after = squared_error(split.train, residuals(other.trial, split.train))
        if not error_after < error:
            break
        is_still = error_after > (1.0 - _LEAST_GAIN) * error
        best, error = other, error_after
        if is_still:
            break
    return best


def _extend(model: TrialModel, split: DataSplit) -> Extension:
    """Return the extended model of a model under fit: its weights made those of Maxwell elements, its effects kept."""
    final = with_element_weights(model, split.train)
    return Extension(as_written(final, split), final)


def as_written(final: TrialModel, split: DataSplit) -> PiezoModel:
    """Return the model with Maxwell elements of a model under fit, whose plain weights are not negative."""
    operator: OperatorSum = final.operator()
    of_records = _first_of_records(final, len(split.train)).values()
    effects = (*final.actuator_effects(), *(c for c in of_records if isinstance(c, Effect)))
    start = next((c for c in of_records if isinstance(c, Prehistory)), None)
    return PiezoModel(
        *elements_from_play_form(operator), final.creep_order, effects, start, SUBSTEPS, final.shortest_time_s
    )


def _first_of_records(model: TrialModel, n_train: int) -> dict[str, Cause]:
    """Return the causes that belong to single records, each as first found."""
    first: dict[str, Cause] = {}
    for index in range(n_train):
        for _, cause in model.found(index):
            first.setdefault(cause.name, cause)
    return first

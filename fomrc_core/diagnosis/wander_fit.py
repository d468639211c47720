"""A model fitted once more beside noise that wanders: by what of it is not foreseen from one sample to the next.

By least squares elements, creep and causes bend after a sensor that wanders, each as far as it can, and what they take
of it in one record they lack in the next. Of the innovations no sample knows the one before it (generalized least
squares: no linear estimate is better; Aitken, 1935): where the form is right the same causes err less.
"""

from __future__ import annotations

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.data_split import DataSplit, held_residuals
from fomrc_core.diagnosis.element_weights import with_element_weights
from fomrc_core.diagnosis.judgement import LARGEST_EXCESS
from fomrc_core.diagnosis.present_model import with_effects
from fomrc_core.diagnosis.wander import Wander, change_beside, mean_square, offset_columns, unforeseen, wander_beside
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.free_parameters import free_parameters, with_coordinates
from fomrc_core.fitting.linear_part import moved, residuals, tangent
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.records.residual import rms

_MAX_TURNS = 4
_SHARES_OF_STEP = (1.0, 0.3, 0.1)  # tried, until less is unforeseen
_LEAST_GAIN = 1e-3  # of the mean square: less is not worth another turn


def beside_wander(model: TrialModel, split: DataSplit) -> TrialModel:
    """Return the model fitted to the innovations of noise that wanders, where there is any; else as it is.

    Of the held-out data less must be unforeseen as well; and they may not be missed by much more than before, for what
    acts slowly and has no part in the model is foreseen all the same.

    Args:
        model: fitted to the training records by least squares, its plain weights not negative.
        split: records.
    """
    noise = wander_beside(model, residuals(model, split.train), split.train)
    if noise.is_white:
        return model
    other = fitted_to_innovations(model, noise, split)
    before_um, after_um = (held_residuals(each, split.held) for each in (model, other))
    before, after = (mean_square([noise.innovations(v) for v in left_um]) for left_um in (before_um, after_um))
    is_missed = rms(np.concatenate(after_um)) > LARGEST_EXCESS * rms(np.concatenate(before_um))
    return other if after < before and not is_missed else model


def fitted_to_innovations(model: TrialModel, noise: Wander, split: DataSplit) -> TrialModel:
    """Return the model with all it can move where least is unforeseen, its plain weights not negative.

    Args:
        model: fitted to the training records, its plain weights not negative.
        noise: how noise wanders beside it.
        split: records, of which the training ones are fitted to.
    """
    power = _power(model, noise, split)
    for _ in range(_MAX_TURNS):
        before = power
        model, power = _stepped(model, before, noise, split)
        if power > (1.0 - _LEAST_GAIN) * before:
            break
    return model


def _stepped(model: TrialModel, power: float, noise: Wander, split: DataSplit) -> tuple[TrialModel, float]:
    """Return the model after the largest share of a step that leaves less unforeseen, as it is where none does."""
    step = _step(model, noise, split)
    for share in _SHARES_OF_STEP:
        try:
            trial = with_element_weights(_moved(model, share * step), split.train, noise)
            after = _power(trial, noise, split)
        except ParameterError:
            continue
        if after < power:
            return trial, after
    return model, power


def _power(model: TrialModel, noise: Wander, split: DataSplit) -> float:
    masks = [record.is_used for record in split.train]
    return mean_square(unforeseen(residuals(model, split.train), masks, noise))


def _step(model: TrialModel, noise: Wander, split: DataSplit) -> Array:
    """Return the change of weights, creep order and parameters that leaves least unforeseen."""
    masks = [record.is_used for record in split.train]
    directions = with_effects(tangent(model, split.train), model, split.train).columns
    columns = [np.column_stack((c, own)) for c, own in zip(directions, offset_columns(masks), strict=True)]
    change, _ = change_beside(residuals(model, split.train), columns, masks, noise)
    return change[: -len(masks)]


def _moved(model: TrialModel, step: Array) -> TrialModel:
    n_linear = model.weights.size + 1
    free = free_parameters(model)
    coordinates = np.array([parameter.coordinate(parameter.get(model)) for parameter in free])
    return moved(with_coordinates(model, free, coordinates + step[n_linear:]), step[:n_linear])

"""Weights that Maxwell elements can have: those of a model under fit may be of either sign."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.least_squares import normal_equations, signed_weights
from fomrc_core.diagnosis.wander import Wander, offset_columns
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.linear_part import centred, record_columns
from fomrc_core.fitting.trial_model import TrialModel, predict

_LEAST_SLOPE = 1e-6  # of the sum of the weights
_LEAST_SHARE = 1e-9  # of the largest weight: less is rounding


def with_element_weights(model: TrialModel, records: tuple[FitRecord, ...], noise: Wander | None = None) -> TrialModel:
    """Return the model with plain weights that are not negative, fitted with all else as it is; without those of zero.

    Args:
        model: the model.
        records: what to fit.
        noise: how noise wanders, where its innovations are what is fitted.
    """
    plain = model.columns.is_plain
    offsets = offset_columns([record.is_used for record in records])

    def rows(index: int, record: FitRecord) -> Iterator[tuple[Array, Array, Mask]]:
        columns = centred(record_columns(model, record, index), record.is_used)
        moved_um = centred(record.measured_um - predict(model, record, index), record.is_used)
        moved_um = moved_um + columns @ model.weights
        if noise is None:
            yield columns, moved_um, record.is_used
            return
        for part in noise.stretches(np.column_stack((columns, offsets[index], moved_um)), record.is_used):
            yield part[:, :-1], part[:, -1], np.ones(len(part), dtype=np.bool_)

    equations = normal_equations(part for index, record in enumerate(records) for part in rows(index, record))
    # beside noise that wanders the mean is not what is not known
    is_positive = np.zeros(equations.moment.size, dtype=np.bool_)
    is_positive[: plain.size] = plain
    weights = signed_weights(equations.gram, equations.moment, is_positive)[: plain.size]
    return without_idle(replace(model, weights=weights))


def without_idle(model: TrialModel) -> TrialModel:
    """Return the model without plain weights of zero, but with an instantaneous part: without one there is no inverse.

    Args:
        model: its plain weights not negative, and not all of them zero.
    """
    plain, weights = model.columns.is_plain, model.weights.copy()
    is_slope = plain & (model.columns.thresholds_v == 0.0)
    if not float(np.sum(weights[is_slope])) > 0.0:
        weights[is_slope] = _LEAST_SLOPE * float(np.sum(weights[plain]))
    kept = ~plain | is_slope | (weights > _LEAST_SHARE * float(np.max(weights[plain])))
    return replace(model, columns=model.columns.chosen(kept), weights=weights[kept])

"""From a fitted chain to an extended model: non-negative elements and the effects found."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.least_squares import product, signed_weights
from fomrc_core.diagnosis.data_split import SUBSTEPS, DataSplit
from fomrc_core.effects import Effect
from fomrc_core.effects.base.cause import Cause
from fomrc_core.fitting.linear_part import centred, record_columns
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.operators.hysteresis import OperatorSum, elements_from_play_form

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Extension:
    """The extended model and the model it is the model of.

    Attributes:
        model: what simulators, compensators and nodes take.
        trial: the same as a model under fit, for residuals.
    """

    model: PiezoModel
    trial: TrialModel


def extend(model: TrialModel, split: DataSplit) -> Extension:
    """Return the model of a model: its weights made those of Maxwell elements, its effects kept.

    The weights a search fits may be of either sign; here they are fitted once more, non-negative, with all else
    as found.
    """
    plain = model.columns.is_plain
    n = model.weights.size
    gram, moment = np.zeros((n, n)), np.zeros(n)
    for index, record in enumerate(split.train):
        columns = centred(record_columns(model, record, index), record.is_used)
        target = centred(record.measured_um - predict(model, record, index), record.is_used) + columns @ model.weights
        gram += product(columns, columns, record.is_used)
        moment += product(columns, target, record.is_used)
    weights = signed_weights(gram, moment, plain)
    thresholds = model.columns.thresholds_v
    is_slope = plain & (thresholds == 0.0)
    if not float(np.sum(weights[is_slope])) > 0.0:
        # without an instantaneous part there is no inverse
        weights[is_slope] = 1e-6 * float(np.sum(weights[plain]))
    kept = ~plain | is_slope | (weights > 1e-9 * float(np.max(weights[plain])))
    final = replace(model, columns=model.columns.chosen(kept), weights=weights[kept])
    operator: OperatorSum = final.operator()
    of_records = _first_of_records(final, len(split.train)).values()
    effects = (*final.actuator_effects(), *(c for c in of_records if isinstance(c, Effect)))
    start = next((c for c in of_records if isinstance(c, Prehistory)), None)
    extended = PiezoModel(*elements_from_play_form(operator), final.creep_order, effects, start, SUBSTEPS)
    return Extension(extended, final)


def _first_of_records(model: TrialModel, n_train: int) -> dict[str, Cause]:
    """Return the causes that belong to single records, each as first found."""
    first: dict[str, Cause] = {}
    for index in range(n_train):
        for _, cause in model.found(index):
            first.setdefault(cause.name, cause)
    return first

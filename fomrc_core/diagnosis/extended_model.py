"""From a fitted chain to an extended model: non-negative elements and the effects found."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.least_squares import product, signed_weights
from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.effects import Effect
from fomrc_core.effects.initial_state import InitialState
from fomrc_core.fitting.base_fit import centred, record_columns
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.operators.hysteresis import OperatorSum, elements_from_play_form

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Extension:
    """The extended model and the chain it is the model of.

    Attributes:
        model: what simulators, compensators and nodes take.
        chain: the same with its records, for residuals.
    """

    model: PiezoModel
    chain: TrialModel


def extend(chain: TrialModel, split: DataSplit) -> Extension:
    """Return the model of a chain: its weights made those of Maxwell elements, its effects kept.

    The weights a search fits may be of either sign; here they are fitted once more, non-negative, with all else
    as found.
    """
    plain = ~np.isfinite(chain.columns.knees_v)
    n = chain.weights.size
    gram, moment = np.zeros((n, n)), np.zeros(n)
    for index, record in enumerate(split.train):
        columns = centred(record_columns(chain, record, index), record.is_used)
        target = centred(record.measured_um - predict(chain, record, index), record.is_used) + columns @ chain.weights
        gram += product(columns, columns, record.is_used)
        moment += product(columns, target, record.is_used)
    weights = signed_weights(gram, moment, plain)
    thresholds = chain.columns.thresholds_v
    is_slope = plain & (thresholds == 0.0)
    if not float(np.sum(weights[is_slope])) > 0.0:
        # without an instantaneous part there is no inverse
        weights[is_slope] = 1e-6 * float(np.sum(weights[plain]))
    kept = ~plain | is_slope | (weights > 1e-9 * float(np.max(weights[plain])))
    columns_kept = replace(
        chain.columns,
        thresholds_v=thresholds[kept],
        knees_v=chain.columns.knees_v[kept],
        kinds=chain.columns.kinds[kept],
    )
    final = replace(chain, columns=columns_kept, weights=weights[kept])
    operator: OperatorSum = final.operator()
    effects = [*final.actuator_effects(), *_own_effects(final, len(split.train))]
    model = PiezoModel(*elements_from_play_form(operator), final.creep_order, tuple(effects))
    return Extension(model, final)


def _own_effects(chain: TrialModel, n_train: int) -> list[Effect]:
    """Return the effects of single records, each as first found; a plain rest is no effect."""
    found: dict[str, Effect] = {}
    for own in chain.record_effects[:n_train]:
        for effect in own:
            if not (isinstance(effect, InitialState) and not effect.free_names()):
                found.setdefault(effect.name, effect)
    return list(found.values())

"""Effects that belong to one record - a hum's phase, a load's moment - fitted to records that are held out."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.fit_starts import sized
from fomrc_core.diagnosis.prehistory_search import with_searched_past
from fomrc_core.diagnosis.screening import screen
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.free_parameters import free_parameters
from fomrc_core.fitting.joint_fit import Refit, fit_until_still, refit
from fomrc_core.fitting.linear_part import Tangent, residuals, squared_error, tangent
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.records.drive import learned_blocks

_MAX_TRIALS = 12
_MAX_STARTS = 3


def follow_held(chain: TrialModel, split: DataSplit) -> TrialModel:
    """Return the chain with the effects of single records fitted to the held-out records too, on half their blocks.

    The actuator's own parameters stay; phase of a hum or time of a load must be that of the record.
    """
    kinds = {cause.name for index in range(len(split.train)) for _, cause in chain.found(index)}
    if not kinds:
        return chain
    for part in {h.index: h for h in (*split.held, *split.report)}.values():
        if part.index < len(split.train):
            continue
        one = part.record.using(part.record.is_used & learned_blocks(part.record.time_s.size))
        chain = fit_one_record(chain, one, part.index, kinds)
    return chain


def sought_again(final: Refit, split: DataSplit, cause: str, executor: Executor | None) -> Refit:
    """Return the joint refit with an effect of single records sought anew in every record, where that is better.

    The first search saw each record through a base that still bent to what the effect did in all of them.
    """
    if len(split.train) < 2:
        return final
    chain = final.chain
    for index, record in enumerate(split.train):
        if chain.has(cause, index):
            anew = fit_one_record(chain.without(cause, index), record, index, {cause})
            if _error(anew.alone(index), record) < _error(chain.alone(index), record):
                chain = anew
    if chain is final.chain:
        return final
    again = fit_until_still(chain, split.train, executor)
    return again if again.squared_error < final.squared_error else final


def fit_one_record(chain: TrialModel, record: FitRecord, index: int, kinds: set[str]) -> TrialModel:
    """Return the chain with the record-bound effects of these kinds fitted to one record, all else held."""
    alone = chain.alone(index)
    still = tangent(alone, (record,))
    frozen = Tangent(tuple(np.zeros((c.shape[0], 1)) for c in still.columns), np.zeros((1, 1)))
    for name in sorted(kinds):
        left = residuals(alone, (record,))
        trials = [s for s in screen(alone, (record,), frozen, left, 0.0, (name,)) if s.explained > 0.0]
        if not trials:
            continue
        pasts = [t.cause for t in trials if isinstance(t.cause, Prehistory)]
        if pasts:
            pasts += _others(chain, index, pasts[0].resting_v)
            start = with_searched_past(alone, 0, pasts, lambda option: _error(option, record))
            alone = min((alone, _refit_own(start, record)), key=lambda option: _error(option, record))
            continue
        # a signature is the effect's slope; how well an instance of full size does only its simulation tells
        options = [alone.with_cause(sized(trial), 0) for trial in trials[:_MAX_TRIALS]]
        options.sort(key=lambda option: _error(option, record))
        fits = [_refit_own(option, record) for option in options[:_MAX_STARTS]]
        alone = min((alone, *fits), key=lambda option: _error(option, record))
    return chain.with_record_of(alone, index)


def _others(chain: TrialModel, index: int, resting_v: float) -> list[Prehistory]:
    """Return the pasts of the other records: who measures does the same before each."""
    others = [start for i, start in enumerate(chain.starts) if i != index and start is not None]
    return [replace(start, resting_v=resting_v) for start in others if not start.is_plain_rest]


def _error(chain: TrialModel, record: FitRecord) -> float:
    return squared_error((record,), residuals(chain, (record,)))


def _refit_own(chain: TrialModel, record: FitRecord) -> TrialModel:
    free = tuple(p for p in free_parameters(chain) if p.index == 0)
    n = record.time_s.size
    nothing = Tangent((np.zeros((n, chain.weights.size + 1)),), np.zeros((chain.weights.size + 1, 1)))
    return refit(chain, (record,), nothing, n_iterations=8, free=free, is_linear_free=False).chain

"""Where the fit of a record's past begins: its excursion, its hold and its rest searched one after the other.

A play remembers only how far the drive went, creep only the logarithm of how long: far from the answer the slopes
lead a fit astray, into holds of no length and rests without end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from fomrc_core.effects.base.cause import Cause
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.prehistory import Prehistory

# Half a decade about the present size, finer near it, where a step is still far outside what a fit finds its way from.
_EXCURSION_FACTORS = (0.25, 0.4, 0.55, 0.7, 0.8, 0.9, 1.1, 1.2, 1.4)
# Creep forgets with the logarithm of time: half decades over three of them.
_TIME_FACTORS = (0.03, 0.1, 0.3, 0.6, 1.7, 3.0, 10.0, 30.0)
_N_SWEEPS = 2  # each once more beside the others


def way_v(cause: Cause) -> float:
    """Return how far a past's excursion went from where it came to rest [V]; 0 for every other cause."""
    return abs(cause.extreme_v - cause.resting_v) if isinstance(cause, Prehistory) else 0.0


def with_searched_past(
    model: TrialModel, index: int, trials: list[Prehistory], error_of: Callable[[TrialModel], float]
) -> TrialModel:
    """Return the model with the past of one record that leaves the least error.

    Searched from the best trial on either side of where the record begins.

    Args:
        model: the model.
        index: which record.
        trials: where to search from.
        error_of: sum of squares a model leaves [um^2].
    """

    def error_with(past: Prehistory) -> float:
        return error_of(model.with_start(index, past))

    sides = [[past for past in trials if (past.extreme_v > past.resting_v) is is_above] for is_above in (True, False)]
    begun = [min(side, key=error_with) for side in sides if side]
    searched = [_searched(past, error_with) for past in begun]
    return model.with_start(index, min(searched, key=error_with))


def _searched(best: Prehistory, error_with: Callable[[Prehistory], float]) -> Prehistory:
    for _ in range(_N_SWEEPS):
        for variants in (_excursions, _rests, _holds):
            best = min((best, *variants(best)), key=error_with)
    return best


def _excursions(past: Prehistory) -> list[Prehistory]:
    way, spec = past.extreme_v - past.resting_v, Prehistory.parameter("extreme_v")
    ends_v = (past.resting_v + factor * way for factor in _EXCURSION_FACTORS)
    return [replace(past, extreme_v=min(max(end_v, spec.lower), spec.upper)) for end_v in ends_v]


def _rests(past: Prehistory) -> list[Prehistory]:
    return [replace(past, resting_s=_time(past.resting_s, factor)) for factor in _TIME_FACTORS]


def _holds(past: Prehistory) -> list[Prehistory]:
    return [replace(past, held_s=_time(past.held_s, factor)) for factor in _TIME_FACTORS]


def _time(value_s: float, factor: float) -> float:
    spec = Prehistory.parameter("held_s")
    return min(max(value_s * factor, spec.lower), spec.upper)

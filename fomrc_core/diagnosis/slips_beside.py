"""Samples that were lost or doubled, looked for once more beside what a search has found.

A load, a drift or a resonance leaves more of a base than readings that slip, and hides them, or puts them where they
are not. Beside it they are seen as what they are; and then the causes are sought again, for what had slipped was told
as a lag or as a clock of its own.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Executor

from fomrc_core.diagnosis.clock_or_slips import CLOCKS, moved_by_clock
from fomrc_core.diagnosis.prepared import Prepared
from fomrc_core.diagnosis.search import SearchResult
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes
from fomrc_core.records.quality import Slip, find_slips

_N_TURNS = 3  # a search each
_AS_NOISE = 1.2  # times the noise of a record: where no more is left nothing has slipped
_BETTER = 0.9  # of a record's error, or of all records' together: as sure as a fit to other noise would be


def searched_beside(
    given: Prepared,
    prepared: Prepared,
    found: SearchResult,
    search: Callable[[Prepared], SearchResult],
    executor: Executor | None,
) -> tuple[Prepared, SearchResult]:
    """Return the records with their readings where they belong beside what was found, and what a search of them finds.

    Args:
        given: the records as they were.
        prepared: the records that were searched.
        found: what was found in them.
        search: searches records.
        executor: screens and refits side by side where given.
    """
    for _ in range(_N_TURNS):
        before = _without(found.model, CLOCKS)
        moved = _moved_beside(given, prepared, found.model, before)
        if moved is None:
            break
        again = search(moved)
        if _log_left(moved, again.model) > _log_left(prepared, found.model) + math.log(_BETTER):
            break
        if moved_by_clock(moved, given, before, again.model, executor):
            break
        prepared, found = moved, again
        if found.left_out:
            break  # one that was cut short is too much work to be done once more
    return prepared, found


def _moved_beside(given: Prepared, prepared: Prepared, found: TrialModel, before: TrialModel) -> Prepared | None:
    """Return the records with readings moved that slipped beside what was found; None where none are better by it."""
    noise_um = prepared.noise.floor_um
    is_left = [left > _AS_NOISE * noise_um for left in prepared.errors_of(found)]
    if not any(is_left):
        return None
    # what befell a record may have been told where it slipped: less it, beside what jumps and stays
    bound = {cause.name for index, cause in before.found() if index is not None}
    plain = _without(before, sorted(name for name in bound if cause_classes()[name].is_exchangeable))
    ways = [(before, False, True), (before, False, False), (plain, True, True), (plain, True, False)]
    by_way = [_slips_beside(given, prepared, model, is_left, levels, delay) for model, levels, delay in ways]
    best = tuple(min(options, key=lambda option: option[0])[1] for options in zip(*by_way, strict=True))
    return None if best == prepared.slips_of_all() else given.with_slips(best)


def _slips_beside(
    given: Prepared, prepared: Prepared, model: TrialModel, is_left: list[bool], has_levels: bool, has_delay: bool
) -> list[tuple[float, tuple[Slip, ...]]]:
    """Return what is left of each record, rms [um], and its slips beside a model, the old where none are better."""
    was = prepared.slips_of_all()
    found = list(was)
    for i, predicted_um in enumerate(prepared.predicted_of(model)):
        record = given.looked.records[i]
        if is_left[i]:
            x_um, valid = record.measured_um, record.valid_samples
            slips = find_slips(x_um, predicted_um, valid, beside_delay=has_delay, beside_levels=has_levels)
            found[i] = slips or was[i]
    before_um = prepared.errors_of(model, beside_levels=has_levels)
    if tuple(found) == was:
        return list(zip(before_um, was, strict=True))
    after_um = given.with_slips(found).errors_of(model, beside_levels=has_levels)
    options = zip(found, was, after_um, before_um, strict=True)
    return [(now, new) if now < _BETTER * then else (then, old) for new, old, now, then in options]


def _log_left(prepared: Prepared, model: TrialModel) -> float:
    """Return the sum of the logarithms of what a model leaves of each record; finite where it leaves nothing."""
    return sum(math.log(max(left_um, sys.float_info.min)) for left_um in prepared.errors_of(model))


def _without(model: TrialModel, names: Sequence[str]) -> TrialModel:
    for name in names:
        model = model.without(name)
    return model

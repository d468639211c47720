"""Identify a model from input and output alone: the convex route, no start values, no local minima.

Thresholds on a grid make the forward model linear in its weights, which are non-negative; the creep order is one
more dimension, taken by Gauss-Newton. The weights are then merged to the wanted number of elements, which are fitted
on the forward error (34). The paper's own route (29)-(34) is ``method="paper"``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.blas_threads import with_one_algebra_thread
from fomrc_core.compute.least_squares import non_negative_weights, normal_equations, variances_of
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.base_fit import choose_starts, fit_base, threshold_grid
from fomrc_core.fitting.element_fit import FittedElements, Starts, fit_elements, trial_of
from fomrc_core.fitting.fit_record import FitRecord, shortest_time
from fomrc_core.fitting.linear_part import centred, record_columns, residuals
from fomrc_core.fitting.long_records import LongRecords
from fomrc_core.fitting.memory_plan import IDENTIFYING, MAX_MEMORY_GB
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.identification.element_count import merged, split
from fomrc_core.identification.fit import Fit, FitOutcome, judged
from fomrc_core.identification.parameter_errors import ParameterErrors
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.operators.hysteresis import OperatorSum, elements_from_play_form
from fomrc_core.records.drive import held_out_blocks, learned_blocks
from fomrc_core.records.noise import known_noise
from fomrc_core.records.quality import DataQuality, Examined, examine, examine_residual
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import normalised_percent, rms
from fomrc_core.records.usability import check_usable

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

N_GRID = 48
AUTO_COUNTS = (1, 2, 3, 4, 6, 8, 10, 13, 16, 20, 25, 32, 40)
_WORTH_ADDING = 0.01  # relative gain of the held-out error that justifies more elements
_UNDETERMINED = 0.5  # relative standard error of a weight or threshold: its 95 % interval reaches zero


@with_one_algebra_thread
def identify(
    recordings: Recording | Sequence[Recording],
    *,
    n_elements: int | str = 10,
    method: str = "convex",
    test: Recording | None = None,
    progress: Progress | None = None,
    max_memory_gb: float = MAX_MEMORY_GB,
) -> Fit:
    """Return the model that fits the recordings.

    Records of more than 250 000 samples together are thinned, see ``Fit.thinning``.

    Args:
        recordings: one or more training records.
        n_elements: number of elements that saturate, or "auto": as many as the held-out error asks for.
        method: "convex", or "paper" for the route of section 3.
        test: held-out record, for its error and for "auto"; without one "auto" holds out blocks.
        progress: called with the share done and what is being done.
        max_memory_gb: bound of memory [GB], the program and the recordings with it.

    Raises:
        RecordingError: a record nothing can be learnt from, see ``usability.check_usable``.
        ParameterError: an unknown method or number of elements, or too little memory.
    """
    # Many arguments: the choices of one fit, each with its usual value and given by name.
    tell = progress or (lambda _share, _text: None)
    given = [recordings] if isinstance(recordings, Recording) else list(recordings)
    everything = given if test is None else [*given, test]
    long = LongRecords.of(everything, IDENTIFYING, max_memory_gb, tell)
    if long is not None:
        long.check_usable()
        thinned = list(long.recordings)
        judged_on = thinned.pop() if test is not None else None
        return _at_own_rate(_identified(thinned, judged_on, n_elements, method, tell), long)
    looked = [examine(record) for record in given]
    held_out = examine(test) if test is not None else None
    check_usable([e.recording for e in looked])
    quality = tuple(e.quality for e in (*looked, held_out) if e is not None)
    given, test = [e.recording for e in looked], held_out.recording if held_out is not None else None
    return _identified(given, test, n_elements, method, tell, quality)


def _identified(
    given: Sequence[Recording],
    test: Recording | None,
    n_elements: int | str,
    method: str,
    tell: Progress,
    quality: tuple[DataQuality, ...] = (),
) -> Fit:
    """Return the fit of records that were looked over, with what was found wrong with them."""
    if method == "paper":
        from fomrc_core.identification.paper import identify_paper

        if not isinstance(n_elements, int):
            raise ParameterError(
                "the paper's route needs a number", where="n_elements", value=n_elements, allowed="1 to 60"
            )
        fit = fit_of(identify_paper(given, n_elements=n_elements, progress=tell).model, given, test)
        return replace(fit, data_quality=quality)
    if method != "convex":
        raise ParameterError("unknown method", where="method", value=method, allowed="convex, paper")
    if n_elements != "auto" and not (isinstance(n_elements, int) and 1 <= n_elements <= 60):
        raise ParameterError(
            "number of elements out of range", where="n_elements", value=n_elements, allowed="1 to 60, or auto"
        )
    records = tuple(FitRecord.of(r) for r in given)
    tell(0.05, "start of each record")
    starts = choose_starts(records)
    tell(0.15, "weights on the grid of thresholds")
    dense, order = _dense_form(records, starts)
    again = _looked_at_again(dense, order, records, starts) if quality else None
    if again is not None:
        given = [e.recording for e in again]
        quality = (*(q.joined(e.quality) for q, e in zip(quality, again, strict=False)), *quality[len(again) :])
        records = tuple(FitRecord.of(r) for r in given)
        dense, order = _dense_form(records, starts)
    if n_elements == "auto":
        best = _choose_count(dense, order, records, starts, test, tell)
    else:
        assert isinstance(n_elements, int)
        tell(0.5, f"fit of {n_elements} elements")
        best = _fitted_elements(dense, order, n_elements, records, starts)
    tell(0.95, "error and uncertainty")
    return replace(_result(best, records, starts, given, test), data_quality=quality)


def _at_own_rate(fit: Fit, long: LongRecords) -> Fit:
    """Return a fit to thinned records with its errors at their own rate."""
    n_train = len(fit.residuals_um)
    thinning = long.thinning(fit.residuals_um)
    whole_um = [thinned.whole.measured_um for thinned in long.thinned]
    test_percent = fit.test_nrmse_percent
    if len(whole_um) > n_train:
        within = normalised_percent(long.thinned[-1].within_um, whole_um[n_train:])
        test_percent = math.hypot(test_percent, within)
    outcome, reason = fit.outcome, fit.reason
    if outcome is FitOutcome.GOOD and thinning.unnamed:
        outcome, reason = FitOutcome.COARSE, f"{reason} where it was averaged; {thinning.unnamed[0]}"
    return replace(
        fit,
        outcome=outcome,
        reason=reason,
        rms_um=thinning.rms_um,
        nrmse_percent=normalised_percent(thinning.rms_um, whole_um[:n_train]),
        noise_um=thinning.noise_um,
        test_nrmse_percent=test_percent,
        data_quality=long.quality,
        thinning=thinning,
    )


def _looked_at_again(
    dense: OperatorSum, order: float, records: tuple[FitRecord, ...], starts: Starts
) -> list[Examined] | None:
    """Return the records with what stands out of the residual of a first fit masked too; None where nothing does."""
    left = residuals(trial_of(dense, order, records, starts), records)
    again = [examine_residual(r.recording, v) for r, v in zip(records, left, strict=True)]
    return again if any(e.quality.faults for e in again) else None


def _dense_form(records: tuple[FitRecord, ...], starts: Starts) -> tuple[OperatorSum, float]:
    columns = ColumnKinds.plays(threshold_grid(records, N_GRID))
    chain, _, _ = fit_base(records, columns, starts)
    return non_negative_form(chain, records), chain.creep_order


def non_negative_form(chain: TrialModel, records: tuple[FitRecord, ...]) -> OperatorSum:
    """Return the play form with non-negative weights on the chain's thresholds that fits the records best."""
    equations = normal_equations(
        (centred(record_columns(chain, r, i), r.is_used), centred(r.measured_um, r.is_used), r.is_used)
        for i, r in enumerate(records)
    )
    weights = non_negative_weights(equations.gram, equations.moment)
    thresholds = chain.columns.thresholds_v
    slope = float(np.sum(weights[thresholds == 0.0]))
    if not slope > 0.0:
        # Without a slope there is no inverse: the finest play takes its place.
        slope = max(1e-3 * float(np.sum(weights)), 1e-9)
    return OperatorSum(slope, thresholds[thresholds > 0.0], weights[thresholds > 0.0])


def _fitted_elements(
    dense: OperatorSum, order: float, n_elements: int, records: tuple[FitRecord, ...], starts: Starts
) -> FittedElements:
    form = merged(dense, n_elements)
    if form.thresholds.size == 0:
        top = float(np.max(dense.thresholds))
        form = OperatorSum(form.slope, np.array([0.5 * top]), np.array([1e-3 * form.slope]))
    return fit_elements(split(form, n_elements), order, records, starts)


def _choose_count(
    dense: OperatorSum,
    order: float,
    records: tuple[FitRecord, ...],
    starts: Starts,
    test: Recording | None,
    tell: Progress,
) -> FittedElements:
    held: tuple[FitRecord, ...]
    if test is not None:
        learned, held = records, (FitRecord.of(test),)
        held_starts = choose_starts(held)
    else:
        learned = tuple(r.using(learned_blocks(r.time_s.size)) for r in records)
        held, held_starts = tuple(r.using(held_out_blocks(r.time_s.size)) for r in records), starts
    scored: list[tuple[float, FittedElements]] = []
    counts = [c for c in AUTO_COUNTS if c <= max(2, int(np.count_nonzero(dense.weights)))]
    for number, count in enumerate(counts):
        tell(0.2 + 0.7 * number / len(counts), f"{count} elements against held-out data")
        found = _fitted_elements(dense, order, count, learned, starts)
        left = residuals(trial_of(found.form, found.order, held, held_starts), held)
        scored.append((rms(np.concatenate([v[r.is_used] for v, r in zip(left, held, strict=True)])), found))
    least = min(score for score, _ in scored)
    chosen = next(found for score, found in scored if score <= (1.0 + _WORTH_ADDING) * least)
    return chosen if test is not None else _fitted_elements(dense, order, chosen.form.thresholds.size, records, starts)


def _result(
    best: FittedElements,
    records: tuple[FitRecord, ...],
    starts: Starts,
    given: Sequence[Recording],
    test: Recording | None,
) -> Fit:
    model = PiezoModel(*elements_from_play_form(best.form), best.order, shortest_time_s=shortest_time(records))
    n = best.form.thresholds.size
    noise_variance = best.squared_error / sum(int(np.count_nonzero(r.is_used)) for r in records)
    errors = np.sqrt(variances_of(best.information) * noise_variance)
    weights, thresholds = errors[1 : 1 + n], errors[1 + n : 1 + 2 * n]
    undetermined = np.flatnonzero((weights > _UNDETERMINED) | (thresholds > _UNDETERMINED))
    return fit_of(
        model, given, test, starts, ParameterErrors(float(errors[-1]), errors[:-1], tuple(undetermined.tolist()))
    )


def fit_of(
    model: PiezoModel,
    recordings: Sequence[Recording],
    test: Recording | None,
    starts: Starts | None = None,
    errors: ParameterErrors | None = None,
) -> Fit:
    """Return the errors of a model on its training and held-out records as a ``Fit``.

    Args:
        model: the model.
        recordings: training records.
        test: held-out record, where there is one.
        starts: how each training record begins; found where not given.
        errors: of the parameters, where they are known.
    """
    records = tuple(FitRecord.of(r) for r in recordings)
    starts = choose_starts(records) if starts is None else starts
    trial = trial_of(model.play_form, model.creep_order, records, starts)
    left, offsets = [], []
    for index, record in enumerate(records):
        raw = record.measured_um - predict(trial, record, index)
        offsets.append(float(np.mean(raw[record.is_used])))
        left.append(raw - offsets[-1])
    error = rms(np.concatenate([v[r.is_used] for v, r in zip(left, records, strict=True)]))
    noise = known_noise(list(recordings)).floor_um
    test_error = float("nan")
    if test is not None:
        held = (FitRecord.of(test),)
        (held_left,) = residuals(trial_of(model.play_form, model.creep_order, held, choose_starts(held)), held)
        test_error = normalised_percent(rms(held_left[held[0].is_used]), [held[0].measured_um])
    if errors is None:
        errors = ParameterErrors(math.nan, np.full(2 * model.n_elements + 1, np.nan), ())
    outcome, reason = judged(error, noise, len(errors.undetermined_elements), model.n_elements)
    return Fit(
        model,
        outcome,
        reason,
        error,
        normalised_percent(error, [r.measured_um for r in records]),
        noise,
        test_error,
        tuple(offsets),
        tuple(left),
        errors.creep_order,
        errors.relative,
        errors.undetermined_elements,
        tuple("rested at its first voltage" if s else "relaxed" for s in starts),
    )

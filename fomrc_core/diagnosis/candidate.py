"""A candidate cause: fitted together with the base, from several starts, and scored on held-out data."""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.diagnosis.data_split import DataSplit, HeldOut, held_residuals
from fomrc_core.diagnosis.fit_starts import N_STARTS, clear_error, fit_starts, scanned, start_variants
from fomrc_core.diagnosis.held_out_score import HeldOutScore, held_out_score
from fomrc_core.diagnosis.leverage import determined
from fomrc_core.diagnosis.present_model import PresentModel, residual_inflation
from fomrc_core.diagnosis.screening import HeldView, Screened
from fomrc_core.fitting.base_fit import rebased
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.free_parameters import free_parameters
from fomrc_core.fitting.joint_fit import Refit, fit_until_still, refit
from fomrc_core.fitting.linear_part import Tangent, squared_error
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.causes import cause_classes
from fomrc_core.records.drive import held_out_blocks, learned_blocks

Array = NDArray[np.float64]

_MAX_CANDIDATES = 8  # refitted in one round: as many as there are kinds of lag, which screen alike
_MIN_SCREENED = 25.0  # explained sum of squares over noise variance and correlation
_LEAST_SHARE = 0.005  # of the squared error: what explains less is no finding, however sure
_ENOUGH_SHARE = 0.1  # what explains as much is tried, however few samples a slow cause leaves independent
_CLOSE_TO_BEST = 0.2  # of what the best signature explains; a cause that explains less waits for another round
# Of the logarithmic gain in training beside that on held-out data: any cause with more parameters gains there, so it
# counts for less.
_TRAINING_COUNTS = 0.3
_RICH_PENALTY = 1.02  # on the squared error: sixty weights more fit as much of the noise of 3000 samples
_LEAST_SCORED = 0.3  # share of the held-out samples; where less is determined nothing is left out
_HOPELESS = 4.0  # times the least squared error so far: twice its rms after some iterations is another valley
_MUCH_LEFT = 4.0  # times the noise's power: where nothing looks likely, the likeliest few are fitted all the same
_UNPROMISING = 4  # of those few
_STILL_OPEN = 1.0  # in the logarithm of the mean squared error: what is nearer to the best may still come to be it
_FIRST_ITERATIONS, _MORE_ITERATIONS = 3, 6  # of all starts, and of those worth going on with
_FAR_BEHIND = 1.5  # times the squared error of the best start after the first iterations
_SAME_VALLEY = 0.02  # of what two starts explain: if their residuals differ by less power, they end alike
_LARGEST_INFLATION = 200.0  # a residual that drifts as a whole is correlated without end


@dataclass(frozen=True, eq=False)
class Candidate:
    """A candidate after its joint refit.

    Attributes:
        cause: its name.
        fitted: the joint refit.
        score: on held-out data.
        train_log_gain: logarithm of the ratio of mean squared errors on the training data.
        held: residuals on the held-out data [um].
        n_free: number of parameters it adds.
        is_plausible: whether the records can show it with the parameters found.
        is_bound: whether its parameters belong to single records.
        is_distinguishable: whether the records can tell it from others: one-sided plays bend to any lag in a loop
            that repeats.
    """

    cause: str
    fitted: Refit
    score: HeldOutScore
    train_log_gain: float
    held: tuple[Array, ...]
    n_free: int
    is_plausible: bool = True
    is_bound: bool = False
    is_distinguishable: bool = True

    @property
    def total_gain(self) -> float:
        """Held-out gain, and for less the gain in training.

        A rich cause fits anything in training; but with two effects hidden neither alone need help held-out data.
        """
        return max(self.held_gain, -0.5) + _TRAINING_COUNTS * self.train_log_gain

    @property
    def held_gain(self) -> float:
        """Logarithmic gain on held-out data, comparable between causes.

        Blocks of the same record are an easier test than another record: there training is asked as well.
        """
        return min(self.score.log_gain, self.train_log_gain) if self.is_bound else self.score.log_gain


def candidates_for(
    present: PresentModel, split: DataSplit, screened: tuple[Screened, ...], executor: Executor | None
) -> list[Candidate]:
    """Return the likely causes after their joint refits, the most gaining first.

    Args:
        present: the present model.
        split: records.
        screened: the screening's trial instances.
        executor: runs refits side by side where given.
    """
    by_cause = _worth_a_refit(present, split, screened)
    tasks = [(present, split, trials) for trials in by_cause]
    run = map if executor is None else executor.map
    found = [candidate for candidate in run(_fit_candidate, tasks) if candidate is not None]
    ahead = max((candidate.total_gain for candidate in found), default=0.0) - _STILL_OPEN
    # no two are compared before they have come to rest
    rest = [(present, split, candidate) for candidate in found if candidate.total_gain > ahead]
    if len(rest) > 1:
        found = [candidate for candidate in found if candidate.total_gain <= ahead]
        found += run(_at_rest, rest)
    return sorted(found, key=lambda candidate: -candidate.total_gain)


def _worth_a_refit(present: PresentModel, split: DataSplit, screened: tuple[Screened, ...]) -> list[list[Screened]]:
    """Return the trial instances of each cause that may explain much, the likeliest first."""
    error = present.squared_error
    inflation = residual_inflation(present.residuals_um, split.train)
    variance = error / split.n_used
    limit = min(_MIN_SCREENED * variance * min(inflation, _LARGEST_INFLATION), _ENOUGH_SHARE * error)
    held_error = sum(float(np.dot(v, v)) for v in held_residuals(present.model, split.held))
    held_limit, limit = max(limit, _LEAST_SHARE * held_error), max(limit, _LEAST_SHARE * error)
    by_cause: dict[str, list[Screened]] = {}
    for trial in screened:
        if trial.explained > limit or trial.explained_held > held_limit:
            by_cause.setdefault(trial.name, []).append(trial)
    if not by_cause:
        # what a large effect explains at full size its slope does not tell
        best = [trial for trial in screened if error > _MUCH_LEFT * present.noise_um**2 * split.n_used]
        for trial in best:
            if len(by_cause) < _UNPROMISING or trial.name in by_cause:
                by_cause.setdefault(trial.name, []).append(trial)
    if not by_cause:
        return []
    likely = _likely({name: trials[0].explained for name, trials in by_cause.items()})
    held = {name: max(t.explained_held for t in trials) for name, trials in by_cause.items()}
    likely += [name for name in _likely(held) if name not in likely]
    most_held = max(held.values())

    def worth(trial: Screened) -> float:
        # what the base absorbs in training is told apart on the held-out record
        return trial.explained / error + (trial.explained_held / most_held if most_held > 0.0 else 0.0)

    # a scan takes longest: begun last it would be waited for
    likely.sort(key=lambda name: not cause_classes()[name].is_scanned)
    return [sorted(by_cause[name], key=worth, reverse=True) for name in likely]


def _likely(explained: dict[str, float]) -> list[str]:
    best = max(explained.values())
    names = [name for name, value in explained.items() if value > _CLOSE_TO_BEST * best and value > 0.0]
    return sorted(names, key=lambda name: -explained[name])[:_MAX_CANDIDATES]


def held_view(model: TrialModel, split: DataSplit) -> HeldView | None:
    """Return the held-out record under a model; None where blocks of the training records are held out."""
    apart = [part for part in split.held if part.index >= len(split.train)]
    return HeldView.of(model, apart[0].record, apart[0].index) if apart else None


def _fit_candidate(task: tuple[PresentModel, DataSplit, list[Screened]]) -> Candidate | None:
    present, split, trials = task
    model, error, cause = present.model, present.squared_error, trials[0].name
    bound = trials[0].cause.belongs_to_record()
    trials = [trial for trial in trials if trial.cause.belongs_to_record() == bound]
    fits = _fits_from_starts(present, split, trials, bound)
    if not fits or min(f.squared_error for f in fits) > _HOPELESS * error:
        return None
    # as many more weights must earn their keep
    best = min(fits, key=lambda f: f.squared_error * (_RICH_PENALTY if f.model.n_owned > model.n_owned else 1.0))
    # the forms of what befell single records differ little until the base no longer bends to it
    ways = fits if bound else [best]
    best = min((_followed(way, split, error) for way in ways), key=lambda f: f.squared_error)
    return _candidate(present, split, cause, best, bound)


def _at_rest(task: tuple[PresentModel, DataSplit, Candidate]) -> Candidate:
    """Return the candidate with its fit gone on until it moves no more."""
    present, split, candidate = task
    if candidate.fitted.is_converged or candidate.is_bound:
        return candidate
    fitted = fit_until_still(candidate.fitted.model, split.train)
    if fitted.squared_error >= candidate.fitted.squared_error:
        return candidate
    return _candidate(present, split, candidate.cause, fitted, candidate.is_bound)


def _candidate(present: PresentModel, split: DataSplit, cause: str, fitted: Refit, bound: bool) -> Candidate:
    """Return the candidate of a joint refit, scored on held-out data."""
    model = present.model
    before, after = _held_pair(model, fitted, split, cause, bound)
    n_free = len(free_parameters(fitted.model)) - len(free_parameters(model))
    longest = max(float(record.time_s[-1]) for record in split.train)
    step = min(float(np.median(record.steps_s)) for record in split.train)
    acting = (c for at, c in fitted.model.found() if at is None or at < len(split.train))
    is_plausible = all(c.is_plausible(longest, step) for c in acting)
    is_plausible = is_plausible and (not bound or _is_confirmed(fitted, split, cause))
    train_gain = math.log(present.squared_error / fitted.squared_error)
    is_distinguishable = not cause_classes()[cause].needs_many_loops or split.is_telling
    score = held_out_score(before, after)
    return Candidate(cause, fitted, score, train_gain, tuple(after), n_free, is_plausible, bound, is_distinguishable)


def _fits_from_starts(present: PresentModel, split: DataSplit, trials: list[Screened], bound: bool) -> list[Refit]:
    """Return the joint refits of a cause from the most promising of its starts.

    All starts go a few iterations; of those that have come to the same valley one goes on, and of those far behind
    none (successive halving).
    """
    begun = []
    for start, given in _starts(present, split, trials, bound):
        begun.append((refit(start, split.train, given, n_iterations=_FIRST_ITERATIONS), given))
    begun.sort(key=lambda pair: pair[0].squared_error)
    fits: list[Refit] = []
    gone_on: list[Refit] = []
    for first, given in begun:
        error = first.squared_error
        hopeless = _HOPELESS * min([present.squared_error, *(f.squared_error for f in fits)])
        is_behind = bool(gone_on) and error > _FAR_BEHIND * gone_on[0].squared_error and not bound
        if error > hopeless or is_behind:
            break
        if any(_is_same_valley(first, other, present, split) for other in gone_on):
            continue
        gone_on.append(first)
        if first.is_converged:
            fits.append(first)
            continue
        further = refit(first.model, split.train, given, n_iterations=_MORE_ITERATIONS, hopeless_um2=hopeless)
        fits.append(min(further, first, key=lambda f: f.squared_error))
    return fits


def _starts(
    present: PresentModel, split: DataSplit, trials: list[Screened], bound: bool
) -> list[tuple[TrialModel, Tangent | None]]:
    """Return where the fits of a cause begin, with the directions of the linear part where those known still hold.

    Where it is unsure how the records begin, starts of either assumption compete.
    """
    found: list[tuple[float, TrialModel, Tangent | None]] = []
    for variant, directions in start_variants(present, split):
        starts = fit_starts(variant, trials, bound, split, directions)
        if trials[0].cause.is_scanned:
            starts = [scanned(start, split, directions, trial) for start, trial in zip(starts, trials, strict=False)]
        for start in starts:
            # a family of columns and a large effect turn the directions of the linear part: take them anew
            error = clear_error(start, split, directions)
            is_new = start.weights.size != present.model.weights.size or error > 2.0 * present.squared_error
            found.append((error, start, None if is_new else directions))
    if bound:
        return [(start, given) for _, start, given in found]
    chosen: list[tuple[TrialModel, Tangent | None]] = []
    forms: set[tuple[object, ...]] = set()
    for _, start, given in sorted(found, key=lambda option: option[0]):
        form = (tuple(p.spec.name for p in free_parameters(start)), start.weights.size)
        if form not in forms or len(chosen) < N_STARTS:
            chosen.append((start, given))
            forms.add(form)
    return chosen


def _is_same_valley(one: Refit, other: Refit, present: PresentModel, split: DataSplit) -> bool:
    """Return whether two starts of one form have come to nearly the same residual, beside what they explain."""
    if tuple(p.spec.name for p in one.free) != tuple(p.spec.name for p in other.free):
        return False
    apart = tuple(a - b for a, b in zip(one.residual, other.residual, strict=True))
    explained = present.squared_error - max(one.squared_error, other.squared_error)
    return squared_error(split.train, apart) < _SAME_VALLEY * explained


def _followed(fitted: Refit, split: DataSplit, error: float) -> Refit:
    """Return the refit with plays chosen anew, where it moved much or not to the end."""
    if fitted.squared_error > 0.5 * error and fitted.is_converged:
        return fitted
    again = refit(rebased(fitted.model, split.train), split.train, n_iterations=8)
    return again if again.squared_error < fitted.squared_error else fitted


def _is_confirmed(fitted: Refit, split: DataSplit, cause: str) -> bool:
    """Return whether some record shows what the effect must show there."""
    without = fitted.model.without(cause)
    for index, record in enumerate(split.train):
        found = next((c for _, c in fitted.model.found(index) if c.name == cause), None)
        if found is None:
            continue
        residual_um = record.measured_um - predict(without, record, index)
        if found.is_confirmed(record.time_s, record.voltage_v, residual_um):
            return True
    return False


def _held_pair(
    model: TrialModel, fitted: Refit, split: DataSplit, cause: str, bound: bool
) -> tuple[list[Array], list[Array]]:
    if not bound:
        return held_residuals(model, split.held), held_residuals(fitted.model, split.held)
    # An effect of one record cannot be held out by another record: hold out blocks of the same one.
    indices = [i for i in range(len(split.train)) if fitted.model.has(cause, i)]
    learned = tuple(r.using(r.is_used & learned_blocks(r.time_s.size)) for r in split.train)
    blocked = refit(fitted.model, learned, n_iterations=4)
    base = refit(model, learned, n_iterations=2)
    scored = _scored(split, indices, learned, (base.model, blocked.model))
    return held_residuals(base.model, scored), held_residuals(blocked.model, scored)


def _scored(
    split: DataSplit, indices: list[int], learned: tuple[FitRecord, ...], models: tuple[TrialModel, ...]
) -> tuple[HeldOut, ...]:
    """Return the held-out blocks of these records, without what the learned ones leave open in either model."""
    blocks = tuple(held_out_blocks(r.time_s.size) for r in split.train)
    masks = [np.all(both, axis=0) for both in zip(*(determined(c, learned, blocks) for c in models), strict=True)]
    used = [
        masks[i] if np.count_nonzero(masks[i]) >= _LEAST_SCORED * np.count_nonzero(blocks[i]) else blocks[i]
        for i in indices
    ]
    return tuple(HeldOut(split.train[i].using(mask), i) for i, mask in zip(indices, used, strict=True))

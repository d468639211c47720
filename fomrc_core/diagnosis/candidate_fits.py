"""The joint refits of a candidate cause, from the most promising of its starts (successive halving).

All starts of all causes go a few iterations; of those that have come to the same valley one goes on, and of those far
behind none (Jamieson and Talwalkar, 2016: non-stochastic best arm identification).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.fit_starts import N_STARTS, clear_error, fit_starts, scanned, start_variants
from fomrc_core.diagnosis.held_out_score import SURE
from fomrc_core.diagnosis.moved_times import with_moments_placed
from fomrc_core.diagnosis.present_model import PresentModel, residual_inflation
from fomrc_core.diagnosis.screening import Screened
from fomrc_core.diagnosis.within_reach import MORE_ITERATIONS, Reach, foreseen_gain
from fomrc_core.fitting.base_fit import rebased
from fomrc_core.fitting.free_parameters import free_parameters
from fomrc_core.fitting.joint_fit import Refit, fit_until_still, refit
from fomrc_core.fitting.linear_part import Tangent, squared_error
from fomrc_core.fitting.trial_model import TrialModel

_HOPELESS = 4.0  # times the least squared error so far: twice its rms after some iterations is another valley
_FIRST_ITERATIONS = 3  # of all starts
_FAR_BEHIND = 1.5  # times the squared error of the best start after the first iterations
_MOST_CHOICES = 4  # of plays anew, one after the other: hardly any gains after the third
_LARGE = 0.5  # of the squared error is left by an effect beside which the plays must be chosen anew
_SAME_VALLEY = 0.02  # of what two starts explain: if their residuals differ by less power, they end alike


@dataclass(frozen=True, eq=False)
class Begun:
    """The first iterations from each start of a cause.

    Attributes:
        cause: its name.
        is_bound: whether its parameters belong to single records.
        fits: each fit so far, the best first, with the directions of the linear part where those known still hold.
    """

    cause: str
    is_bound: bool
    fits: tuple[tuple[Refit, Tangent | None], ...]

    @property
    def begins_far_off(self) -> bool:
        """Whether it takes the place of the power law, with which all else was fitted: no race is fair to it."""
        return any(effect.name == self.cause and effect.replaces_creep for effect in self.fits[0][0].model.effects)

    def is_without_plays(self, fitted: Refit) -> bool:
        """Return whether a fit is of the form without plays of a cause that may bring some."""
        owned = [bool(np.any(one.model.columns.owned_by(self.cause))) for one, _ in self.fits]
        return any(owned) and not np.any(fitted.model.columns.owned_by(self.cause))


def begin(task: tuple[PresentModel, DataSplit, list[Screened]]) -> Begun:
    """Return the first iterations from the starts that the trial instances of one cause give."""
    present, split, trials = task
    bound = trials[0].cause.belongs_to_record()
    trials = [trial for trial in trials if trial.cause.belongs_to_record() == bound]
    fits = [
        (refit(start, split.train, given, n_iterations=_FIRST_ITERATIONS), given)
        for start, given in _starts(present, split, trials, bound)
    ]
    return Begun(trials[0].name, bound, tuple(sorted(fits, key=lambda pair: pair[0].squared_error)))


def gone_on(present: PresentModel, split: DataSplit, begun: Begun, least_um2: float) -> Refit | None:
    """Return the best joint refit of a cause; None where none comes near the present model.

    Args:
        present: the present model.
        split: records.
        begun: the first iterations of the cause.
        least_um2: the least sum of squares of all causes after theirs [um^2]: one far above it goes no further.
    """
    first = begun.fits[0][0]
    foreseen = min(_foreseen(fitted) for fitted, _ in begun.fits)
    if not begun.is_bound and foreseen > _HOPELESS * max(least_um2, split.noise_um2):
        return first if first.squared_error < present.squared_error else None
    fits = _further(present, split, begun)
    if not fits or min(f.squared_error for f in fits) > _HOPELESS * present.squared_error:
        return None
    if begun.is_bound:
        # the forms of what befell single records differ little until the base no longer bends to it
        followed = (_followed_to_rest(way, split, present.squared_error) for way in fits)
        return _with_moments_placed(min(followed, key=lambda f: f.squared_error), split, present.squared_error)
    if begun.begins_far_off:
        # the plays were chosen beside the power law: beside another they are others, and no form is told before
        fits = [fit_until_still(fitted.model, split.train) for fitted in _best_of_forms(fits)]
    # a bend of the drive needs other plays of the base than the family that stands in for it
    fits = [fit_until_still(f.model, split.train) if begun.is_without_plays(f) else f for f in fits]
    closest = min(fits, key=lambda f: f.squared_error)
    if closest.squared_error > _FAR_BEHIND * max(least_um2, split.noise_um2):
        # whichever form of it is the right one, another cause left less when it had only begun
        return _followed(closest, split, present.squared_error)
    best = _worth_its_parameters(fits, present, split)
    followed_best = _followed(best, split, present.squared_error)
    near = [f for f in fits if f is not best and _foreseen(f) < _FAR_BEHIND * best.squared_error]
    is_small = best.squared_error > _LARGE * present.squared_error
    if is_small or followed_best is best or not near:
        return followed_best
    # plays that were chosen before a large effect leave more than one form of it does from another
    ways = (followed_best, *(_followed(way, split, present.squared_error) for way in near))
    return _worth_its_parameters([fit_until_still(way.model, split.train) for way in ways], present, split)


def _worth_its_parameters(fits: list[Refit], present: PresentModel, split: DataSplit) -> Refit:
    """Return the fit of the form that earns its parameters (Schwarz, 1978), the simpler ones gone on to their rest.

    The weights of plays that a form brings are parameters as any other: a bend of the drive is no family of plays.
    """
    closest = min(fits, key=lambda fitted: fitted.squared_error)
    n_independent = max(split.n_used / residual_inflation(closest.residual, split.train), math.e)

    def n_free(fitted: Refit) -> int:
        return len(free_parameters(fitted.model)) + fitted.model.n_owned

    def cost(fitted: Refit) -> float:
        return math.log(fitted.squared_error) + n_free(fitted) * math.log(n_independent) / n_independent

    best = min(fits, key=cost)
    near = [f for f in fits if n_free(f) < n_free(best) and _foreseen(f) < _FAR_BEHIND * best.squared_error]
    return min((best, *(fit_until_still(f.model, split.train) for f in near)), key=cost)


def _foreseen(first: Refit) -> float:
    """Return the sum of squares a fit would come to if it went on falling as it fell last [um^2]."""
    return first.squared_error * math.exp(-foreseen_gain(first))


def _further(present: PresentModel, split: DataSplit, begun: Begun) -> list[Refit]:
    fits: list[Refit] = []
    begun_valleys: list[Refit] = []
    closest = begun.fits[0][0]
    n_independent = split.n_used / residual_inflation(closest.residual, split.train)
    reach = Reach(present.squared_error, max(closest.squared_error, split.noise_um2), n_independent)
    for first, given in begun.fits:
        error = first.squared_error
        # of another form a few iterations say little
        alike = [other for other in begun_valleys if _form(other.model) == _form(first.model)]
        hopeless = _HOPELESS * min([present.squared_error, *(f.squared_error for f in fits)])
        if not alike and (begun.begins_far_off or begun.is_without_plays(first)):
            hopeless = math.inf  # each form is followed once
        elif not begun.is_bound and not reach.holds(first):
            continue  # whichever form is right, what is surely behind another tells no more of the cause
        if _foreseen(first) > hopeless:
            continue
        is_behind = bool(alike) and error > _FAR_BEHIND * alike[0].squared_error
        if is_behind and not begun.is_bound:
            continue
        # pasts that look alike from one record differ in what they say of the others
        if not begun.is_bound and any(_is_same_valley(first, other, present, split) for other in begun_valleys):
            continue
        begun_valleys.append(first)
        if first.is_converged:
            fits.append(first)
            continue
        further = refit(first.model, split.train, given, n_iterations=MORE_ITERATIONS, hopeless_um2=hopeless)
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
        form = _form(start)
        if form not in forms or len(chosen) < N_STARTS:
            chosen.append((start, given))
            forms.add(form)
    return chosen


def _form(model: TrialModel) -> tuple[object, ...]:
    """Return what no fit changes of a model: what it moves, what its effects have chosen, and the plays they bring."""
    moves = tuple(p.spec.name for p in free_parameters(model))
    return moves, tuple(effect.form() for effect in model.effects), model.n_owned


def _is_same_valley(one: Refit, other: Refit, present: PresentModel, split: DataSplit) -> bool:
    """Return whether two starts of one form have come to nearly the same residual, beside what they explain."""
    if _form(one.model) != _form(other.model):
        return False
    apart = tuple(a - b for a, b in zip(one.residual, other.residual, strict=True))
    explained = present.squared_error - max(one.squared_error, other.squared_error)
    return squared_error(split.train, apart) < _SAME_VALLEY * explained


def _best_of_forms(fits: list[Refit]) -> list[Refit]:
    """Return the fit of each form that leaves least."""
    best: dict[tuple[object, ...], Refit] = {}
    for fitted in sorted(fits, key=lambda f: f.squared_error):
        best.setdefault(_form(fitted.model), fitted)
    return list(best.values())


def _followed(fitted: Refit, split: DataSplit, error: float) -> Refit:
    """Return the refit with plays chosen anew, where it moved much or not to the end."""
    if fitted.squared_error > _LARGE * error and fitted.is_converged:
        return fitted
    again = refit(rebased(fitted.model, split.train), split.train, n_iterations=8)
    return again if again.squared_error < fitted.squared_error else fitted


def _with_moments_placed(fitted: Refit, split: DataSplit, error: float) -> Refit:
    """Return the refit with the moments of what befell single records where they belong, and all else gone on.

    A base that had bent to what came at a moment shows it elsewhere; with the one mended the other moves on.
    """
    for _ in range(_MOST_CHOICES):
        model = with_moments_placed(fitted.model, split.train)
        if model is fitted.model:
            break
        moved = _followed_to_rest(refit(model, split.train, n_iterations=MORE_ITERATIONS), split, error)
        if moved.squared_error >= fitted.squared_error:
            break
        fitted = moved
    return fitted


def _followed_to_rest(fitted: Refit, split: DataSplit, error: float) -> Refit:
    """Return the same with plays chosen anew until that surely gains no more.

    Plays that were chosen while an effect was hidden bend to it, and those chosen beside what they left of it again.
    What belongs to the actuator goes on to its rest where it is compared, what befell a record has this alone.
    """
    for _ in range(_MOST_CHOICES):
        before = fitted
        fitted = _followed(before, split, error)
        n_independent = split.n_used / residual_inflation(fitted.residual, split.train)
        if n_independent * math.log(before.squared_error / fitted.squared_error) <= SURE:
            break
    return fitted

"""A candidate cause: fitted together with the base, from several starts, and scored on held-out data."""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.diagnosis.candidate_fits import Begun, begin, gone_on
from fomrc_core.diagnosis.data_split import DataSplit, HeldOut, held_residuals
from fomrc_core.diagnosis.held_out_score import HeldOutScore, held_out_score
from fomrc_core.diagnosis.leverage import determined
from fomrc_core.diagnosis.present_model import PresentModel, residual_inflation
from fomrc_core.diagnosis.record_effects import refollowed
from fomrc_core.diagnosis.screening import Screened
from fomrc_core.diagnosis.seen_loops import loops_are_seen
from fomrc_core.diagnosis.within_reach import Reach, foreseen_gain, may_be_found
from fomrc_core.diagnosis.worth_a_refit import worth_a_refit
from fomrc_core.errors import ParameterError
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.free_parameters import free_parameters
from fomrc_core.fitting.joint_fit import Refit, fit_until_still, refit
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.model.causes import cause_classes
from fomrc_core.records.drive import held_out_blocks, learned_blocks
from fomrc_core.records.noise import autocorrelation_inflation

Array = NDArray[np.float64]

# Of the logarithmic gain in training beside that on held-out data: any cause with more parameters gains there, so it
# counts for less.
_TRAINING_COUNTS = 0.3
_LEAST_SCORED = 0.3  # share of the held-out samples; where less is determined nothing is left out
_STILL_OPEN = 3.0  # in the logarithm of the mean squared error: what is nearer to the best may still come to be it
_NEAR = 0.15  # the same where a fit has converged and hardly moved: the plays it began with are those it needs
_MOVED = 0.7  # logarithmic gain in training from which on the plays must be chosen anew, and perhaps once more
_N_UNFAIR = 2  # followed whoever is ahead by plays of its own: each costs some simulations


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
        before: what the model without it leaves of the training records [um].
        held_before: the same of the held-out data.
        is_unconfirmed: whether it would be plausible if any record confirmed it, as a drift that noise might be.
        unseats: causes found before that beside it are what no record can show; they, and not it, are implausible.
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
    before: tuple[Array, ...] = ()
    held_before: tuple[Array, ...] = ()
    is_unconfirmed: bool = False
    unseats: frozenset[str] = frozenset()

    @property
    def brings_plays(self) -> bool:
        """Whether it has plays of its own, which bend to much else."""
        return bool(np.any(self.fitted.model.columns.owned_by(self.cause)))

    @property
    def n_parameters(self) -> int:
        """Number of parameters it adds, weights of its own plays and times that a search moves among them."""
        model = self.fitted.model
        n_weights = int(np.count_nonzero(model.weights[model.columns.owned_by(self.cause)]))
        own = [cause for _, cause in model.found() if cause.name == self.cause]
        return self.n_free + n_weights + sum(len(getattr(cause, name)) for cause in own for name in cause.moved_times)

    @property
    def total_gain(self) -> float:
        """Held-out gain, and for less the gain in training.

        A rich cause fits anything in training; but with two effects hidden neither alone need help held-out data.
        """
        return max(self.held_gain, -0.5) + _TRAINING_COUNTS * self.train_log_gain

    @property
    def log_likelihood_gain(self) -> float:
        """By how much training and held-out data together are likelier with it, parameters uncounted [1]."""
        gain = 0.0
        for left, log_gain in ((self.fitted.residual, self.train_log_gain), (self.held, self.score.log_gain)):
            gain += 0.5 * log_gain * sum(values.size / autocorrelation_inflation(values) for values in left)
        return gain

    @property
    def held_gain(self) -> float:
        """Logarithmic gain on held-out data, comparable between causes.

        Blocks of the same record are an easier test than another record: there training is asked as well.
        """
        return min(self.score.log_gain, self.train_log_gain) if self.is_bound else self.score.log_gain


def candidates_for(
    present: PresentModel,
    split: DataSplit,
    screened: tuple[Screened, ...],
    executor: Executor | None,
    standing: Candidate | None = None,
) -> list[Candidate]:
    """Return the likely causes after their joint refits, the most gaining first.

    Args:
        present: the present model.
        split: records.
        screened: the screening's trial instances.
        executor: runs refits side by side where given.
        standing: whose place they are asked for, at rest already: who is far behind it is not followed to the end.
    """
    return refitted(present, split, worth_a_refit(present, split, screened), executor, standing)


def refitted(
    present: PresentModel,
    split: DataSplit,
    by_cause: list[list[Screened]],
    executor: Executor | None,
    standing: Candidate | None = None,
) -> list[Candidate]:
    """Return the causes of these trial instances after their joint refits, the most gaining first."""
    run = map if executor is None else executor.map
    begun = [first for first in run(begin, [(present, split, trials) for trials in by_cause]) if first.fits]
    reach = _reach(present, split, begun, standing)
    tasks = [(present, split, first, reach) for first in begun]
    found = [candidate for candidate in run(_fit_candidate, tasks) if candidate is not None]
    # no two are compared before they have come to rest
    compared = found if standing is None else [*found, standing]
    best = max((candidate.total_gain for candidate in compared), default=0.0)
    unfair = _without_plays(compared, best)
    near = [_is_open(candidate, best) or any(candidate is other for other in unfair) for candidate in found]
    if _are_compared(found, near, standing):
        rest = [(present, split, candidate) for candidate, is_near in zip(found, near, strict=True) if is_near]
        found = [candidate for candidate, is_near in zip(found, near, strict=True) if not is_near]
        found += run(_at_rest, rest)
    return sorted(found, key=lambda candidate: -candidate.total_gain)


def _are_compared(found: list[Candidate], near: list[bool], standing: Candidate | None) -> bool:
    """Return whether those that are near will be compared with another.

    One that is near alone will be as well where training speaks for another: of two of which one has had its plays
    chosen anew and one has not, training tells nothing.
    """
    if sum(near) != 1 or standing is not None:
        return any(near)
    lone = found[near.index(True)]
    return any(other.fitted.squared_error < lone.fitted.squared_error for other in found)


def _without_plays(compared: list[Candidate], best_gain: float) -> list[Candidate]:
    """Return the likeliest few that moved much, where the best brought plays of its own and they have those of before.

    A base that has bent to a large effect may have two plays left: beside the right cause it needs all of them.
    """
    rich = [c for c in compared if c.total_gain == best_gain and c.brings_plays]
    if not rich:
        return []
    plain = [c for c in compared if not c.is_bound and c not in rich and c.train_log_gain > _MOVED]
    return sorted(plain, key=lambda candidate: -candidate.total_gain)[:_N_UNFAIR]


def _is_open(candidate: Candidate, best_gain: float) -> bool:
    """Return whether a candidate may come to be the best once its fit has come to rest."""
    if candidate.is_bound or candidate.train_log_gain <= 0.0:
        return False
    behind = best_gain - candidate.total_gain
    if candidate.train_log_gain >= _MOVED:
        return behind < _STILL_OPEN
    # what it may still gain, in training and as much on held-out data
    return behind < min(_NEAR + (1.0 + _TRAINING_COUNTS) * foreseen_gain(candidate.fitted), _STILL_OPEN)


def _reach(present: PresentModel, split: DataSplit, begun: list[Begun], standing: Candidate | None) -> Reach:
    """Return how far behind the best, or behind one that stands at rest, those that have begun may be."""
    closest = min((first.fits[0][0] for first in begun), key=lambda fitted: fitted.squared_error, default=None)
    left_um = present.residuals_um if closest is None else closest.residual
    known = [closest, None if standing is None else standing.fitted]
    least_um2 = min((fitted.squared_error for fitted in known if fitted is not None), default=math.inf)
    # what noise is left of it is no one's gain
    least_um2 = max(least_um2, split.noise_um2)
    reach = Reach(present.squared_error, least_um2, split.n_used / residual_inflation(left_um, split.train))
    return reach if standing is None else replace(reach, is_beside_one_at_rest=True)


def _fit_candidate(task: tuple[PresentModel, DataSplit, Begun, Reach]) -> Candidate | None:
    present, split, begun, reach = task
    try:
        first = begun.fits[0][0]
        is_raced = not begun.is_bound and not begun.begins_far_off
        # where few samples are independent a cause that mends nothing is within reach of one that mends little
        if is_raced and (reach.is_of_little or not any(reach.holds(fitted) for fitted, _ in begun.fits)):
            stays = candidate_of(present, split, begun.cause, first, begun.is_bound)
            further = max(foreseen_gain(fitted) for fitted, _ in begun.fits)
            if not may_be_found(stays.score, further):
                return stays if first.squared_error < present.squared_error else None
        fitted = gone_on(present, split, begun, reach.least_um2)
        return None if fitted is None else candidate_of(present, split, begun.cause, fitted, begun.is_bound)
    except ParameterError:
        return None  # what another record cannot be simulated with is no model of the actuator


def _at_rest(task: tuple[PresentModel, DataSplit, Candidate]) -> Candidate:
    """Return the candidate with its fit gone on until it moves no more."""
    present, split, candidate = task
    fitted = fit_until_still(candidate.fitted.model, split.train)
    if fitted.squared_error >= candidate.fitted.squared_error:
        return candidate
    try:
        return candidate_of(present, split, candidate.cause, fitted, candidate.is_bound)
    except ParameterError:
        return candidate


def candidate_of(present: PresentModel, split: DataSplit, cause: str, fitted: Refit, bound: bool) -> Candidate:
    """Return the candidate of a joint refit, scored on held-out data beside the present model.

    Raises:
        ParameterError: a record that held-out or quoted data belong to cannot be simulated with it, as where a delay
            holds more samples than there is room for.
    """
    model = present.model
    held_residuals(fitted.model, split.report)
    before, after = _held_pair(model, fitted, split, cause, bound)
    n_free = len(free_parameters(fitted.model)) - len(free_parameters(model))
    implausible = implausible_in(fitted.model, split)
    is_plausible = not implausible
    is_unconfirmed = is_plausible and bound and not is_confirmed(fitted, split, cause)
    train_gain = math.log(present.squared_error / fitted.squared_error)
    is_distinguishable = not cause_classes()[cause].needs_many_loops or split.is_telling
    score = held_out_score(before, after)
    return Candidate(
        cause,
        fitted,
        score,
        train_gain,
        tuple(after),
        n_free,
        is_plausible and not is_unconfirmed,
        bound,
        is_distinguishable,
        present.residuals_um,
        tuple(before),
        is_unconfirmed,
        frozenset() if cause in implausible else implausible,
    )


def implausible_in(model: TrialModel, split: DataSplit) -> frozenset[str]:
    """Return the causes of a model that no training record could show with the parameters found."""
    longest = max(float(record.time_s[-1]) for record in split.train)
    step = min(float(np.median(record.steps_s)) for record in split.train)
    acting = [c for at, c in model.found() if at is None or at < len(split.train)]
    stroke_um = max(float(np.ptp(record.measured_um[record.is_used])) for record in split.train)
    implausible = {c.name for c in acting if not (c.is_plausible(longest, step) and c.is_shown_over(stroke_um))}
    bends = {c.name for c in acting if c.needs_loops}
    return frozenset(implausible if not bends or loops_are_seen(model, split) else implausible | bends)


def is_confirmed(fitted: Refit, split: DataSplit, cause: str) -> bool:
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
        # what a drift had to make up for in the held-out record it need not beside what is right
        return held_residuals(model, split.held), held_residuals(refollowed(fitted.model, split), split.held)
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

"""The search for causes: screen, refit, accept on held-out data, re-test, stop."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.diagnosis.candidate import Candidate, candidates_for, held_view
from fomrc_core.diagnosis.data_split import DataSplit, held_residuals
from fomrc_core.diagnosis.decision import (
    SURE,
    is_accepted,
    likelier,
    residual_inflation,
    rivals_of,
    still_tied,
    sure_gain,
    ties_of,
)
from fomrc_core.diagnosis.held_out_score import WORTHWHILE_LOG_GAIN, held_out_score
from fomrc_core.diagnosis.record_effects import follow_held, sought_again
from fomrc_core.diagnosis.screening import Screened, screen
from fomrc_core.fitting.joint_fit import Refit, fit_until_still, refit
from fomrc_core.fitting.linear_part import residuals, tangent
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes

Array = NDArray[np.float64]

MAX_FINDINGS = 5
_MAX_ROUNDS = MAX_FINDINGS + 2  # two in which a cause takes another's place
_LEAST_SIGMAS = 3.0
_PRUNED = 0.03


@dataclass(frozen=True, eq=False)
class Step:
    """One acceptance.

    Attributes:
        before: the chain before it.
        accepted: the candidate.
        tied: causes it could not be told from.
        tied_chains: the chains with those.
        rivals: candidates that did nearly as well while other causes were still unexplained.
    """

    before: TrialModel
    accepted: Candidate
    tied: tuple[str, ...]
    tied_chains: tuple[TrialModel, ...]
    rivals: tuple[Candidate, ...] = ()

    def tied_with(self, tied: list[Candidate]) -> Step:
        """Return the step with these ties."""
        return replace(self, tied=tuple(c.cause for c in tied), tied_chains=tuple(c.fitted.chain for c in tied))


@dataclass(frozen=True, eq=False)
class SearchResult:
    """What the search came to.

    Attributes:
        chain: the final model.
        steps: acceptances that still stand, in order.
        final: the last joint refit.
        screened: the last screening, for the smallest detectable sizes.
        runner_up: best candidate that was not accepted in the last round, if any.
    """

    chain: TrialModel
    steps: tuple[Step, ...]
    final: Refit
    screened: tuple[Screened, ...]
    runner_up: Candidate | None


Tell = Callable[[float, str], None]


def search(
    start: TrialModel, split: DataSplit, causes: tuple[str, ...], tell: Tell, executor: Executor | None = None
) -> SearchResult:
    """Return the causes the data carry, from a model without effects.

    Args:
        start: fitted base.
        split: records.
        causes: names to try.
        tell: progress.
        executor: runs refits side by side where given.
    """
    chain = start
    steps: list[Step] = []
    tried: set[str] = set()
    runner_up: Candidate | None = None
    final = refit(chain, split.train, n_iterations=2)
    chain = final.chain
    screened: tuple[Screened, ...] = ()
    for number in range(_MAX_ROUNDS):
        share = 0.15 + 0.8 * number / _MAX_ROUNDS
        tell(share, f"screening, {len(steps)} causes so far")
        space = tangent(chain, split.train)
        left = residuals(chain, split.train)
        wanted = tuple(name for name in causes if name not in tried)
        view = held_view(chain, split)
        screened = tuple(screen(chain, split.train, space, left, split.noise_um, wanted, view, executor))
        if len(steps) >= MAX_FINDINGS:
            break
        tell(share + 0.05, "refit of the likely causes")
        candidates = candidates_for(chain, split, space, left, screened, executor)
        accepted = next((c for c in candidates if is_accepted(c, len(causes))), None)
        if accepted is None and candidates:
            pair = _second_of_pair(chain, candidates[0], split, wanted, executor)
            if pair is not None and is_accepted(pair[1], len(causes)):
                first, second = pair
                tried.add(first.cause)
                steps.append(Step(chain, replace(first, score=second.score), (), ()))
                chain, accepted = first.fitted.chain, second
        if accepted is None:
            runner_up = candidates[0] if candidates else None
            break
        accepted = likelier(accepted, candidates, split, len(causes))
        tied = ties_of(accepted, candidates, split)
        tried.add(accepted.cause)
        rivals = rivals_of(accepted, candidates)
        if not split.is_telling:
            tied += [rival for rival in rivals if rival not in tied]
        steps.append(Step(chain, accepted, (), (), rivals).tied_with(tied))
        tell(share + 0.1, f"found {accepted.cause}, joint refit")
        final = fit_until_still(accepted.fitted.chain, split.train, executor)
        if accepted.is_bound:
            final = sought_again(final, split, accepted.cause, executor)
        chain = follow_held(final.chain, split)
        steps, chain, final = _pruned(steps, chain, final, split, executor)
        if accepted.is_bound and steps and steps[-1].accepted is accepted:
            steps[-1] = steps[-1].tied_with(still_tied(chain, tied, split))
        better = _better_rival(steps, chain, final, split, causes, executor)
        if better is not None:
            # with what was found since, another cause does better in its place: go on from there
            at, rival = better
            tell(share + 0.12, f"{rival.cause} in place of {steps[at].accepted.cause}, joint refit")
            steps = [*steps[:at], Step(steps[at].before, rival, (), ())]
            tried = {step.accepted.cause for step in steps}
            final = fit_until_still(rival.fitted.chain, split.train, executor)
            chain = follow_held(final.chain, split)
    return SearchResult(chain, tuple(steps), final, screened, runner_up)


def _better_rival(
    steps: list[Step],
    chain: TrialModel,
    final: Refit,
    split: DataSplit,
    causes: tuple[str, ...],
    executor: Executor | None,
) -> tuple[int, Candidate] | None:
    """Return the place of a finding, and the cause that does better in it beside all that was found since.

    Where a rival was found later itself, the finding may have stood in for a third cause: the rival goes first if the
    cause that is then found beside it does better than all that has been found.
    """
    for at, step in enumerate(steps[:-1]):
        name = step.accepted.cause
        for rival in step.rivals:
            if not (cause_classes()[name].is_exchangeable and cause_classes()[rival.cause].is_exchangeable):
                continue
            if not chain.has(name):
                continue
            if chain.has(rival.cause):
                second = _best_beside(rival, split, causes, executor)
                if second is None or second.cause == name:
                    continue
                start = second.fitted.chain
            else:
                effect = next(e for e in rival.fitted.chain.effects if e.name == rival.cause)
                start = chain.without(name).with_cause(effect)
            other = fit_until_still(start, split.train, executor)
            held = held_out_score(held_residuals(chain, split.held), held_residuals(other.chain, split.held))
            if sure_gain(final, other, split) > SURE and held.log_gain > _PRUNED:
                return at, rival
    return None


def _second_of_pair(
    chain: TrialModel, first: Candidate, split: DataSplit, causes: tuple[str, ...], executor: Executor | None
) -> tuple[Candidate, Candidate] | None:
    """Return a first candidate and a second one that together gain on held-out data, where one alone does not."""
    if first.train_log_gain < WORTHWHILE_LOG_GAIN or first.score.log_gain < -WORTHWHILE_LOG_GAIN:
        return None
    second = _best_beside(first, split, causes, executor)
    if second is None:
        return None
    before = held_residuals(chain, split.held)
    after = held_residuals(second.fitted.chain, split.held)
    return first, replace(second, score=held_out_score(before, after))


def _best_beside(
    first: Candidate, split: DataSplit, causes: tuple[str, ...], executor: Executor | None
) -> Candidate | None:
    """Return the candidate that gains most beside a first one."""
    base = first.fitted.chain
    space = tangent(base, split.train)
    left = residuals(base, split.train)
    wanted = tuple(name for name in causes if name != first.cause)
    screened = tuple(screen(base, split.train, space, left, split.noise_um, wanted, held_view(base, split), executor))
    return next(iter(candidates_for(base, split, space, left, screened, executor)), None)


def _pruned(
    steps: list[Step], chain: TrialModel, final: Refit, split: DataSplit, executor: Executor | None
) -> tuple[list[Step], TrialModel, Refit]:
    """Return what is left after every cause has been tested again; the last must have taught something as well."""
    for step in list(steps):
        name = step.accepted.cause
        is_last = step is steps[-1]
        if not chain.has(name):
            continue
        lesser = refit(chain.without(name), split.train, n_iterations=6, executor=executor)
        train_gain = math.log(lesser.squared_error / final.squared_error)
        score = held_out_score(held_residuals(lesser.chain, split.held), held_residuals(chain, split.held))
        is_kept = score.log_gain >= _PRUNED or (is_last and score.is_worthwhile())
        is_own = any(at is not None and cause.name == name for at, cause in chain.found())
        if not is_kept and (train_gain < _PRUNED or not (is_own or is_last)):
            steps = [s for s in steps if s is not step]
            final = fit_until_still(lesser.chain, split.train, executor)
            chain = follow_held(final.chain, split)
    errors = final.standard_errors(split.train, residual_inflation(final, split.train))
    for step in list(steps):
        name = step.accepted.cause
        ratios = []
        for p in final.free:
            if p.cause == name and p.spec.name == cause_classes()[name].main_parameter and not p.spec.is_log:
                error = errors.get((p.cause, p.index, p.spec.name), 0.0)
                ratios.append(abs(p.get(chain)) / error if error > 0.0 else math.inf)
        # where much is still unexplained its correlation widens every standard error: a sure held-out gain stands
        if ratios and max(ratios) < _LEAST_SIGMAS and step.accepted.score.log_gain < WORTHWHILE_LOG_GAIN:
            steps = [s for s in steps if s is not step]
            final = fit_until_still(chain.without(name), split.train, executor)
            chain = follow_held(final.chain, split)
    return steps, chain, final

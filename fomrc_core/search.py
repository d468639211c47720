"""The search for causes: screen, refit, accept on held-out data, re-test, stop."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.acceptance import WORTHWHILE_LOG_GAIN, held_out_score
from fomrc_core.base_fit import residuals, tangent
from fomrc_core.bench import Bench, held_residuals
from fomrc_core.chain import Chain
from fomrc_core.choice import SURE, is_accepted, likelier, residual_inflation, rivals_of, still_tied, sure_gain, ties_of
from fomrc_core.contender import Contender, contenders_for, held_view
from fomrc_core.effects import effect_classes
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.record_bound import follow_held, sought_again
from fomrc_core.refit import Refit, refit, settle
from fomrc_core.screening import Screened, screen

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
        accepted: the contender.
        tied: causes it could not be told from.
        tied_chains: the chains with those.
        rivals: contenders that did nearly as well while other causes were still unexplained.
    """

    before: Chain
    accepted: Contender
    tied: tuple[str, ...]
    tied_chains: tuple[Chain, ...]
    rivals: tuple[Contender, ...] = ()

    def tied_with(self, tied: list[Contender]) -> Step:
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
        runner_up: best contender that was not accepted in the last round, if any.
    """

    chain: Chain
    steps: tuple[Step, ...]
    final: Refit
    screened: tuple[Screened, ...]
    runner_up: Contender | None


Tell = Callable[[float, str], None]


def search(
    start: Chain, bench: Bench, causes: tuple[str, ...], tell: Tell, executor: Executor | None = None
) -> SearchResult:
    """Return the causes the data carry, from a model without effects.

    Args:
        start: fitted base.
        bench: records.
        causes: names to try.
        tell: progress.
        executor: runs refits side by side where given.
    """
    chain = start
    steps: list[Step] = []
    tried: set[str] = set()
    runner_up: Contender | None = None
    final = refit(chain, bench.train, n_iterations=2)
    chain = final.chain
    screened: tuple[Screened, ...] = ()
    for number in range(_MAX_ROUNDS):
        share = 0.15 + 0.8 * number / _MAX_ROUNDS
        tell(share, f"screening, {len(steps)} causes so far")
        space = tangent(chain, bench.train)
        left = residuals(chain, bench.train)
        wanted = tuple(name for name in causes if name not in tried)
        view = held_view(chain, bench)
        screened = tuple(screen(chain, bench.train, space, left, bench.noise_um, wanted, view, executor))
        if len(steps) >= MAX_FINDINGS:
            break
        tell(share + 0.05, "refit of the likely causes")
        contenders = contenders_for(chain, bench, space, left, screened, executor)
        accepted = next((c for c in contenders if is_accepted(c, len(causes))), None)
        if accepted is None and contenders:
            pair = _second_of_pair(chain, contenders[0], bench, wanted, executor)
            if pair is not None and is_accepted(pair[1], len(causes)):
                first, second = pair
                tried.add(first.cause)
                steps.append(Step(chain, replace(first, score=second.score), (), ()))
                chain, accepted = first.fitted.chain, second
        if accepted is None:
            runner_up = contenders[0] if contenders else None
            break
        accepted = likelier(accepted, contenders, bench, len(causes))
        tied = ties_of(accepted, contenders, bench)
        tried.add(accepted.cause)
        rivals = rivals_of(accepted, contenders)
        if not bench.is_telling:
            tied += [rival for rival in rivals if rival not in tied]
        steps.append(Step(chain, accepted, (), (), rivals).tied_with(tied))
        tell(share + 0.1, f"found {accepted.cause}, joint refit")
        final = settle(accepted.fitted.chain, bench.train, executor)
        if accepted.is_bound:
            final = sought_again(final, bench, accepted.cause, executor)
        chain = follow_held(final.chain, bench)
        steps, chain, final = _pruned(steps, chain, final, bench, executor)
        if accepted.is_bound and steps and steps[-1].accepted is accepted:
            steps[-1] = steps[-1].tied_with(still_tied(chain, tied, bench))
        better = _better_rival(steps, chain, final, bench, causes, executor)
        if better is not None:
            # with what was found since, another cause does better in its place: go on from there
            at, rival = better
            tell(share + 0.12, f"{rival.cause} in place of {steps[at].accepted.cause}, joint refit")
            steps = [*steps[:at], Step(steps[at].before, rival, (), ())]
            tried = {step.accepted.cause for step in steps}
            final = settle(rival.fitted.chain, bench.train, executor)
            chain = follow_held(final.chain, bench)
    return SearchResult(chain, tuple(steps), final, screened, runner_up)


def _better_rival(steps: list[Step], chain: Chain, final: Refit, bench: Bench,
                  causes: tuple[str, ...], executor: Executor | None) -> tuple[int, Contender] | None:  # fmt: skip
    """Return the place of a finding, and the cause that does better in it beside all that was found since.

    Where a rival was found later itself, the finding may have stood in for a third cause: the rival goes first if the
    cause that is then found beside it does better than all that has been found.
    """
    for at, step in enumerate(steps[:-1]):
        name = step.accepted.cause
        for rival in step.rivals:
            if name == AsymmetricHysteresis.name or rival.cause == AsymmetricHysteresis.name:
                continue  # its plays are columns, not an effect that can be exchanged
            if not _has(chain, name):
                continue
            if _has(chain, rival.cause):
                second = _best_beside(rival, bench, causes, executor)
                if second is None or second.cause == name:
                    continue
                start = second.fitted.chain
            else:
                effect = next(e for e in rival.fitted.chain.effects if e.name == rival.cause)
                start = chain.without(name).with_effect(effect)
            other = settle(start, bench.train, executor)
            held = held_out_score(held_residuals(chain, bench.held), held_residuals(other.chain, bench.held))
            if sure_gain(final, other, bench) > SURE and held.log_gain > _PRUNED:
                return at, rival
    return None


def _second_of_pair(chain: Chain, first: Contender, bench: Bench, causes: tuple[str, ...],
                    executor: Executor | None) -> tuple[Contender, Contender] | None:  # fmt: skip
    """Return a first contender and a second one that together gain on held-out data, where one alone does not."""
    if first.train_log_gain < WORTHWHILE_LOG_GAIN or first.score.log_gain < -WORTHWHILE_LOG_GAIN:
        return None
    second = _best_beside(first, bench, causes, executor)
    if second is None:
        return None
    before = held_residuals(chain, bench.held)
    after = held_residuals(second.fitted.chain, bench.held)
    return first, replace(second, score=held_out_score(before, after))


def _best_beside(
    first: Contender, bench: Bench, causes: tuple[str, ...], executor: Executor | None
) -> Contender | None:
    """Return the contender that gains most beside a first one."""
    base = first.fitted.chain
    space = tangent(base, bench.train)
    left = residuals(base, bench.train)
    wanted = tuple(name for name in causes if name != first.cause)
    screened = tuple(screen(base, bench.train, space, left, bench.noise_um, wanted, held_view(base, bench), executor))
    return next(iter(contenders_for(base, bench, space, left, screened, executor)), None)


def _pruned(steps: list[Step], chain: Chain, final: Refit, bench: Bench,
            executor: Executor | None) -> tuple[list[Step], Chain, Refit]:  # fmt: skip
    """Return what is left after every cause has been tested again; the last must have taught something as well."""
    for step in list(steps):
        name = step.accepted.cause
        is_last = step is steps[-1]
        if not _has(chain, name):
            continue
        lesser = refit(chain.without(name), bench.train, n_iterations=6, executor=executor)
        train_gain = math.log(lesser.squared_error / final.squared_error)
        score = held_out_score(held_residuals(lesser.chain, bench.held), held_residuals(chain, bench.held))
        is_kept = score.log_gain >= _PRUNED or (is_last and score.is_worthwhile())
        is_own = any(e.name == name for own in chain.record_effects for e in own)
        if not is_kept and (train_gain < _PRUNED or not (is_own or is_last)):
            steps = [s for s in steps if s is not step]
            final = settle(lesser.chain, bench.train, executor)
            chain = follow_held(final.chain, bench)
    errors = final.standard_errors(bench.train, residual_inflation(final, bench.train))
    for step in list(steps):
        name = step.accepted.cause
        ratios = []
        for p in final.free:
            if p.effect_name == name and p.spec.name == effect_classes()[name].main_parameter and not p.spec.is_log:
                error = errors.get((p.effect_name, p.index, p.spec.name), 0.0)
                ratios.append(abs(p.get(chain)) / error if error > 0.0 else math.inf)
        # where much is still unexplained its correlation widens every standard error: a sure held-out gain stands
        if ratios and max(ratios) < _LEAST_SIGMAS and step.accepted.score.log_gain < WORTHWHILE_LOG_GAIN:
            steps = [s for s in steps if s is not step]
            final = settle(chain.without(name), bench.train, executor)
            chain = follow_held(final.chain, bench)
    return steps, chain, final


def _has(chain: Chain, name: str) -> bool:
    if name == AsymmetricHysteresis.name:
        return chain.has_knees
    return any(e.name == name for e in chain.effects) or any(
        e.name == name for own in chain.record_effects for e in own
    )

"""The search for causes: screen, refit, accept on held-out data, re-test, stop."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.acceptance import WORTHWHILE_LOG_GAIN, HeldOutScore, held_out_score, loses_to
from fomrc_core.base_fit import Tangent, rebased, residuals, squared_error, tangent
from fomrc_core.bench import Bench, HeldOut, held_blocks, held_residuals, learned_blocks, starts_unsure, with_own
from fomrc_core.chain import Chain, PreparedRecord
from fomrc_core.effects import Effect, effect_classes
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.initial_state import InitialState
from fomrc_core.noise import autocorrelation_inflation
from fomrc_core.refit import FreeParameter, Refit, free_parameters, refit, scan
from fomrc_core.screening import HeldView, Screened, family_columns, is_bound, screen

Array = NDArray[np.float64]

MAX_FINDINGS = 5
_MAX_CONTENDERS = 5
_MIN_SCREENED = 25.0  # explained sum of squares over noise variance and correlation
_CLOSE_TO_BEST = 0.2
_SIGNIFICANCE = 0.01
_TIE = 10.0
_TIE_P_VALUE = 0.05
_SURE = 3.0
_TRAINING_COUNTS = 0.3
_MAX_STARTS = 12
_PRUNED = 0.03


@dataclass(frozen=True, eq=False)
class Contender:
    """A candidate after its joint refit.

    Attributes:
        cause: its name.
        fitted: the joint refit.
        score: on held-out data.
        train_log_gain: logarithm of the ratio of mean squared errors on the training data.
        held: residuals on the held-out data [um].
        n_free: number of parameters it adds.
    """

    cause: str
    fitted: Refit
    score: HeldOutScore
    train_log_gain: float
    held: tuple[Array, ...]
    n_free: int

    @property
    def total_gain(self) -> float:
        """Held-out gain first, for a rich cause fits anything in training; training gain beside it, for with two
        effects hidden neither alone need help held-out data."""
        return max(self.score.log_gain, -0.5) + _TRAINING_COUNTS * self.train_log_gain


@dataclass(frozen=True, eq=False)
class Step:
    """One acceptance: the chain before and after, the contender, and those it could not be told from."""

    before: Chain
    accepted: Contender
    tied: tuple[str, ...]
    tied_chains: tuple[Chain, ...]


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


def search(start: Chain, bench: Bench, causes: tuple[str, ...], tell: Tell, executor: Executor | None = None) -> SearchResult:
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
    for number in range(MAX_FINDINGS + 1):
        share = 0.15 + 0.8 * number / (MAX_FINDINGS + 1)
        tell(share, f"screening, {number} causes so far")
        space = tangent(chain, bench.train)
        left = residuals(chain, bench.train)
        wanted = tuple(name for name in causes if name not in tried)
        screened = tuple(screen(chain, bench.train, space, left, bench.noise_um, wanted, _held_view(chain, bench)))
        if number == MAX_FINDINGS:
            break
        tell(share + 0.05, "refit of the likely causes")
        contenders = _contenders(chain, bench, space, left, screened, executor)
        accepted = next((c for c in contenders if _is_accepted(c, len(causes))), None)
        if accepted is None and contenders:
            pair = _second_of_pair(chain, contenders[0], bench, wanted, executor)
            if pair is not None and _is_accepted(pair[1], len(causes)):
                first, second = pair
                tried.add(first.cause)
                steps.append(Step(chain, replace(first, score=second.score), (), ()))
                chain, accepted = first.fitted.chain, second
        if accepted is None:
            runner_up = contenders[0] if contenders else None
            break
        tied = _tied(accepted, contenders, bench)
        tried.add(accepted.cause)
        steps.append(Step(chain, accepted, tuple(c.cause for c in tied), tuple(c.fitted.chain for c in tied)))
        tell(share + 0.1, f"found {accepted.cause}, joint refit")
        final = settle(accepted.fitted.chain, bench)
        chain = follow_held(final.chain, bench)
        steps, chain, final = _pruned(steps, chain, final, bench)
    return SearchResult(chain, tuple(steps), final, screened, runner_up)


def settle(chain: Chain, bench: Bench) -> Refit:
    """Return the joint refit with fresh directions, until it moves no more."""
    fitted = refit(rebased(chain, bench.train), bench.train)
    return refit(rebased(fitted.chain, bench.train), bench.train, n_iterations=8)


def _is_accepted(contender: Contender, n_causes: int) -> bool:
    return contender.score.p_value < _SIGNIFICANCE / n_causes and contender.score.is_worthwhile()


def _contenders(chain: Chain, bench: Bench, space: Tangent, left: tuple[Array, ...], screened: tuple[Screened, ...],
                executor: Executor | None) -> list[Contender]:  # fmt: skip
    error = squared_error(bench.train, left)
    inflation = max(autocorrelation_inflation(v[r.is_used]) for v, r in zip(left, bench.train, strict=True))
    variance = error / bench.n_used
    limit = _MIN_SCREENED * variance * min(inflation, 200.0)
    by_cause: dict[str, list[Screened]] = {}
    for trial in screened:
        if max(trial.explained, trial.explained_held) > limit:
            by_cause.setdefault(trial.cause, []).append(trial)
    if not by_cause:
        return []
    likely = _likely({name: trials[0].explained for name, trials in by_cause.items()})
    held = {name: max(t.explained_held for t in trials) for name, trials in by_cause.items()}
    likely += [name for name in _likely(held) if name not in likely]
    for name in likely:
        # what the base absorbs in training is told apart on the held-out record
        by_cause[name].sort(key=lambda t: -(t.explained / error + t.explained_held / max(held.values(), default=1.0)
                                            if max(held.values()) > 0.0 else t.explained))  # fmt: skip
    tasks = [(chain, bench, space, by_cause[name], error) for name in likely]
    run = map if executor is None else executor.map
    found = [c for c in run(_fit_contender, tasks) if c is not None]
    return sorted(found, key=lambda c: -c.total_gain)


def _likely(explained: dict[str, float]) -> list[str]:
    best = max(explained.values())
    names = [name for name, value in explained.items() if value > _CLOSE_TO_BEST * best and value > 0.0]
    return sorted(names, key=lambda name: -explained[name])[:_MAX_CONTENDERS]


def _held_view(chain: Chain, bench: Bench) -> HeldView | None:
    own = [part for part in bench.held if part.index >= len(bench.train)]
    return HeldView.of(chain, own[0].record, own[0].index) if own else None


def _fit_contender(task: tuple[Chain, Bench, Tangent, list[Screened], float]) -> Contender | None:
    chain, bench, space, trials, error = task
    cause = trials[0].cause
    kind = effect_classes()[cause]
    bound = is_bound(kind, bench.train)
    fits = []
    for variant, directions in _variants(chain, bench, space):
        starts = _starts(variant, trials, bound, bench, directions)
        if kind.is_scanned:
            starts = [_scanned(start, bench, directions, trial) for start, trial in zip(starts, trials, strict=False)]
        for start in starts:
            # a family of columns and a large effect turn the directions of the linear part: take them anew
            is_new = start.weights.size != chain.weights.size or _clear_error(start, bench, directions) > 2.0 * error
            fits.append(refit(start, bench.train, None if is_new else directions, n_iterations=8))
    if not fits:
        return None
    best = min(fits, key=lambda f: f.squared_error)
    if best.squared_error < 0.5 * error or not best.is_converged:
        again = refit(rebased(best.chain, bench.train), bench.train, n_iterations=8)
        best = again if again.squared_error < best.squared_error else best
    before, after, fitted = _held_pair(chain, best, bench, cause, bound)
    n_free = len(free_parameters(fitted.chain)) - len(free_parameters(chain))
    return Contender(cause, fitted, held_out_score(before, after), math.log(error / fitted.squared_error), tuple(after), n_free)


def _clear_error(start: Chain, bench: Bench, space: Tangent) -> float:
    """Return the squared error of a start once its linear part has followed [um^2]."""
    return squared_error(bench.train, space.remove(bench.train, residuals(start, bench.train)))


def _starts(chain: Chain, trials: list[Screened], bound: bool, bench: Bench, space: Tangent) -> list[Chain]:
    if isinstance(trials[0].effect, AsymmetricHysteresis):
        columns = family_columns(chain, trials[0].effect)
        added = columns.thresholds_v.size - chain.weights.size
        return [replace(chain, columns=columns, weights=np.concatenate((chain.weights, np.zeros(added))))]
    if bound:
        joined = chain
        seen: set[int] = set()
        for trial in trials:
            assert trial.index is not None
            if trial.index not in seen:
                joined = joined.with_effect(_sized(trial), trial.index)
                seen.add(trial.index)
        return [joined]
    if type(trials[0].effect).is_scanned:
        return [chain.with_effect(trial.effect) for trial in trials[:2]]
    # A signature is the effect's slope; how well an instance of full size does only its simulation tells.
    options = [chain.with_effect(_sized(trial)) for trial in trials[:_MAX_STARTS]]
    return sorted(options, key=lambda option: _clear_error(option, bench, space))[:2]


def _scanned(start: Chain, bench: Bench, space: Tangent, trial: Screened) -> Chain:
    spec = next(p for p in trial.effect.parameters if p.name == trial.effect.main_parameter)
    return scan(start, bench.train, space, FreeParameter(trial.cause, trial.index, spec, 1.0))


def _sized(trial: Screened) -> Effect:
    effect = trial.effect
    changes = {}
    for name in effect.linear_parameters:
        value = getattr(effect, name)
        if isinstance(value, float) and value != 0.0:
            spec = next(s for s in effect.parameters if s.name == name)
            changes[name] = min(max(value * trial.amplitude, spec.lower), spec.upper)
    return replace(effect, **changes) if changes else effect


def _variants(chain: Chain, bench: Bench, space: Tangent) -> list[tuple[Chain, Tangent]]:
    """Return the chain, and the chain with the other assumption on how records of unsure start begin."""
    unsure = [i for i, r in enumerate(bench.train) if starts_unsure(r)]
    flipped = chain
    for i in unsure:
        own = flipped.record_effects[i]
        if any(isinstance(e, InitialState) and e.free_names() for e in own):
            return [(chain, space)]
        others = tuple(e for e in own if not isinstance(e, InitialState))
        flipped = with_own(flipped, i, others if len(others) < len(own) else (*others, bench.train[i].at_rest()))
    return [(chain, space)] + ([(flipped, tangent(flipped, bench.train))] if unsure else [])


def _held_pair(chain: Chain, fitted: Refit, bench: Bench, cause: str, bound: bool) -> tuple[list[Array], list[Array], Refit]:
    if not bound:
        return held_residuals(chain, bench.held), held_residuals(fitted.chain, bench.held), fitted
    # An effect of one record cannot be held out by another record: hold out blocks of the same one.
    indices = [i for i, own in enumerate(fitted.chain.record_effects[: len(bench.train)])
               if any(e.name == cause for e in own)]  # fmt: skip
    learned = tuple(r.using(r.is_used & learned_blocks(r)) for r in bench.train)
    blocked = refit(fitted.chain, learned, n_iterations=4)
    base = refit(chain, learned, n_iterations=2)
    scored = tuple(HeldOut(bench.train[i].using(held_blocks(bench.train[i])), i) for i in indices)
    return held_residuals(base.chain, scored), held_residuals(blocked.chain, scored), fitted


def follow_held(chain: Chain, bench: Bench) -> Chain:
    """Return the chain with the effects of single records fitted to the held-out records too, on half their blocks.

    The actuator's own parameters stay; phase of a hum or time of a load must be that of the record.
    """
    kinds = {e.name for own in chain.record_effects[: len(bench.train)] for e in own
             if not (isinstance(e, InitialState) and not e.free_names())}  # fmt: skip
    if not kinds:
        return chain
    for part in {h.index: h for h in (*bench.held, *bench.report)}.values():
        if part.index < len(bench.train):
            continue
        one = part.record.using(part.record.is_used & learned_blocks(part.record))
        chain = fit_one_record(chain, one, part.index, kinds)
    return chain


def fit_one_record(chain: Chain, record: PreparedRecord, index: int, kinds: set[str]) -> Chain:
    """Return the chain with the record-bound effects of these kinds fitted to one record, all else held."""
    alone = replace(chain, record_effects=(chain.record_effects[index],))
    still = tangent(alone, (record,))
    frozen = Tangent(tuple(np.zeros((c.shape[0], 1)) for c in still.columns), np.zeros((1, 1)))
    for name in sorted(kinds):
        left = residuals(alone, (record,))
        trials = [s for s in screen(alone, (record,), frozen, left, 0.0, (name,)) if s.explained > 0.0]
        if not trials:
            continue
        trial = alone.with_effect(_sized(trials[0]), 0)
        free = tuple(p for p in free_parameters(trial) if p.index == 0)
        fitted = _refit_own(trial, record, free)
        if squared_error((record,), residuals(fitted, (record,))) < squared_error((record,), left):
            alone = fitted
    own = list(chain.record_effects)
    own[index] = alone.record_effects[0]
    return replace(chain, record_effects=tuple(own))


def _refit_own(chain: Chain, record: PreparedRecord, free: tuple[FreeParameter, ...]) -> Chain:
    n = record.time_s.size
    nothing = Tangent((np.zeros((n, chain.weights.size + 1)),), np.zeros((chain.weights.size + 1, 1)))
    return refit(chain, (record,), nothing, n_iterations=8, free=free).chain


def _tied(winner: Contender, contenders: list[Contender], bench: Bench) -> list[Contender]:
    inflation = max(autocorrelation_inflation(v[r.is_used]) for v, r in zip(winner.fitted.residual, bench.train, strict=True))
    n_effective = bench.n_used / inflation
    tied = []
    for other in contenders:
        if other is winner:
            continue
        loss = n_effective * math.log(other.fitted.squared_error / winner.fitted.squared_error)
        same_shape = len(other.held) == len(winner.held) and all(
            a.size == b.size for a, b in zip(other.held, winner.held, strict=True)
        )
        if loss < _TIE and (not same_shape or loses_to(list(winner.held), list(other.held)) > _TIE_P_VALUE):
            tied.append(other)
    return tied


def _second_of_pair(chain: Chain, first: Contender, bench: Bench, causes: tuple[str, ...],
                    executor: Executor | None) -> tuple[Contender, Contender] | None:  # fmt: skip
    """Return a first contender and a second one that together gain on held-out data, where one alone does not."""
    if first.train_log_gain < WORTHWHILE_LOG_GAIN or first.score.log_gain < -WORTHWHILE_LOG_GAIN:
        return None
    base = first.fitted.chain
    space = tangent(base, bench.train)
    left = residuals(base, bench.train)
    wanted = tuple(name for name in causes if name != first.cause)
    screened = tuple(screen(base, bench.train, space, left, bench.noise_um, wanted, _held_view(base, bench)))
    seconds = _contenders(base, bench, space, left, screened, executor)
    if not seconds:
        return None
    second = seconds[0]
    before = held_residuals(chain, bench.held)
    after = held_residuals(second.fitted.chain, bench.held)
    return first, replace(second, score=held_out_score(before, after))


def _pruned(steps: list[Step], chain: Chain, final: Refit, bench: Bench) -> tuple[list[Step], Chain, Refit]:
    """Return what is left after every earlier cause has been tested again."""
    for step in list(steps[:-1]):
        name = step.accepted.cause
        if not _has(chain, name):
            continue
        lesser = refit(chain.without(name), bench.train, n_iterations=6)
        train_gain = math.log(lesser.squared_error / final.squared_error)
        held_gain = held_out_score(held_residuals(lesser.chain, bench.held), held_residuals(chain, bench.held)).log_gain
        is_own = any(e.name == name for own in chain.record_effects for e in own)
        if held_gain < _PRUNED and (train_gain < _PRUNED or not is_own):
            steps = [s for s in steps if s is not step]
            final = settle(lesser.chain, bench)
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
        if ratios and max(ratios) < _SURE and step.accepted.score.log_gain < WORTHWHILE_LOG_GAIN:
            steps = [s for s in steps if s is not step]
            final = settle(chain.without(name), bench)
            chain = follow_held(final.chain, bench)
    return steps, chain, final


def residual_inflation(final: Refit, records: tuple[PreparedRecord, ...]) -> float:
    """Return by how much correlation of what is left widens standard errors."""
    return max(autocorrelation_inflation(v[r.is_used]) for v, r in zip(final.residual, records, strict=True))


def _has(chain: Chain, name: str) -> bool:
    if name == AsymmetricHysteresis.name:
        return chain.has_knees
    return any(e.name == name for e in chain.effects) or any(e.name == name for own in chain.record_effects for e in own)

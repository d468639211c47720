"""A candidate cause: fitted together with the base, from several starts, and scored on held-out data."""

from __future__ import annotations

import math
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.acceptance import HeldOutScore, held_out_score
from fomrc_core.base_fit import Tangent, rebased, residuals, squared_error, tangent
from fomrc_core.bench import Bench, HeldOut, held_blocks, held_residuals, learned_blocks, starts_unsure, with_own
from fomrc_core.chain import Chain, predict
from fomrc_core.effects import Effect, effect_classes
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.initial_state import InitialState
from fomrc_core.noise import autocorrelation_inflation
from fomrc_core.past_search import with_searched_past
from fomrc_core.refit import FreeParameter, Refit, free_parameters, refit, scan
from fomrc_core.screening import HeldView, Screened, family_columns

Array = NDArray[np.float64]

_MAX_CONTENDERS = 5
_MIN_SCREENED = 25.0  # explained sum of squares over noise variance and correlation
_LEAST_SHARE = 0.005  # of the squared error: what explains less is no finding, however sure
_CLOSE_TO_BEST = 0.2
_TRAINING_COUNTS = 0.3
_MAX_STARTS = 12
_RICH_PENALTY = 1.02
_HOPELESS = 4.0  # times the least squared error so far


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
        is_plausible: whether the records can show it with the parameters found.
        is_bound: whether its parameters belong to single records.
        is_told: whether the records can tell it from others: one-sided plays bend to any lag in a loop that repeats.
    """

    cause: str
    fitted: Refit
    score: HeldOutScore
    train_log_gain: float
    held: tuple[Array, ...]
    n_free: int
    is_plausible: bool = True
    is_bound: bool = False
    is_told: bool = True

    @property
    def total_gain(self) -> float:
        """Held-out gain first, for a rich cause fits anything in training; training gain beside it, for with two
        effects hidden neither alone need help held-out data."""
        # Blocks of the same record are an easier test than another record: there training is asked as well.
        held = min(self.score.log_gain, self.train_log_gain) if self.is_bound else self.score.log_gain
        return max(held, -0.5) + _TRAINING_COUNTS * self.train_log_gain


def contenders_for(chain: Chain, bench: Bench, space: Tangent, left: tuple[Array, ...], screened: tuple[Screened, ...],
                executor: Executor | None) -> list[Contender]:  # fmt: skip
    """Return the likely causes after their joint refits, the most gaining first.

    Args:
        chain: the present model.
        bench: records.
        space: tangent of its linear part.
        left: residual per training record [um].
        screened: the screening's trial instances.
        executor: runs refits side by side where given.
    """
    error = squared_error(bench.train, left)
    inflation = max(autocorrelation_inflation(v[r.is_used]) for v, r in zip(left, bench.train, strict=True))
    variance = error / bench.n_used
    limit = _MIN_SCREENED * variance * min(inflation, 200.0)
    view = [np.dot(v, v) for v in held_residuals(chain, bench.held)]
    held_limit = max(limit, _LEAST_SHARE * float(sum(view)))
    limit = max(limit, _LEAST_SHARE * error)
    by_cause: dict[str, list[Screened]] = {}
    for trial in screened:
        if trial.explained > limit or trial.explained_held > held_limit:
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
    # a scan takes longest: begun last it would be waited for
    likely.sort(key=lambda name: not effect_classes()[name].is_scanned)
    tasks = [(chain, bench, space, by_cause[name], error) for name in likely]
    run = map if executor is None else executor.map
    found = [c for c in run(_fit_contender, tasks) if c is not None]
    return sorted(found, key=lambda c: -c.total_gain)


def _likely(explained: dict[str, float]) -> list[str]:
    best = max(explained.values())
    names = [name for name, value in explained.items() if value > _CLOSE_TO_BEST * best and value > 0.0]
    return sorted(names, key=lambda name: -explained[name])[:_MAX_CONTENDERS]


def held_view(chain: Chain, bench: Bench) -> HeldView | None:
    """Return the held-out record under the chain; None where blocks of the training records are held out."""
    own = [part for part in bench.held if part.index >= len(bench.train)]
    return HeldView.of(chain, own[0].record, own[0].index) if own else None


def _fit_contender(task: tuple[Chain, Bench, Tangent, list[Screened], float]) -> Contender | None:
    chain, bench, space, trials, error = task
    cause = trials[0].cause
    kind = effect_classes()[cause]
    bound = trials[0].effect.belongs_to_record()
    trials = [trial for trial in trials if trial.effect.belongs_to_record() == bound]
    fits: list[Refit] = []
    for variant, directions in _variants(chain, bench, space):
        starts = _starts(variant, trials, bound, bench, directions)
        if kind.is_scanned:
            starts = [_scanned(start, bench, directions, trial) for start, trial in zip(starts, trials, strict=False)]
        for start in starts:
            # a family of columns and a large effect turn the directions of the linear part: take them anew
            is_new = start.weights.size != chain.weights.size or _clear_error(start, bench, directions) > 2.0 * error
            least = min([error, *(f.squared_error for f in fits)])
            fits.append(refit(start, bench.train, None if is_new else directions, n_iterations=8,
                              hopeless_um2=_HOPELESS * least))  # fmt: skip
    if not fits or min(f.squared_error for f in fits) > _HOPELESS * error:
        return None
    # as many more weights must earn their keep
    best = min(fits, key=lambda f: f.squared_error * (_RICH_PENALTY if f.chain.has_knees > chain.has_knees else 1.0))
    if best.squared_error < 0.5 * error or not best.is_converged:
        again = refit(rebased(best.chain, bench.train), bench.train, n_iterations=8)
        best = again if again.squared_error < best.squared_error else best
    before, after, fitted = _held_pair(chain, best, bench, cause, bound)
    n_free = len(free_parameters(fitted.chain)) - len(free_parameters(chain))
    longest = max(float(record.time_s[-1]) for record in bench.train)
    own = [e for part in fitted.chain.record_effects[: len(bench.train)] for e in part]
    is_plausible = all(e.is_plausible(longest) for e in (*fitted.chain.effects, *own))
    is_plausible = is_plausible and (not bound or _is_confirmed(fitted, bench, cause))
    train_gain = math.log(error / fitted.squared_error)
    score = held_out_score(before, after)
    is_told = kind is not AsymmetricHysteresis or bench.is_telling
    return Contender(cause, fitted, score, train_gain, tuple(after), n_free, is_plausible, bound, is_told)


def _is_confirmed(fitted: Refit, bench: Bench, cause: str) -> bool:
    """Return whether some record shows what the effect must show there."""
    without = fitted.chain.without(cause)
    for index, record in enumerate(bench.train):
        effect = next((e for e in fitted.chain.record_effects[index] if e.name == cause), None)
        if effect is None:
            continue
        left = record.measured_um - predict(without, record, index)
        if effect.is_confirmed(record.time_s, left):
            return True
    return False


def _clear_error(start: Chain, bench: Bench, space: Tangent) -> float:
    """Return the squared error of a start once its linear part has followed [um^2]."""
    return squared_error(bench.train, space.remove(bench.train, residuals(start, bench.train)))


def _starts(chain: Chain, trials: list[Screened], bound: bool, bench: Bench, space: Tangent) -> list[Chain]:
    if isinstance(trials[0].effect, AsymmetricHysteresis):
        return _asymmetric_starts(chain, trials)
    if bound:
        joined = chain
        for index in sorted({trial.index for trial in trials if trial.index is not None}):
            here = [t.effect for t in trials if t.index == index]
            pasts = [effect for effect in here if isinstance(effect, InitialState)]
            if pasts:
                joined = with_searched_past(joined, index, pasts, lambda c: _clear_error(c, bench, space))
                continue
            own = [t for t in trials if t.index == index][:_MAX_STARTS]
            plain = space.remove(bench.train, residuals(joined, bench.train))
            joined = min((_resized(joined, t, plain, bench, space) for t in own), key=lambda option: option[0])[1]
        return [joined]
    if type(trials[0].effect).is_scanned:
        return [chain.with_effect(trial.effect) for trial in trials[:2]]
    # A signature is the effect's slope; how well an instance of full size does only its simulation tells.
    options = [chain.with_effect(sized(trial)) for trial in trials[:_MAX_STARTS]]
    best = sorted(options[1:], key=lambda option: _clear_error(option, bench, space))[:2]
    return [options[0], *best]


def _resized(
    chain: Chain, trial: Screened, plain: tuple[Array, ...], bench: Bench, space: Tangent
) -> tuple[float, Chain]:
    """Return the error of a trial of one record beside what was joined before it, sized to that, and the chain."""
    option = chain.with_effect(sized(trial), trial.index)
    left = space.remove(bench.train, residuals(option, bench.train))
    gain = power = 0.0
    for record, before, after in zip(bench.train, plain, left, strict=True):
        signature = (before - after)[record.is_used]
        gain += float(np.dot(before[record.is_used], signature))
        power += float(np.dot(signature, signature))
    error = squared_error(bench.train, left)
    if not power > 0.0 or not gain > 0.0:
        return error, option
    again = replace(trial, amplitude=trial.amplitude * gain / power)
    return squared_error(bench.train, plain) - gain**2 / power, chain.with_effect(sized(again), trial.index)


def _asymmetric_starts(chain: Chain, trials: list[Screened]) -> list[Chain]:
    """Return a warp of the drive alone, and the whole family of one-sided plays with a warp."""
    warped = chain.with_effect(AsymmetricHysteresis(warp_per_v=1e-9, warp_per_v2=1e-9))
    family = next(
        (t.effect for t in trials if isinstance(t.effect, AsymmetricHysteresis) and t.effect.thresholds_v), None
    )
    if family is None:
        return [warped]
    assert isinstance(family, AsymmetricHysteresis)
    columns = family_columns(chain, family)
    added = columns.thresholds_v.size - chain.weights.size
    full = replace(warped, columns=columns, weights=np.concatenate((chain.weights, np.zeros(added))))
    return [warped, full]


def _scanned(start: Chain, bench: Bench, space: Tangent, trial: Screened) -> Chain:
    spec = next(p for p in trial.effect.parameters if p.name == trial.effect.main_parameter)
    return scan(start, bench.train, space, FreeParameter(trial.cause, trial.index, spec, 1.0))


def sized(trial: Screened) -> Effect:
    """Return the instance with its linear parameters scaled as the screening found."""
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


def _held_pair(
    chain: Chain, fitted: Refit, bench: Bench, cause: str, bound: bool
) -> tuple[list[Array], list[Array], Refit]:
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

"""Effects of the library that the model has not had, as what a change may have brought."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.watch.hypothesis import HOPELESS, REFINE_TOLERANCE, Hypothesis, moments, sharpened
from fomrc_core.diagnosis.watch.window import Window
from fomrc_core.effects import Effect, Stage
from fomrc_core.effects.base.evidence import Evidence, RecordEvidence
from fomrc_core.errors import ParameterError
from fomrc_core.model.causes import cause_classes

# Squared error, effect and change of displacement of an effect that was tried.
Trial = tuple[float, Effect, Array]
# So many of those that fit best have their parameters refined, by about a factor of two to either side.
_N_REFINED, _REFINED_BY = 6, 0.7


def additions(window: Window, since_s: float) -> Iterator[Hypothesis]:
    """Yield the best trial of each effect of the library that the model has not, those that fit best refined.

    Args:
        window: the recent past under the model in force.
        since_s: when the change is thought to have begun, from the start of the window [s].
    """
    own = {effect.name for effect in window.model.effects}
    at = window.index(since_s)
    found = []
    for kind in cause_classes().values():
        if not issubclass(kind, Effect) or kind.name in own or kind.covariate is not None or kind.replaces_creep:
            continue
        if kind.owns_columns or kind.stage is Stage.HYSTERESIS:
            continue  # what the elements do is the model's to question, by an identification
        # What has its own moments is tried on the whole window, too; what begins with the change, from there.
        starts = (at, 0) if kind.is_record_bound else (at,)
        trials = [(*trial, first) for first in starts if (trial := _best_trial(window, kind, first)) is not None]
        if trials:
            found.append(min(trials, key=lambda entry: entry[0]))
    found.sort(key=lambda entry: entry[0])
    others = [window.index(moment) for moment in moments(window, since_s)[::2]]
    for k, (error, effect, change_um, first) in enumerate(found):
        if k < _N_REFINED:
            trial = error, effect, change_um
            for other in others if first > 0 else ():
                moved = _sized(window, effect, other)
                if moved is not None and moved[0] < trial[0]:
                    trial, first = moved, other
            first = _moment_of(window, trial[1], first) if first > 0 else 0
            _, effect, change_um = _refined(window, _sized(window, effect, first) or trial, first)
        is_kept = effect.can_invert and not effect.is_record_bound
        values = {name: value for name, value in effect.to_mapping().items() if isinstance(value, float)}
        # The moment is fitted as well, where it begins with the change.
        n_parameters = max(len(effect.free_names()), 1) + len(effect.held_parameters) + (first > 0)
        model = window.model.with_effects(effect) if is_kept else None
        began_s = float(window.time_s[first]) if first else since_s
        yield Hypothesis(effect.name, values, n_parameters, change_um, model, began_s, is_addition=True)


def _moment_of(window: Window, effect: Effect, first: int) -> int:
    """Return the sample, near the best that was tried, at which an effect that begins there fits best."""

    def error(moment_s: float) -> float:
        sized = _sized(window, effect, window.index(moment_s))
        return np.inf if sized is None else sized[0]

    return window.index(sharpened(window, float(window.time_s[first]), error))


def _best_trial(window: Window, kind: type[Effect], first: int) -> Trial | None:
    part = slice(first, None)
    record = RecordEvidence(
        window.time_s[part] - window.time_s[first],
        window.steps_s[part],
        window.voltage_v[part],
        window.predicted_um[part],
        window.residual_um[part] - float(np.mean(window.residual_um[part])),
    )
    best: Trial | None = None
    for effect in kind.screening(Evidence((record,), window.small_um)):
        sized = _sized(window, effect, first)
        if sized is not None and (best is None or sized[0] < best[0]):
            best = sized
    return best


def _refined(window: Window, trial: Trial, first: int) -> Trial:
    """Return a trial with each of its free parameters moved, one after the other, to where it fits best."""
    for name in trial[1].free_names():
        if isinstance(getattr(trial[1], name), float):
            trial = _moved(window, trial, first, name)
    return trial


def _moved(window: Window, trial: Trial, first: int, name: str) -> Trial:
    effect = trial[1]
    value = getattr(effect, name)
    unit, is_log = effect.scale_of(name, value), effect.parameter(name).is_log
    tried = [trial]

    def error(x: float) -> float:
        try:
            other = replace(effect, **{name: value * float(np.exp(x)) if is_log else value + unit * x})
            found = _sized(window, other, first, keeps_size=True)
        except ParameterError:
            found = None
        if found is None:
            return HOPELESS * window.worst_um2
        tried.append(found)
        return found[0]

    minimize_scalar(error, bounds=(-_REFINED_BY, _REFINED_BY), method="bounded", options={"xatol": REFINE_TOLERANCE})
    return min(tried, key=lambda entry: entry[0])


def _sized(window: Window, effect: Effect, first: int, *, keeps_size: bool = False) -> Trial | None:
    """Return error, effect and change of a trial, its size fitted where it is linear in one and may change."""
    state = window.state_at(first)
    try:
        model = window.model.with_effects(effect)
        state.effects[effect.name] = effect.initial_state()
        moved = model.simulate(window.steps_s[first:], window.voltage_v[first:], state)
    except ParameterError:
        return None
    shape = np.zeros(window.time_s.size)
    shape[first:] = moved - window.predicted_um[first:]
    if not np.all(np.isfinite(shape)):
        return None
    linear = [name for name in effect.linear_parameters if isinstance(getattr(effect, name), float)]
    if linear and not keeps_size:
        size = window.amplitude(shape)
        if size < 0.0 and not effect.takes_either_sign():
            return None
        try:
            effect = replace(effect, **{name: getattr(effect, name) * size for name in linear})
        except ParameterError:
            return None
        shape = size * shape
    if not effect.is_plausible(window.duration_s, window.period_s):
        return None  # a repair is no cause: a relaxation that takes away within some samples is another scale
    return window.squared_error(shape), effect, shape

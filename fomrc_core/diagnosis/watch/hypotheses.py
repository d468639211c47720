"""What may have changed: each hypothesis says how displacement would differ from the model's, from a moment on.

A number of the model (its gain, its creep order, a parameter of an effect it has), or an effect of the library that it
has not. The stage is taken to have been the model until then: each is run on from the model's own state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.watch.additions import additions
from fomrc_core.diagnosis.watch.hypothesis import HOPELESS, REFINE_TOLERANCE, Hypothesis, moments, sharpened
from fomrc_core.diagnosis.watch.loose_contact import lost_samples
from fomrc_core.diagnosis.watch.window import Window
from fomrc_core.effects import Effect
from fomrc_core.errors import ParameterError
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.prehistory import Prehistory

SENSOR_SCALE, AGEING, CREEP, LOOSE_CONTACT = "sensor_scale", "gain_ageing", "creep_order", "loose_contact"
MEANINGS: Mapping[str, str] = {
    SENSOR_SCALE: "All displacements are larger or smaller, from one moment on: the sensor's scale, or a sudden gain.",
    AGEING: "The stroke changes gradually: the ceramic ages, loses its polarisation or warms.",
    CREEP: "Whatever moves creeps more or less than it did.",
    LOOSE_CONTACT: "The reading jumps away for moments: a contact of the sensor or the drive is loose.",
}
# Trials of a changed parameter, as factors of its value; the best is refined between its neighbours. What rings fits
# within a few per cent of its frequency only.
_FACTORS = np.concatenate((np.geomspace(0.04, 0.28, 6), np.geomspace(0.3, 0.96, 19), np.geomspace(1.04, 5.0, 22)))
_ORDER_CHANGE = 1e-3
# Ageing is over within so long, or goes on.
_AGEING_S = (5.0, 10.0, 20.0, 40.0, 1e9)
_LONG_S, _MOMENT_S = 1000.0, 0.5


def hypotheses(window: Window, since_s: float) -> Iterator[Hypothesis]:
    """Yield every hypothesis, fitted to the window.

    Args:
        window: the recent past under the model in force.
        since_s: when the change is thought to have begun, from the start of the window [s].
    """
    yield _gain(window, since_s, SENSOR_SCALE, (0.0,))
    yield _gain(window, since_s, AGEING, _AGEING_S)
    yield from _creep(window, since_s)
    yield from _own_parameters(window, since_s)
    yield from additions(window, since_s)
    lost = lost_samples(window.residual_um, window.time_s >= since_s, window.small_um)
    if lost is not None:
        per_s = lost.n_bursts / max(window.duration_s - since_s, window.period_s)
        values = {"share_lost": lost.share, "interruptions_per_s": per_s}
        yield Hypothesis(LOOSE_CONTACT, values, 2 * lost.n_bursts, lost.levels_um, None, since_s)


def _scaled_model(model: PiezoModel, factor: float) -> PiezoModel | None:
    try:
        return replace(model, kappa_um_per_v=model.kappa_um_per_v * factor)
    except ParameterError:
        return None


def _gain(window: Window, since_s: float, cause: str, durations_s: tuple[float, ...]) -> Hypothesis:
    """Return a scale that changes within one of some durations, 0 for at once; the moment is looked for."""

    def fitted(since: float, lasts_s: float) -> tuple[float, float, Array, float]:
        # From the first sample at that moment or after it, as effects that begin there do (``Window.index``).
        after_s = window.time_s - since
        course = np.clip(after_s / lasts_s, 0.0, 1.0) if lasts_s else (after_s >= 0.0).astype(np.float64)
        shape = course * window.predicted_um
        size = window.amplitude(shape)
        return window.squared_error(size * shape), size, size * shape, float(course[-1])

    pairs = [(since, lasts_s) for since in moments(window, since_s) for lasts_s in durations_s]
    since, lasts_s = min(pairs, key=lambda pair: fitted(*pair)[0])
    since = sharpened(window, since, lambda moment: fitted(moment, lasts_s)[0])
    _, size, change_um, course_end = fitted(since, lasts_s)
    values = {"relative_change": size * course_end}
    if lasts_s:
        values["duration_s"] = min(lasts_s, window.duration_s - since)
    model = _scaled_model(window.model, 1.0 + values["relative_change"])
    return Hypothesis(cause, values, 3 if lasts_s else 2, change_um, model, since)


def _creep(window: Window, since_s: float) -> Iterator[Hypothesis]:
    """Yield a creep order that changed: what moves from then on creeps more, what moved before goes on as it did."""
    order = window.model.creep_order

    def shape_since(since: float) -> Array | None:
        at = window.index(since)
        steps, drive = window.steps_s[at:], window.voltage_v[at:]
        past = Prehistory(float(drive[0]), float(drive[0]), _MOMENT_S, _LONG_S)
        plain = replace(window.model, effects=(), start=past)
        try:
            shape = replace(plain, creep_order=order + _ORDER_CHANGE).simulate(steps, drive)
            shape = (shape - plain.simulate(steps, drive)) / _ORDER_CHANGE
        except ParameterError:
            return None
        whole = np.zeros(window.time_s.size)
        whole[at:] = shape - shape[0]
        return whole

    def error(since: float) -> float:
        shape = shape_since(since)
        return np.inf if shape is None else window.squared_error(window.amplitude(shape) * shape)

    since = sharpened(window, min(moments(window, since_s)[::2], key=error), error)
    shape = shape_since(since)
    if shape is None:
        return
    size = window.amplitude(shape)
    try:
        model = replace(window.model, creep_order=order + size)
    except ParameterError:
        return
    yield Hypothesis(CREEP, {"creep_order": order + size}, 2, size * shape, model, since)


def _own_parameters(window: Window, since_s: float) -> Iterator[Hypothesis]:
    """Yield each parameter of the model's own effects, changed."""
    at = window.index(since_s)
    state = window.state_at(at)
    steps, drive = window.steps_s[at:], window.voltage_v[at:]
    for effect in window.model.effects:
        for name in effect.free_names():
            value = getattr(effect, name)
            if not isinstance(value, float) or value == 0.0:
                continue

            def change(factor: float, effect: Effect = effect, name: str = name, value: float = value) -> Array | None:
                try:
                    model = window.model.with_effects(replace(effect, **{name: value * factor}))
                    moved = model.simulate(steps, drive, state.copy())
                except ParameterError:
                    return None
                whole = np.zeros(window.time_s.size)
                whole[at:] = moved - window.predicted_um[at:]
                return whole

            found = _best_factor(window, change)
            if found is None:
                continue
            factor, changed_um = found
            parameters = {name: value * factor, f"{name}_before": value}
            model = window.model.with_effects(replace(effect, **{name: value * factor}))
            yield Hypothesis(effect.name, parameters, 1, changed_um, model, since_s)


def _best_factor(window: Window, change: Callable[[float], Array | None]) -> tuple[float, Array] | None:
    """Return the factor whose change fits best, and that change."""

    def error(log_factor: float) -> float:
        changed = change(float(np.exp(log_factor)))
        return HOPELESS * window.worst_um2 if changed is None else window.squared_error(changed)

    logs = np.log(_FACTORS)
    errors = [error(float(x)) for x in logs]
    k = int(np.argmin(errors))
    if errors[k] >= HOPELESS * window.worst_um2:
        return None
    low, high = logs[max(k - 1, 0)], logs[min(k + 1, logs.size - 1)]
    refined = minimize_scalar(error, bounds=(low, high), method="bounded", options={"xatol": REFINE_TOLERANCE})
    factor = float(np.exp(refined.x if refined.fun < errors[k] else logs[k]))
    changed = change(factor)
    return None if changed is None else (factor, changed)

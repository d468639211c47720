"""What has changed: the hypotheses beside each other, the likeliest first, and whether it holds on the data after."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.watch.alarm import Case
from fomrc_core.diagnosis.watch.change_detector import n_dependent
from fomrc_core.diagnosis.watch.hypotheses import MEANINGS, hypotheses
from fomrc_core.diagnosis.watch.hypothesis import Hypothesis
from fomrc_core.diagnosis.watch.window import Window
from fomrc_core.errors import RecordingError
from fomrc_core.model.causes import cause_classes
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.state import ModelState
from fomrc_core.records.recording import Recording
from fomrc_core.records.residual import rms

Tell = Callable[[float, str], None]
UNKNOWN = "unknown"
# Judged on the last part, which no hypothesis was fitted to.
_JUDGED_SHARE = 0.25
# Of what is before the change, so much tells what is normal.
_BEFORE_S = 20.0
# Half of what the change brought must be explained, else it is none of those that are known.
_LEAST_EXPLAINED = 0.5
_CLOSE_PROBABILITY = 0.05
# Nobody believes a ranking of models, all of them wrong a little, beyond this.
_LARGEST_LOG_ODDS = 12.0


@dataclass(frozen=True)
class Named:
    """One hypothesis as it came out.

    Attributes:
        cause: its name, of an effect the effect's; or UNKNOWN.
        parameters: its size.
        probability: that it is this one, of those that were tried [1].
        explained: share of what the change brought that it explains [1].
    """

    cause: str
    parameters: Mapping[str, float]
    probability: float
    explained: float


@dataclass(frozen=True, eq=False)
class ChangeDiagnosis:
    """What has changed.

    Attributes:
        named: likeliest first.
        since_s: when it began, from the start of the recording [s].
        size_nm: rms of what it changed since then [nm].
        meaning: of the likeliest, in a sentence.
        before_nm: rms the model in force leaves on data no hypothesis saw, offset removed [nm].
        after_nm: the same with the likeliest one in the model; nan where no model can follow it.
        model: the model extended by it, None where none can follow it, or it is no better.
    """

    named: tuple[Named, ...]
    since_s: float
    size_nm: float
    meaning: str
    before_nm: float
    after_nm: float
    model: PiezoModel | None

    @property
    def cause(self) -> str:
        """The likeliest."""
        return self.named[0].cause

    @property
    def ambiguous_with(self) -> tuple[str, ...]:
        """Those it could not be told from."""
        return tuple(n.cause for n in self.named[1:] if n.probability > _CLOSE_PROBABILITY)

    def __str__(self) -> str:
        first = self.named[0]
        size = ", ".join(f"{name} {value:.4g}" for name, value in first.parameters.items())
        text = f"{first.cause} ({size}), probability {first.probability:.2f}" if size else first.cause
        if self.ambiguous_with:
            text += f", cannot be told from {', '.join(self.ambiguous_with)}"
        return f"{text}; {self.size_nm:.3g} nm rms since {self.since_s:.1f} s"


def name_case(case: Case, tell: Tell | None = None) -> ChangeDiagnosis:
    """Return what has changed in a case of the watch; its times count from the start of the case's recording."""
    since_s = case.alarm.since_s - case.began_s
    return name_change(case.model, case.recording, since_s, state=case.state, fit_rms_um=case.fit_rms_um, tell=tell)


def name_change(
    model: PiezoModel,
    recording: Recording,
    since_s: float,
    *,
    state: ModelState | None = None,
    fit_rms_um: float = 0.0,
    tell: Tell | None = None,
) -> ChangeDiagnosis:
    """Return what has changed within a recording.

    Args:
        model: the model that was true before.
        recording: the recent past, before and after the change.
        since_s: when the change is thought to have begun, from the start of the recording [s].
        state: state of the model just before the recording; the initial one where not given.
        fit_rms_um: what the model left when it was fitted [um].
        tell: called with the share done and what is being done.

    Raises:
        RecordingError: nothing was measured after the change.
    """
    # Many arguments: of one diagnosis, given by name.
    say = tell or (lambda share, text: None)
    state = model.initial_state() if state is None else state
    window = _window(model, recording, since_s, state, fit_rms_um)
    lead_s = float(recording.time_s[-1]) - float(window.recording.time_s[-1])
    since = min(max(since_s - lead_s, 0.0), window.duration_s)
    if np.count_nonzero(window.time_s >= since) < 32:
        raise RecordingError("too little was measured after the change", where=recording.name, allowed="32 samples")
    say(0.05, "hypotheses")
    tried = []
    for k, hypothesis in enumerate(hypotheses(window, since)):
        tried.append(hypothesis)
        say(min(0.05 + 0.03 * k, 0.95), hypothesis.cause)
    ranked, named = _ranked(window, since, tried)
    best = ranked[0] if ranked and named[0].cause != UNKNOWN else None
    before_nm, after_nm = _judged(window, best)
    is_better = best is not None and after_nm < before_nm
    after = window.time_s >= (best.since_s if best is not None else since)
    changed = best.change_um if best is not None else window.residual_um - np.mean(window.residual_um)
    return ChangeDiagnosis(
        named,
        (best.since_s if best is not None else since) + lead_s,
        1e3 * rms(changed[after]),
        _meaning(named[0].cause),
        before_nm,
        after_nm,
        best.model if best is not None and is_better else None,
    )


def _window(model: PiezoModel, recording: Recording, since_s: float, state: ModelState, fit_rms_um: float) -> Window:
    first = int(np.searchsorted(recording.time_s, max(since_s - _BEFORE_S, 0.0)))
    state = state.copy()
    if first > 0:
        model.simulate(recording.steps_s[:first], recording.voltage_v[:first], state)
    part = Recording(
        recording.time_s[first:] - recording.time_s[first],
        recording.voltage_v[first:],
        recording.measured_um[first:],
        name=recording.name,
    )
    n_after = int(np.count_nonzero(recording.time_s[first:] >= since_s))
    n_fitted = part.n_samples - int(_JUDGED_SHARE * n_after)
    window = Window(model, part, state, max(fit_rms_um, 1e-9), n_fitted)
    before = window.residual_um[window.time_s < since_s - recording.time_s[first]]
    if before.size < 32:
        return window
    return Window(model, part, state, max(float(np.std(before)), 1e-9), n_fitted)


def _ranked(window: Window, since_s: float, tried: list[Hypothesis]) -> tuple[list[Hypothesis], tuple[Named, ...]]:
    """Return the hypotheses, likeliest first, by Schwarz's criterion on as many samples as are independent."""
    n = window.time_s.size
    normal = window.residual_um[window.time_s < since_s]
    n_independent = n / n_dependent(normal if normal.size >= 32 else window.residual_um)
    nothing = window.worst_um2
    # One half for what the model has to have changed, the other shared by all it might have been given.
    log_prior = np.log(max(sum(h.is_addition for h in tried), 1))
    noise = n * window.small_um**2
    errors = [window.squared_error(h.change_um) for h in tried]
    scores = [
        0.5 * n_independent * np.log(max(error, 1e-300))
        + 0.5 * h.n_parameters * np.log(n_independent)
        + h.is_addition * log_prior
        for error, h in zip(errors, tried, strict=True)
    ]
    order = np.argsort(scores)
    best_of_cause: dict[str, int] = {}
    for k in order:
        best_of_cause.setdefault(tried[k].cause, int(k))
    chosen = list(best_of_cause.values())
    if not chosen:
        return [], (Named(UNKNOWN, {}, 1.0, 0.0),)
    odds = np.exp(-np.minimum(np.array([scores[k] for k in chosen]) - scores[chosen[0]], _LARGEST_LOG_ODDS))
    explained = [1.0 - max(errors[k] - noise, 0.0) / max(nothing - noise, 1e-300) for k in chosen]
    named = [
        Named(tried[k].cause, dict(tried[k].parameters), float(probability), min(max(share, 0.0), 1.0))
        for k, probability, share in zip(chosen, odds / odds.sum(), explained, strict=True)
    ]
    if explained[0] < _LEAST_EXPLAINED:
        named.insert(0, Named(UNKNOWN, {}, 1.0 - explained[0], 0.0))
        return [], tuple(named)
    return [tried[k] for k in chosen], tuple(named)


def _judged(window: Window, best: Hypothesis | None) -> tuple[float, float]:
    """Return the errors of both models on the samples no hypothesis was fitted to [nm]."""
    at = window.n_fitted
    steps, drive = window.recording.steps_s, window.recording.voltage_v
    measured = window.recording.measured_um[at:]

    def error_nm(predicted_um: Array) -> float:
        left = measured - predicted_um
        return 1e3 * rms(left - np.mean(left))

    state = window.state_at(window.time_s.size)
    before = error_nm(window.model.simulate(steps[at:], drive[at:], state))
    if best is None or best.model is None:
        return before, float("nan")
    fresh = best.model.initial_state()
    predicted = best.model.simulate(steps, drive, fresh)[at:]
    plain = window.model.simulate(steps, drive, window.model.initial_state())[at:]
    # Both from the same start, so that what neither knows of the past cancels: their difference is the change.
    known = window.model.simulate(steps, drive, window.state.copy())[at:]
    return before, error_nm(known + predicted - plain)


def _meaning(cause: str) -> str:
    if cause == UNKNOWN:
        return "None of the causes that were tried explains it: record, identify and diagnose the stage."
    if cause in MEANINGS:
        return MEANINGS[cause]
    return cause_classes()[cause].meaning

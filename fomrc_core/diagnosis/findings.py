"""A finding: a cause with its parameters, their uncertainty, what naming it gained, and the evidence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fomrc_core.diagnosis.constancy import ParameterTwice
from fomrc_core.diagnosis.data_split import DataSplit, quoted_residuals
from fomrc_core.diagnosis.held_out_score import WORTHWHILE_LOG_GAIN
from fomrc_core.diagnosis.present_model import residual_inflation
from fomrc_core.diagnosis.screening import Screened
from fomrc_core.diagnosis.step import Step
from fomrc_core.effects.base.cause import Cause
from fomrc_core.effects.base.effect import Effect
from fomrc_core.fitting.joint_fit import Refit
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.causes import cause_classes
from fomrc_core.records.residual import normalised_percent, rms

Values = Mapping[str, float | list[float]]
_LEAST_ERRORS = 2.0  # standard errors a parameter must be: less happens one time in twenty where there is nothing


@dataclass(frozen=True, eq=False)
class Finding:
    """A cause that was accepted.

    Attributes:
        cause: its name.
        parameters: its parameters.
        standard_errors: of the parameters the fit moved.
        nrmse_percent_test_before: held-out error without it [%].
        nrmse_percent_test_after: held-out error with it [%].
        gain: (before - after) / (before - floor).
        p_value: of the hypothesis that it gains nothing on held-out data.
        evidence: why it was accepted, in a sentence.
        meaning: what it is, in a sentence.
        margin: by how much it is likelier than the next cause, in log likelihood [1]; see `Step`.
        whitened_margin: the same where the noise is whitened.
        probability: that it is the cause, and not another or one that is not in the library [1].
        twice: its parameters as learned beside those that held-out data alone ask for, where both are known.
        own_log_gain: logarithm of the power it takes where it acts [1]: of what belongs to single records in held-out
            blocks of those, for the quoted stretches it need not reach; of what bends to much else in the quoted
            stretches, beside all the others. None of other causes.
    """

    cause: str
    parameters: Values
    standard_errors: Mapping[str, float]
    nrmse_percent_test_before: float
    nrmse_percent_test_after: float
    gain: float
    p_value: float
    evidence: str
    meaning: str
    margin: float = math.nan
    whitened_margin: float = math.nan
    probability: float = float("nan")
    twice: tuple[ParameterTwice, ...] = ()
    own_log_gain: float | None = None

    def __str__(self) -> str:
        return self.sentence()

    @property
    def is_undetermined(self) -> bool:
        """Whether the data do not tell its parameters from nothing.

        All its sizes, or a time or another scale of it, are less than two of their standard errors: a repair of what is
        left, by the form of a cause. Plays of its own are asked as a whole when they are accepted, and the past of a
        record need not be known to act.
        """
        kind = cause_classes()[self.cause]
        if not issubclass(kind, Effect) or kind.owns_columns:
            return False
        known = {name: (value, self.standard_errors.get(name)) for name, value in self.parameters.items()}
        pairs = {n: (abs(v), e) for n, (v, e) in known.items() if isinstance(v, float) and v != 0.0 and e is not None}
        sizes = [pairs[name] for name in kind.linear_parameters if name in pairs]
        scales = [pairs[spec.name] for spec in kind.parameters if spec.is_log and spec.name in pairs]
        is_no_size = bool(sizes) and all(value < _LEAST_ERRORS * error for value, error in sizes)
        is_no_scale = any(value < _LEAST_ERRORS * error for value, error in scales)
        return is_no_size or (is_no_scale and not kind.is_record_bound)

    def wider_of(self, findings: Sequence[Finding]) -> str:
        """Return the name of the finding among others of which this is one more term; empty where there is none."""
        wider = cause_classes()[self.cause].one_more_of
        return next((other.cause for other in findings if other.cause in wider), "")

    def sentence_of_term(self, of: str) -> str:
        """Return in a line what one more term of a finding gains."""
        return (
            f"{self._with_parameters()}: one more term of {of}, from which no drive tells it: no name of its own, "
            f"held-out error {self.nrmse_percent_test_before:.4g} % -> {self.nrmse_percent_test_after:.4g} %"
        )

    def sentence_of_stand_in(self) -> str:
        """Return in a line what is gained by a form that is no name."""
        why = "another surely does better in its place, and is no finding either"
        if self.is_undetermined:
            why = "its parameters are no larger than twice their errors"
        return (
            f"not named: the form of {self.cause} follows what no cause explains, held-out error "
            f"{self.nrmse_percent_test_before:.4g} % -> {self.nrmse_percent_test_after:.4g} %; {why}"
        )

    def sentence(self) -> str:
        """Return the finding in a line."""
        return (
            f"{self._with_parameters()}: held-out error {self.nrmse_percent_test_before:.4g} % -> "
            f"{self.nrmse_percent_test_after:.4g} %; probability {100.0 * self.probability:.0f} %"
        )

    def _with_parameters(self) -> str:
        shown = []
        for name, value in self.parameters.items():
            if isinstance(value, list):
                shown.append(f"{name}: {len(value)} values")
                continue
            error = self.standard_errors.get(name)
            if error is None and value == getattr(cause_classes()[self.cause], name, None):
                continue  # a part of the effect that is not in use
            shown.append(f"{name} {value:.5g}" + (f" +- {error:.2g}" if error is not None else ""))
        return f"{self.cause} ({', '.join(shown)})"


def findings_of(
    steps: tuple[Step, ...], final_model: TrialModel, final: Refit, split: DataSplit, floor_um: float, n_elements: int
) -> tuple[Finding, ...]:
    """Return the findings of the steps that stand, their parameters as in the final model.

    Args:
        steps: acceptances in order.
        final_model: the final model.
        final: its joint refit, for standard errors.
        split: records; before and after are quoted on its report stretches.
        floor_um: noise floor [um].
        n_elements: number of elements of the extended model.
    """
    if not steps:
        return ()
    quoted_um = [h.record.measured_um[h.record.is_used] for h in split.report]
    floor = normalised_percent(floor_um, quoted_um)
    errors = final.standard_errors(split.train, residual_inflation(final.residual, split.train))
    models = [step.before for step in steps[1:]] + [final_model]
    found = []
    for step, after_model in zip(steps, models, strict=True):
        cause = step.accepted.cause
        kind = cause_classes()[cause]
        before = normalised_percent(rms(np.concatenate(quoted_residuals(step.before, split.report))), quoted_um)
        after = normalised_percent(rms(np.concatenate(quoted_residuals(after_model, split.report))), quoted_um)
        acting, index = _find(final_model, cause)
        # what has been folded into the elements shows in their number
        parameters: Values = {kind.main_parameter: float(n_elements)} if acting is None else acting.to_mapping()
        own_errors = {name: value for (owner, at, name), value in errors.items() if owner == cause and at == index}
        score = step.accepted.score
        where = "" if index is None else f" in {split.train[index].recording.name}"
        evidence = (
            f"held-out error {1e3 * score.rms_before_um:.3g} -> {1e3 * score.rms_after_um:.3g} nm rms{where} "
            f"(log gain {score.log_gain:.2f}, p {score.p_value:.1e}); training log gain "
            f"{step.accepted.train_log_gain:.2f}; {kind.signature}"
        )
        found.append(
            Finding(
                cause,
                parameters,
                own_errors,
                before,
                after,
                (before - after) / max(before - floor, 1e-12),
                score.p_value,
                evidence,
                kind.meaning,
                step.margin,
                step.whitened_margin,
                own_log_gain=_own_log_gain(step, final_model, split),
            )
        )
    return tuple(found)


def _own_log_gain(step: Step, final_model: TrialModel, split: DataSplit) -> float | None:
    """Return what a cause takes of the power left where it acts, as a logarithm; None where nobody asks.

    While others are hidden what it takes is little beside what they leave.
    """
    name = step.accepted.cause
    if step.accepted.is_bound:
        return step.accepted.score.log_gain
    if not cause_classes()[name].bends_to_much or not final_model.has(name):
        return None
    fewer = step.left_out_of(final_model, split).model
    without, beside = (rms(np.concatenate(quoted_residuals(m, split.report))) for m in (fewer, final_model))
    return 2.0 * math.log(without / beside) if without > 0.0 and beside > 0.0 else None


def as_in_model(
    findings: tuple[Finding, ...], model: TrialModel, final: Refit, split: DataSplit
) -> tuple[Finding, ...]:
    """Return findings of an earlier search with their parameters as in a model that was fitted since."""
    errors = final.standard_errors(split.train, residual_inflation(final.residual, split.train)) if findings else {}
    told = []
    for finding in findings:
        acting, index = _find(model, finding.cause)
        if acting is not None:
            own = {name: v for (owner, at, name), v in errors.items() if owner == finding.cause and at == index}
            finding = replace(finding, parameters=acting.to_mapping(), standard_errors=own)
        told.append(finding)
    return tuple(told)


def _find(model: TrialModel, name: str) -> tuple[Cause | None, int | None]:
    """Return a cause with its plays and the record it belongs to, the first of them; None where it does not act."""
    of_actuator = ((None, effect) for effect in model.actuator_effects())
    of_records = ((index, cause) for index, cause in model.found() if index is not None)
    found = ((cause, index) for index, cause in (*of_actuator, *of_records) if cause.name == name)
    return next(found, (None, None))


def smallest_detectable(screened: tuple[Screened, ...], split: DataSplit) -> dict[str, dict[str, float]]:
    """Return per cause the size of its main parameter whose signature would have been worthwhile in this data.

    A signature of power n sigma^2 (exp(gain) - 1) gives the held-out log gain asked for; the size follows from the
    trial instance whose signature comes closest to that, by the power law of small effects.
    """
    needed = split.n_used * split.noise_um**2 * (np.exp(WORTHWHILE_LOG_GAIN) - 1.0)
    best: dict[str, tuple[float, dict[str, float]]] = {}
    for trial in screened:
        if trial.signature_power <= 0.0:
            continue
        factor = float(np.sqrt(needed / trial.signature_power))
        size = trial.cause.smallest_detectable(factor)
        distance = abs(np.log(factor))
        if size and (trial.name not in best or distance < best[trial.name][0]):
            best[trial.name] = (distance, size)
    found = {name: size for name, (_, size) in best.items()}
    rms_um = float(np.sqrt(needed / split.n_used))
    by_rms = {name: kind.smallest_detectable_of_rms(rms_um) for name, kind in cause_classes().items()}
    return found | {name: size for name, size in by_rms.items() if size}

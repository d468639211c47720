"""The causes of several axes one after another: fit all, accept one on held-out samples, go on with what is left."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fomrc_core.diagnosis.axes.cause import AxesCause, AxesEvidence
from fomrc_core.diagnosis.axes.causes import CAUSES
from fomrc_core.diagnosis.axes.fit import FittedCause, Residuals, best_fit
from fomrc_core.diagnosis.axes.records import AxesRecord, mean_noise
from fomrc_core.diagnosis.held_out_score import WORTHWHILE_LOG_GAIN, held_out_score, loses_to
from fomrc_core.model.axes import AxesModel
from fomrc_core.records.noise import autocorrelation_inflation

Progress = Callable[[float, str], None]

_SIGNIFICANCE = 0.01  # of one search, shared by the causes it tries (Bonferroni)
_LEAST_LEARNT = 0.003  # logarithmic gain in training: less has only shaken the base
_MOST_FINDINGS = 4
# Of what a named cause changed, rms: it is an idealisation, and what it misses by less is no further cause.
_IDEALISED = 0.05
# Of the power a model left above the noise when it was identified: taking away less moves its own misfit about, and is
# no finding.
_OWN_SHARE = 1.0 / 3.0
_SURE = 10.0  # difference in log likelihood that settles it
_TIE_P_VALUE = 0.05  # of the hypothesis that two are equally good


@dataclass(frozen=True, eq=False)
class AxesStep:
    """One acceptance.

    Attributes:
        accepted: what was accepted.
        before: what the model before it left.
        model_before: that model.
        tied: names of causes it cannot be told from.
        margin: by how much it was likelier than the next cause, in log likelihood [1]; infinite without another.
    """

    accepted: FittedCause
    before: Residuals
    model_before: AxesModel
    tied: tuple[str, ...]
    margin: float


def search_causes(
    model: AxesModel,
    records: Sequence[AxesRecord],
    progress: Progress,
    excluded: Sequence[str] = (),
    model_error: float = 0.0,
) -> tuple[AxesStep, ...]:
    """Return the causes that were accepted, in order.

    Args:
        model: base model.
        records: what is learnt from and judged on.
        progress: told share and text.
        excluded: names of causes not to try.
        model_error: of the base model when it was identified [1].
    """
    steps: list[AxesStep] = []
    idealised = 0.0  # mean square
    own = _OWN_SHARE * max(model_error**2 - mean_noise(records) ** 2, 0.0)
    kinds = [kind for kind in CAUSES if kind.name not in excluded]
    present = Residuals.of(model, records)
    while kinds and len(steps) < _MOST_FINDINGS:
        # what a model left when it was identified may be a cause, a missing mode say; beside one that was named it
        # is taken for the model's own
        own_error = model_error if steps else 0.0
        if present.log_excess(own_error) < WORTHWHILE_LOG_GAIN:
            break
        is_worse = present.log_excess(model_error) > WORTHWHILE_LOG_GAIN
        residuals_um = [e * r.scale_um for e, r in zip(present.relative, records, strict=True)]
        evidence = AxesEvidence(model, records, residuals_um)
        fitted: list[FittedCause] = []
        accepted: list[FittedCause] = []
        groups = _groups([trial for kind in kinds for trial in kind.trials(evidence)])
        for k, trials in enumerate(groups):
            progress((len(steps) + k / len(groups)) / _MOST_FINDINGS, trials[0].name)
            found = best_fit(trials, model, present)
            if found is None:
                continue
            fitted.append(found)
            if _is_accepted(found, len(kinds)) and _gained(found) > max(idealised, own):
                accepted.append(found)
                # no richer cause could predict worthwhile better than by all that the model is worse than it was
                if found.residuals.log_excess(model_error if is_worse else 0.0) < WORTHWHILE_LOG_GAIN:
                    break
        winner = _winner(accepted, own)
        if winner is None:
            break
        rivals = [c for c in fitted if c.cause.name != winner.cause.name and c.is_plausible]
        tied = tuple(sorted({c.cause.name for c in rivals if _ties(winner, c)}))
        margin = min((_log_likelihood(winner, c) for c in rivals), default=math.inf)
        steps.append(AxesStep(winner, present, model, tied, margin))
        idealised += _IDEALISED**2 * _gained(winner)
        model, present = winner.model, winner.residuals
    return tuple(steps)


def _groups(trials: Sequence[AxesCause]) -> list[list[AxesCause]]:
    """Return the trials of each cause and number of values together, the fewest values first."""
    found: dict[tuple[int, str, str], list[AxesCause]] = {}
    for trial in trials:
        found.setdefault((trial.values.size, trial.name, trial.side), []).append(trial)
    return [found[key] for key in sorted(found)]


def _gained(fitted: FittedCause) -> float:
    """Return by how much the mean square of what is left is less on held-out samples [1]."""
    return fitted.score.rms_before_um**2 - fitted.score.rms_after_um**2


def _is_accepted(fitted: FittedCause, n_causes: int) -> bool:
    return (
        fitted.is_plausible
        and fitted.learnt_log_gain >= _LEAST_LEARNT
        and fitted.score.p_value < _SIGNIFICANCE / n_causes
        and fitted.score.is_worthwhile()
    )


def _winner(accepted: Sequence[FittedCause], least_gain: float) -> FittedCause | None:
    """Return the best of the simplest; a cause of more numbers must predict held-out samples surely better.

    Args:
        accepted: what passed.
        least_gain: by how much the mean square must be less [1].
    """
    best: FittedCause | None = None
    for other in sorted(accepted, key=lambda c: (c.n_free, c.residuals.squared_error)):
        if best is None:
            best = other
        elif other.n_free == best.n_free:
            continue  # the better of them came first
        else:
            added = held_out_score(best.residuals.held, other.residuals.held)
            gained = added.rms_before_um**2 - added.rms_after_um**2
            if added.is_worthwhile() and added.p_value < _SIGNIFICANCE and gained > least_gain:
                best = other
    return best


def _ties(winner: FittedCause, other: FittedCause) -> bool:
    if not other.score.is_worthwhile():
        return False
    n_independent = winner.residuals.n_independent
    loss = n_independent * math.log(other.residuals.squared_error / winner.residuals.squared_error)
    return loss < _SURE and loses_to(winner.residuals.held, other.residuals.held) > _TIE_P_VALUE


def _log_likelihood(winner: FittedCause, other: FittedCause) -> float:
    """Return by how much the winner is likelier, training and held-out samples together."""
    mine, its = winner.residuals, other.residuals
    gained = 0.5 * mine.n_independent * math.log(its.squared_error / mine.squared_error)
    for own, others in zip(mine.held, its.held, strict=True):
        independent = own.size / autocorrelation_inflation(own)
        gained += 0.5 * independent * math.log(float(np.sum(others**2)) / float(np.sum(own**2)))
    return gained

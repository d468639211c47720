"""The form of a found cause, as how many poles a sensor has, chosen anew beside one found since: no fit moves it."""

from __future__ import annotations

from concurrent.futures import Executor

import numpy as np

from fomrc_core.diagnosis.acceptance import RICH_GAIN, SIGNIFICANCE
from fomrc_core.diagnosis.data_split import DataSplit, held_residuals
from fomrc_core.diagnosis.decision import sure_gain
from fomrc_core.diagnosis.fit_starts import with_family
from fomrc_core.diagnosis.held_out_score import SURE, held_out_score
from fomrc_core.effects import Effect
from fomrc_core.fitting.evidence import evidence_of
from fomrc_core.fitting.joint_fit import Refit, fit_until_still, refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel

_FIRST_ITERATIONS = 3  # of each form: begun where the present one is, they are near their rest


def in_best_form(final: Refit, split: DataSplit, executor: Executor | None) -> Refit:
    """Return the joint refit with each effect in the form that is surely likelier, where one is.

    A form was chosen while another cause was hidden, and made up for it. With as many parameters the likelier of two is
    the one that leaves less; plays of its own, which bend to anything, must be worth it on held-out data as well. No
    form is sought where no more than noise is left.

    Args:
        final: at rest.
        split: records.
        executor: runs refits side by side where given.
    """
    for effect in final.model.effects:
        if final.squared_error < split.noise_um2:
            break

        def begun(start: TrialModel) -> Refit:
            return refit(start, split.train, n_iterations=_FIRST_ITERATIONS)

        starts = _starts(final, effect, split)
        fits = list(map(begun, starts) if executor is None else executor.map(begun, starts))
        if not fits:
            continue
        likeliest = min(fits, key=lambda fitted: fitted.squared_error)
        if likeliest.squared_error >= final.squared_error:
            continue
        likeliest = fit_until_still(likeliest.model, split.train, executor)
        if _is_surely_likelier(likeliest, final, split):
            final = likeliest
    return final


def _starts(final: Refit, effect: Effect, split: DataSplit) -> list[TrialModel]:
    """Return where fits of an effect in its other forms begin; one that could bring plays and has none, with them."""
    fewer = final.model.without(effect.name)
    starts = [fewer.with_cause(other) for other in effect.other_forms()]
    if effect.owns_columns and not np.any(final.model.columns.owned_by(effect.name)):
        evidence = evidence_of(final.model, split.train, final.residual, split.noise_um)
        trials = [trial for trial in type(effect).screening(evidence) if isinstance(trial, Effect)]
        starts += [with_family(final.model, trial) for trial in trials if ColumnKinds.plays_of(trial).owners]
    return starts


def _is_surely_likelier(likeliest: Refit, final: Refit, split: DataSplit) -> bool:
    if sure_gain(final, likeliest, split) <= SURE:
        return False
    if likeliest.model.weights.size == final.model.weights.size:
        return True
    held = held_out_score(held_residuals(final.model, split.held), held_residuals(likeliest.model, split.held))
    return held.log_gain > RICH_GAIN and held.p_value < SIGNIFICANCE

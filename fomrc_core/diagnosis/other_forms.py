"""The form of a found cause, as how many poles a sensor has, chosen anew beside one found since: no fit moves it."""

from __future__ import annotations

from concurrent.futures import Executor

from fomrc_core.diagnosis.data_split import DataSplit
from fomrc_core.diagnosis.decision import sure_gain
from fomrc_core.diagnosis.held_out_score import SURE
from fomrc_core.fitting.joint_fit import Refit, fit_until_still, refit
from fomrc_core.fitting.trial_model import TrialModel

_FIRST_ITERATIONS = 3  # of each form: begun where the present one is, they are near their rest


def in_best_form(final: Refit, split: DataSplit, executor: Executor | None) -> Refit:
    """Return the joint refit with each effect in the form that is surely likelier, where one is.

    A form was chosen while another cause was hidden, and made up for it. With as many parameters the likelier of two is
    the one that leaves less; none is sought where no more than noise is left.

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

        fewer = final.model.without(effect.name)
        starts = [fewer.with_cause(other) for other in effect.other_forms()]
        fits = list(map(begun, starts) if executor is None else executor.map(begun, starts))
        if not fits:
            continue
        likeliest = min(fits, key=lambda fitted: fitted.squared_error)
        if likeliest.squared_error >= final.squared_error:
            continue
        likeliest = fit_until_still(likeliest.model, split.train, executor)
        if sure_gain(final, likeliest, split) > SURE:
            final = likeliest
    return final

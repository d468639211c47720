"""Joints of a stage, whose force is the square of their strain: found on the records of the strongest level."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fomrc_core.identification.axes.drive_shape import FitSetting
from fomrc_core.identification.axes.fit import AxesFit
from fomrc_core.identification.axes.parameters import BASE, AxesParameters
from fomrc_core.identification.axes.periodic import PeriodicRecord

Progress = Callable[[float, str], None]

SAME_LEVEL = 0.15  # relative spread of what counts as one level
_JOINT_GAIN = 0.01  # of the held-out cost, below which one more joint does not stay
_JOINT_STARTS = 3


def with_joints(
    good: tuple[PeriodicRecord, ...],
    setting: FitSetting,
    start: tuple[AxesParameters, tuple[str, ...]],
    trials: tuple[int, int],
    tell: Progress,
) -> tuple[AxesParameters, tuple[str, ...]]:
    """Return parameters with as many joints as records held out of the strongest level approve of.

    Args:
        good: all records.
        setting: of fits.
        start: parameters, and names of what is fitted.
        trials: most joints, and the seed of their starts.
        tell: told share and text.

    Returns:
        parameters, and names of what is fitted from here on.
    """
    (par, names), (n_joints, seed) = start, trials
    strongest = max(record.level_v for record in good)
    top = tuple(record for record in good if record.level_v > (1.0 - SAME_LEVEL) * strongest)
    if len(top) < 3 or n_joints == 0:
        return par, names
    learnt, judge = setting.fit_of(top[:2]), setting.fit_of(top[-1:])
    fit = setting.fit_of(good)
    generator = np.random.default_rng(seed)
    soft = np.sqrt(np.abs(par.softening) / max(np.abs(par.softening).max(), 1e-12))
    linear = learnt.fitted(par, par.mask(*BASE), n_steps=3, still=1e-3)
    for k in range(n_joints):
        tried = []
        for _ in range(_JOINT_STARTS):
            strain = np.abs(linear.joint).max(initial=0.0) or _unit_strain(learnt, linear)
            shape = strain * soft * generator.choice([-1.0, 1.0], par.n_modes)
            trial = replace(linear, joint=np.vstack([linear.joint, shape]))
            trial = learnt.fitted(trial, trial.mask(*BASE), n_steps=2)
            trial = learnt.fitted(trial, trial.mask(*BASE, "joint"), n_steps=6, still=3e-3)
            tried.append((judge.cost(trial), trial))
        cost, best = min(tried, key=lambda found: found[0])
        if cost > (1.0 - _JOINT_GAIN) * judge.cost(linear):
            break
        linear = best
        more = replace(par, joint=best.joint)
        more = fit.fitted(more, more.mask(*BASE), n_steps=3, still=1e-3)
        more = fit.fitted(more, more.mask(*names, "joint"), n_steps=8, still=1e-3)
        if fit.cost(more) > (1.0 - _JOINT_GAIN) * fit.cost(par):
            break  # what helps the strongest level alone does not help them all
        par = more
        tell(0.55 + 0.1 * k, f"{k + 1} joints, error {100.0 * np.sqrt(fit.cost(par)):.2f} %")
    return par, (*names, "joint") if par.joint.size else names


def _unit_strain(fit: AxesFit, par: AxesParameters) -> float:
    """Return the size of a joint's shape that takes a thousandth of the modes' own stiffness."""
    spectrum = fit.response.drive(par, 0)
    return float((0.0016 / np.sqrt(np.mean(np.sum(np.abs(spectrum) ** 2, axis=1)))) ** (1.0 / 3.0))

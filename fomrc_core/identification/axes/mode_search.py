"""Which modes a stage has: poles of vector fitting, fewer or more as long as a record held out gains."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fomrc_core.identification.axes.drive_shape import FitSetting
from fomrc_core.identification.axes.fit import AxesFit
from fomrc_core.identification.axes.parameters import BASE, AxesParameters
from fomrc_core.identification.axes.periodic import PeriodicRecord
from fomrc_core.identification.axes.rational import common_poles
from fomrc_core.identification.axes.starts import empty_parameters, with_mode, with_shapes, without_mode

Progress = Callable[[float, str], None]

_MODE_GAIN = 0.02  # of the held-out cost, below which one more mode does not stay
_N_COARSE_LINES = 1200


def modes_of(
    middle: tuple[PeriodicRecord, ...], setting: FitSetting, n_modes: int | None, n_poles: int, tell: Progress
) -> AxesParameters:
    """Return the modes of records of one level, and shapes, coupling and delay with them.

    Args:
        middle: the records.
        setting: of fits without hysteresis, at their level.
        n_modes: how many; None to choose.
        n_poles: pairs of poles to begin with.
        tell: told share and text.
    """
    first = middle[0]
    step_s, top_hz = 1.0 / first.rate_hz, float(first.frequency_hz[-1])
    coarse = tuple(record.thinned(thinning(record)) for record in middle)
    hz, damping = common_poles(coarse, n_poles, 0.85 * step_s)
    shape = (first.displacement.shape[0], first.voltage.shape[0])
    learnt, held = (coarse[:-1], coarse[-1:]) if len(coarse) > 2 else (coarse, coarse)
    fit, judge = (setting.fit_of(part) for part in (learnt, held))
    trials = []
    for share in (0.01, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95):
        trial = with_shapes(fit, empty_parameters(hz, damping, shape, share * step_s))
        trials.append((fit.cost(trial), share, trial))
    # which delay is best shows once the poles have followed it
    trials = [found for found in trials if found[0] < 1.02 * min(trials, key=_cost_of)[0]] or trials
    trials.sort(key=lambda found: _imaginary_share(found[2]))
    begun = [fit.fitted(trial, trial.mask(*BASE), n_steps=4) for _, _, trial in trials[:3]]
    least = min(fit.cost(trial) for trial in begun)
    # with few modes a delay and phases of shapes stand in for one another: the most real shapes are taken
    par = min((trial for trial in begun if fit.cost(trial) < 1.02 * least), key=_imaginary_share)
    par = fit.fitted(par, par.mask(*BASE), n_steps=12, still=1e-3)
    par = _fewer(fit, judge, par, n_modes)
    best = judge.cost(par)
    while par.n_modes < (n_modes or 40):
        tell(0.05 + 0.01 * par.n_modes, f"{par.n_modes} modes, error {100.0 * np.sqrt(best):.2f} %")
        more = _one_more(fit, par, top_hz)
        cost = judge.cost(more)
        if n_modes is None and cost > (1.0 - _MODE_GAIN) * best:
            break
        par, best = more, min(best, cost)
    return setting.fit_of(coarse).fitted(par, par.mask(*BASE), n_steps=6, still=1e-3)


def _imaginary_share(par: AxesParameters) -> float:
    """Return how far the modes' shapes are from real, each mode's phase free."""
    par = par.in_one_gauge()
    shapes = np.einsum("mo,mi->moi", par.output_shape, par.input_shape)
    power = float(np.sum(np.abs(shapes) ** 2))
    return float(np.sum(shapes.imag**2)) / power if power > 0.0 else 0.0


def _cost_of(trial: tuple[float, float, AxesParameters]) -> float:
    return trial[0]


def thinning(record: PeriodicRecord) -> int:
    """Return by how much lines may be thinned where fits may be coarse: a thousand or so do for any start."""
    return max(1, record.lines.size // _N_COARSE_LINES)


def _fewer(fit: AxesFit, judge: AxesFit, par: AxesParameters, n_modes: int | None) -> AxesParameters:
    """Return the fit without modes whose loss the held-out records do not feel, or without those over a number."""
    while par.n_modes > 1:
        best = judge.cost(par)
        without = [without_mode(par, m) for m in range(par.n_modes)]
        least = min(without, key=fit.cost)
        is_over = n_modes is not None and par.n_modes > n_modes
        if not is_over and fit.cost(least) > 2.0 * fit.cost(par):
            break  # even the least of them is most of what there is
        least = fit.fitted(least, least.mask(*BASE), n_steps=6, still=1e-3)
        if not is_over and judge.cost(least) > (1.0 + _MODE_GAIN) * best:
            break
        par = least
    return par


def _one_more(fit: AxesFit, par: AxesParameters, top_hz: float) -> AxesParameters:
    """Return the fit with one more mode: the best of those begun where most is left, and above the band."""
    hz = fit.response.records[0].frequency_hz
    gains = []
    for start in np.concatenate([np.arange(hz[0] + 0.2 * top_hz, top_hz, top_hz / 100.0), top_hz * np.r_[1.04, 1.12]]):
        if np.min(np.abs(np.log(2.0 * np.pi * start) - par.log_frequency), initial=np.inf) < 0.01:
            continue
        trial = with_mode(fit, par, float(start))
        gains.append((fit.cost(trial), start, trial))
    gains.sort(key=lambda found: found[0])
    outside = [found for found in gains if found[1] > top_hz]
    tried = []
    for _, _, trial in [*gains[:2], *outside[:1]]:
        fitted = fit.fitted(trial, trial.mask(*BASE), n_steps=5, still=2e-3)
        tried.append((fit.cost(fitted), fitted))
    best = min(tried, key=lambda found: found[0])[1]
    return fit.fitted(best, best.mask(*BASE), n_steps=8, still=1e-3)

"""Identify several axes from periodic records of one or more levels.

In this order, each a Gauss-Newton fit of all that came before as well: poles of the middle level by vector fitting,
modes one by one as long as records held out gain, the level's law and the hysteresis of each input over all levels,
joints, and last what can be left out without loss.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import RecordingError
from fomrc_core.identification.axes.drive_shape import LINEAR, PLAY_SHARES, RELAY_SHARE, DriveShape, FitSetting
from fomrc_core.identification.axes.fit import AxesFit
from fomrc_core.identification.axes.joints import SAME_LEVEL, with_joints
from fomrc_core.identification.axes.kept_descents import KeptDescents
from fomrc_core.identification.axes.mode_search import modes_of, thinning
from fomrc_core.identification.axes.parameters import BASE, AxesParameters
from fomrc_core.identification.axes.periodic import PeriodicRecord, broken_records
from fomrc_core.identification.axes.pruning import pruned
from fomrc_core.identification.axes.result import AxesIdentification
from fomrc_core.identification.axes.standard_errors import standard_errors
from fomrc_core.model.axes import AxesModel, AxesModes, LevelLaw, RateRelay
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.operators.hysteresis import OperatorSum, elements_from_play_form
from fomrc_core.storage.kept_work import KeptWork

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

_LEVEL = ("softening", "damping_change", "gain_change", "static_change")
_START_EXPONENT = 0.7  # of the level law: between one of the force (1) and one of friction that saturates (0)


@dataclass(frozen=True)
class AxesOptions:
    """What to look for.

    Attributes:
        n_modes: number of modes; None to choose it on held-out records.
        n_poles: pairs of poles vector fitting places at the start.
        n_joints: at most so many joints.
        has_hysteresis: whether inputs have plays.
        n_parameters_max: leave out what matters least until there are no more than these.
        seed: of the joints' starts.
    """

    n_modes: int | None = None
    n_poles: int = 14
    n_joints: int = 2
    has_hysteresis: bool = True
    n_parameters_max: int = 300
    seed: int = 0


def identify_axes(
    records: tuple[PeriodicRecord, ...],
    options: AxesOptions | None = None,
    progress: Progress | None = None,
    kept: KeptWork | None = None,
) -> AxesIdentification:
    """Identify several axes.

    Args:
        records: of one rate, one period and the same axes; one or more levels, two or more of each.
        options: what to look for.
        progress: told share and text.
        kept: what an identification of the same has kept before it was stopped, see ``kept_identification``.

    Raises:
        RecordingError: records that do not fit one another, or too few that are not broken.
    """
    options = options or AxesOptions()
    tell = progress or (lambda share, text: None)
    _check(records)
    broken = broken_records(records)
    good = tuple(record for record in records if record not in broken)
    if len(good) < 2:
        raise RecordingError("too few records that are not broken", where="records", value=len(good), allowed=">= 2")
    levels = np.array([record.level_v for record in good])
    reference = float(levels[np.argsort(levels)[levels.size // 2]])
    middle = tuple(record for record in good if abs(record.level_v / reference - 1.0) < SAME_LEVEL)
    descents = KeptDescents(kept)
    tell(0.0, "poles")
    par = modes_of(middle, FitSetting(reference, kept=descents), options.n_modes, options.n_poles, tell)
    drive = LINEAR
    if options.has_hysteresis:
        drive = DriveShape(np.array(PLAY_SHARES) * levels.min(), RELAY_SHARE * float(levels.min()))
    weights = np.full((drive.n_rows, par.static.shape[1]), 0.02)
    weights[drive.thresholds.size :] = 0.0
    par = replace(par.in_one_gauge(), play_weights=weights)
    setting = FitSetting(reference, drive, descents)
    n_levels = _n_levels(levels)
    par, names = _with_levels(setting.fit_of(tuple(r.thinned(thinning(r)) for r in good)), par, n_levels, tell)
    fit = setting.fit_of(good)
    tell(0.5, f"error {100.0 * np.sqrt(fit.cost(par)):.2f} %")
    par, names = with_joints(good, setting, (par, names), (options.n_joints, options.seed), tell)
    tell(0.8, f"error {100.0 * np.sqrt(fit.cost(par)):.2f} %, leaving out what matters least")
    par, asked, free = pruned(fit, par, par.mask(*names), options.n_parameters_max - drive.n_constants, tell)
    tell(0.98, "standard errors")
    return AxesIdentification(
        model_of(par, drive, reference if n_levels > 1 else None, 1.0 / good[0].rate_hz),
        par,
        int(free.sum()) + drive.n_constants,
        tuple(record.name for record in broken),
        fit.errors(par),
        tuple(record.name for record in good),
        standard_errors(fit, par, asked, free),
    )


def _n_levels(levels_v: Array) -> int:
    """Return how many levels records have: those that differ by less than their spread are one."""
    rising = np.sort(levels_v)
    n, lowest = 1, rising[0]
    for level in rising:
        if level / lowest - 1.0 > SAME_LEVEL:
            n, lowest = n + 1, level
    return n


def _with_levels(
    coarse: AxesFit, par: AxesParameters, n_levels: int, tell: Progress
) -> tuple[AxesParameters, tuple[str, ...]]:
    """Return parameters with hysteresis and what levels change, and the names of what is fitted from here on.

    Two levels tell one number of each change, three the law's exponent and a second.
    """
    names = (*BASE, *(_LEVEL if n_levels > 1 else ()), *(("play_weights",) if par.play_weights.size else ()))
    if n_levels > 1:
        par = replace(par, softening=np.full(par.n_modes, -0.005), exponent=np.array([_START_EXPONENT]))
        par = coarse.fitted(par, par.mask(*BASE, "softening"), n_steps=6, still=1e-3)
    if n_levels > 2:
        names = (*names, "exponent")
    tell(0.4, "level and hysteresis")
    par = coarse.fitted(par, par.mask(*names), n_steps=10, still=1e-3)
    if n_levels > 2:
        names = (*names, "softening_squared")
        par = coarse.fitted(par, par.mask(*names), n_steps=10, still=1e-3)
    return par, names


def model_of(par: AxesParameters, drive: DriveShape, reference_v: float | None, step_s: float) -> AxesModel:
    """Return the model of fitted parameters.

    Args:
        par: the parameters.
        drive: what the rows of play weights belong to.
        reference_v: level at which the modes are as they are; None where they do not change.
        step_s: of the records [s].
    """
    axes, n_plays = [], drive.thresholds.size
    for i in range(par.static.shape[1]):
        weights = par.play_weights[:n_plays, i]
        kappa, saturation = elements_from_play_form(OperatorSum(1.0, drive.thresholds, weights))
        axes.append(PiezoModel(kappa, saturation, 0.0))
    relay = None
    if drive.relay_v > 0.0:
        relay = RateRelay(drive.relay_v / step_s, par.play_weights[n_plays], par.play_weights[n_plays + 1])
    modes = AxesModes(
        np.exp(par.log_frequency) / (2.0 * np.pi),
        np.exp(par.log_damping),
        par.output_shape,
        par.input_shape,
        par.softening,
        par.softening_squared,
        par.damping_change,
        par.gain_change,
    )
    level = None if reference_v is None else LevelLaw(reference_v, float(par.exponent[0]))
    joints = par.joint if par.joint.size else None
    change = float(par.static_change[0])
    return AxesModel(tuple(axes), modes, par.static, float(par.delay_s[0]), level, change, joints, relay)


def _check(records: tuple[PeriodicRecord, ...]) -> None:
    if not records:
        raise RecordingError("no records", where="records", value=0, allowed="2 or more")
    first = records[0]
    for record in records:
        for what in ("rate_hz", "n_samples"):
            if getattr(record, what) != getattr(first, what):
                raise RecordingError(
                    f"{what} differs from that of {first.name}",
                    where=record.name,
                    value=getattr(record, what),
                    allowed=str(getattr(first, what)),
                )
        if record.voltage.shape != first.voltage.shape or record.displacement.shape != first.displacement.shape:
            raise RecordingError(
                f"axes or lines differ from those of {first.name}",
                where=record.name,
                value=(record.voltage.shape, record.displacement.shape),
                allowed=str((first.voltage.shape, first.displacement.shape)),
            )

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

from fomrc_core.compute.least_squares import variances_of
from fomrc_core.errors import RecordingError
from fomrc_core.identification.axes.drive_shape import PLAY_SHARES, RELAY_SHARE, DriveShape, fit_of
from fomrc_core.identification.axes.fit import AxesFit
from fomrc_core.identification.axes.mode_search import modes_of, thinning
from fomrc_core.identification.axes.parameters import BASE, AxesParameters, Mask
from fomrc_core.identification.axes.periodic import PeriodicRecord, broken_records
from fomrc_core.identification.axes.pruning import pruned
from fomrc_core.model.axes import AxesModel, AxesModes, LevelLaw, RateRelay
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.operators.hysteresis import OperatorSum, elements_from_play_form

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

_LEVEL = ("softening", "exponent", "damping_change", "gain_change", "static_change")
_SAME_LEVEL = 0.15  # relative spread of what counts as one level
_JOINT_GAIN = 0.01  # of the held-out cost, below which one more joint does not stay
_JOINT_STARTS = 3


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


@dataclass(frozen=True, eq=False)
class AxesIdentification:
    """What came out.

    Attributes:
        model: the model.
        parameters: what was fitted.
        n_parameters: free numbers of the model, thresholds of plays included, less what scales leave undetermined.
        broken: names of the records left out.
        errors: relative error of each record learnt from and output [1].
        names: of these records.
        frequency_std_hz: uncertainty of each mode's frequency [Hz], from what is left [standard deviation].
        damping_std: of each mode's damping [1].
    """

    model: AxesModel
    parameters: AxesParameters
    n_parameters: int
    broken: tuple[str, ...]
    errors: Array
    names: tuple[str, ...]
    frequency_std_hz: Array
    damping_std: Array

    @property
    def worst_error(self) -> float:
        """Relative error of the worst record, mean over its outputs [1]."""
        return float(np.max(self.errors.mean(axis=1)))

    def __str__(self) -> str:
        lines = [f"{self.n_parameters} parameters; error {100.0 * self.errors.mean():.2f} % of the displacement"]
        if self.broken:
            lines.append("left out, periods disagree: " + ", ".join(self.broken))
        modes = self.model.modes
        if modes is not None:
            for m in np.argsort(modes.frequency_hz):
                lines.append(
                    f"mode {modes.frequency_hz[m]:9.3f} +- {self.frequency_std_hz[m]:.3f} Hz, "
                    f"damping {100.0 * modes.damping[m]:.3f} +- {100.0 * self.damping_std[m]:.3f} %"
                )
        return "\n".join(lines)


def identify_axes(
    records: tuple[PeriodicRecord, ...],
    options: AxesOptions | None = None,
    progress: Progress | None = None,
) -> AxesIdentification:
    """Identify several axes.

    Args:
        records: of one rate, one period and the same axes; one or more levels, two or more of each.
        options: what to look for.
        progress: told share and text.

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
    middle = tuple(record for record in good if abs(record.level_v / reference - 1.0) < _SAME_LEVEL)
    tell(0.0, "poles")
    par = modes_of(middle, reference, options.n_modes, options.n_poles, tell)
    has_levels = bool(levels.max() / levels.min() - 1.0 > _SAME_LEVEL)
    drive = DriveShape(np.zeros(0), 0.0)
    if options.has_hysteresis:
        drive = DriveShape(np.array(PLAY_SHARES) * levels.min(), RELAY_SHARE * float(levels.min()))
    weights = np.full((drive.n_rows, par.static.shape[1]), 0.02)
    weights[drive.thresholds.size :] = 0.0
    par = replace(par.in_one_gauge(), play_weights=weights)
    names = (*BASE, *(_LEVEL if has_levels else ()), *(("play_weights",) if drive.n_rows else ()))
    if has_levels:
        par = replace(par, softening=np.full(par.n_modes, -0.005), exponent=np.array([0.7]))
    coarse = fit_of(tuple(record.thinned(thinning(record)) for record in good), drive, reference)
    if has_levels:
        par, _ = coarse.fitted(par, par.mask(*BASE, "softening"), n_steps=6, still=1e-3)
    tell(0.4, "level and hysteresis")
    par, _ = coarse.fitted(par, par.mask(*names), n_steps=10, still=1e-3)
    if has_levels:
        names = (*names, "softening_squared")
        par, _ = coarse.fitted(par, par.mask(*names), n_steps=10, still=1e-3)
    fit = fit_of(good, drive, reference)
    tell(0.5, f"error {100.0 * np.sqrt(fit.cost(par)):.2f} %")
    par, names = _joints(good, drive, reference, (par, names), options, tell)
    tell(0.8, f"error {100.0 * np.sqrt(fit.cost(par)):.2f} %, leaving out what matters least")
    par, free, problem = pruned(fit, par, par.mask(*names), options.n_parameters_max - drive.n_constants, tell)
    model = model_of(par, drive, reference if has_levels else None, 1.0 / good[0].rate_hz)
    places = par.places()
    variance = _variances(problem.equations.gram, free, problem.cost / max(_n_values(good) - int(free.sum()), 1))
    scale = np.sqrt(variance[places["log_frequency"]]), np.sqrt(variance[places["log_damping"]])
    errors = fit.errors(par)
    return AxesIdentification(
        model,
        par,
        int(free.sum()) + drive.n_constants,
        tuple(record.name for record in broken),
        errors,
        tuple(record.name for record in good),
        np.exp(par.log_frequency) / (2.0 * np.pi) * scale[0],
        np.exp(par.log_damping) * scale[1],
    )


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


def _joints(
    good: tuple[PeriodicRecord, ...],
    drive: DriveShape,
    reference_v: float,
    start: tuple[AxesParameters, tuple[str, ...]],
    options: AxesOptions,
    tell: Progress,
) -> tuple[AxesParameters, tuple[str, ...]]:
    """Return parameters with as many joints as records held out of the strongest level approve of."""
    par, names = start
    strongest = max(record.level_v for record in good)
    top = tuple(record for record in good if record.level_v > (1.0 - _SAME_LEVEL) * strongest)
    if len(top) < 3 or options.n_joints == 0:
        return par, names
    learnt, judge = fit_of(top[:2], drive, reference_v), fit_of(top[-1:], drive, reference_v)
    fit = fit_of(good, drive, reference_v)
    generator = np.random.default_rng(options.seed)
    soft = np.sqrt(np.abs(par.softening) / max(np.abs(par.softening).max(), 1e-12))
    linear, _ = learnt.fitted(par, par.mask(*BASE), n_steps=3, still=1e-3)
    for k in range(options.n_joints):
        tried = []
        for _ in range(_JOINT_STARTS):
            strain = np.abs(linear.joint).max(initial=0.0) or _unit_strain(learnt, linear)
            shape = strain * soft * generator.choice([-1.0, 1.0], par.n_modes)
            trial = replace(linear, joint=np.vstack([linear.joint, shape]))
            trial, _ = learnt.fitted(trial, trial.mask(*BASE), n_steps=2)
            trial, _ = learnt.fitted(trial, trial.mask(*BASE, "joint"), n_steps=6, still=3e-3)
            tried.append((judge.cost(trial), trial))
        cost, best = min(tried, key=lambda found: found[0])
        if cost > (1.0 - _JOINT_GAIN) * judge.cost(linear):
            break
        linear = best
        more = replace(par, joint=best.joint)
        more, _ = fit.fitted(more, more.mask(*BASE), n_steps=3, still=1e-3)
        more, _ = fit.fitted(more, more.mask(*names, "joint"), n_steps=8, still=1e-3)
        if fit.cost(more) > (1.0 - _JOINT_GAIN) * fit.cost(par):
            break  # what helps the strongest level alone does not help them all
        par = more
        tell(0.55 + 0.1 * k, f"{k + 1} joints, error {100.0 * np.sqrt(fit.cost(par)):.2f} %")
    return par, (*names, "joint") if par.joint.size else names


def _unit_strain(fit: AxesFit, par: AxesParameters) -> float:
    """Return the size of a joint's shape that takes a thousandth of the modes' own stiffness."""
    spectrum = fit.response.drive(par, 0)
    return float((0.0016 / np.sqrt(np.mean(np.sum(np.abs(spectrum) ** 2, axis=1)))) ** (1.0 / 3.0))


def _variances(matrix: Array, free: Mask, variance: float) -> Array:
    found = np.zeros(free.size)
    found[free] = variances_of(matrix[np.ix_(free, free)]) * variance
    return found


def _n_values(records: tuple[PeriodicRecord, ...]) -> int:
    return sum(2 * record.displacement.size for record in records)

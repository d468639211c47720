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

from fomrc_core.compute.compiled import compiled
from fomrc_core.errors import RecordingError
from fomrc_core.identification.axes.fit import AxesFit
from fomrc_core.identification.axes.parameters import AxesParameters, Mask
from fomrc_core.identification.axes.periodic import PeriodicRecord, broken_records
from fomrc_core.identification.axes.pruning import pruned
from fomrc_core.identification.axes.rational import common_poles
from fomrc_core.identification.axes.response import ResponseFit
from fomrc_core.identification.axes.starts import empty_parameters, with_mode, with_shapes, without_mode
from fomrc_core.model.axes import AxesModel, AxesModes, LevelLaw, RateRelay
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.operators.hysteresis import OperatorSum, elements_from_play_form

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

_BASE = ("log_frequency", "log_damping", "output_re", "output_im", "input_re", "input_im", "static", "delay_s")
_LEVEL = ("softening", "exponent", "damping_change", "gain_change", "static_change")
_SAME_LEVEL = 0.15  # relative spread of what counts as one level
_MODE_GAIN, _JOINT_GAIN = 0.02, 0.01  # of the held-out cost, below which one more mode or joint does not stay
_JOINT_STARTS = 3
_N_COARSE_LINES = 1200
# Shares of the lowest level at which plays stand: one for what acts like a relay, one for large loops.
PLAY_SHARES = (0.03, 1.0)
_RELAY_SHARE = 0.6  # of the lowest level, by which a voltage changes in a step where the relay of the rate bends


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
    n_joints: int = 1
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
    par = _modes(middle, reference, options, tell)
    has_levels = bool(levels.max() / levels.min() - 1.0 > _SAME_LEVEL)
    drive = _DriveShape(np.zeros(0), 0.0)
    if options.has_hysteresis:
        drive = _DriveShape(np.array(PLAY_SHARES) * levels.min(), _RELAY_SHARE * float(levels.min()))
    weights = np.full((drive.n_rows, par.static.shape[1]), 0.02)
    weights[drive.thresholds.size :] = 0.0
    par = replace(par.in_one_gauge(), play_weights=weights)
    names = (*_BASE, *(_LEVEL if has_levels else ()), *(("play_weights",) if drive.n_rows else ()))
    if has_levels:
        par = replace(par, softening=np.full(par.n_modes, -0.005), exponent=np.array([0.7]))
    coarse = _fit_of(tuple(record.thinned(_thinning(record)) for record in good), drive, reference)
    if has_levels:
        par, _ = coarse.fitted(par, par.mask(*_BASE, "softening"), n_steps=6, still=1e-3)
    tell(0.4, "level and hysteresis")
    par, _ = coarse.fitted(par, par.mask(*names), n_steps=10, still=1e-3)
    if has_levels:
        names = (*names, "softening_squared")
        par, _ = coarse.fitted(par, par.mask(*names), n_steps=10, still=1e-3)
    fit = _fit_of(good, drive, reference)
    tell(0.5, f"error {100.0 * np.sqrt(fit.cost(par)):.2f} %")
    par, names = _joints(good, drive, reference, (par, names), options, tell)
    tell(0.8, f"error {100.0 * np.sqrt(fit.cost(par)):.2f} %, leaving out what matters least")
    par, free, problem = pruned(fit, par, par.mask(*names), options.n_parameters_max - drive.n_constants, tell)
    model = model_of(par, drive, reference if has_levels else None, 1.0 / good[0].rate_hz)
    places = par.places()
    variance = _variances(problem.matrix, free, problem.cost / max(_n_values(good) - int(free.sum()), 1))
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


@dataclass(frozen=True, eq=False)
class _DriveShape:
    """What stands between voltage and modes, but for its weights: thresholds of plays [V], step [V] of the relay."""

    thresholds: Array
    relay_v: float

    @property
    def n_rows(self) -> int:
        """Rows of weights: one for each play, two for the relay."""
        return self.thresholds.size + (2 if self.relay_v > 0.0 else 0)

    @property
    def n_constants(self) -> int:
        """Numbers beside the weights."""
        return self.thresholds.size + (1 if self.relay_v > 0.0 else 0)

    def spectra(self, record: PeriodicRecord) -> NDArray[np.complex128]:
        """Return spectra of what the weights weigh, (n_rows, I, K)."""
        voltage = record.voltage_v
        found = record.spectrum_of(settled_plays(voltage, self.thresholds))
        if self.relay_v <= 0.0:
            return found
        bent = record.spectrum_of(np.arctan((voltage - np.roll(voltage, 1, axis=1)) / self.relay_v))
        late = bent * np.exp(-2j * np.pi * record.frequency_hz / record.rate_hz)
        return np.concatenate([found, bent[None], late[None]])


def model_of(par: AxesParameters, drive: _DriveShape, reference_v: float | None, step_s: float) -> AxesModel:
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


def _modes(
    middle: tuple[PeriodicRecord, ...], reference_v: float, options: AxesOptions, tell: Progress
) -> AxesParameters:
    first = middle[0]
    step_s, top_hz = 1.0 / first.rate_hz, float(first.frequency_hz[-1])
    coarse = tuple(record.thinned(_thinning(record)) for record in middle)
    hz, damping = common_poles(coarse, options.n_poles, 0.85 * step_s)
    shape = (first.displacement.shape[0], first.voltage.shape[0])
    learnt, held = (coarse[:-1], coarse[-1:]) if len(coarse) > 2 else (coarse, coarse)
    fit, judge = (_fit_of(part, _LINEAR, reference_v) for part in (learnt, held))
    trials = []
    for share in (0.01, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95):
        trial = with_shapes(fit, empty_parameters(hz, damping, shape, share * step_s))
        trials.append((fit.cost(trial), share, trial))
    # which delay is best shows once the poles have followed it
    trials = [found for found in trials if found[0] < 1.02 * min(trials, key=_cost_of)[0]] or trials
    trials.sort(key=lambda found: _imaginary_share(found[2]))
    begun = [fit.fitted(trial, trial.mask(*_BASE), n_steps=4)[0] for _, _, trial in trials[:3]]
    least = min(fit.cost(trial) for trial in begun)
    # with few modes a delay and phases of shapes stand in for one another: the most real shapes are taken
    par = min((trial for trial in begun if fit.cost(trial) < 1.02 * least), key=_imaginary_share)
    par, _ = fit.fitted(par, par.mask(*_BASE), n_steps=12, still=1e-3)
    par = _fewer(fit, judge, par, options.n_modes)
    best = judge.cost(par)
    while par.n_modes < (options.n_modes or 40):
        tell(0.05 + 0.01 * par.n_modes, f"{par.n_modes} modes, error {100.0 * np.sqrt(best):.2f} %")
        more = _one_more(fit, par, top_hz)
        cost = judge.cost(more)
        if options.n_modes is None and cost > (1.0 - _MODE_GAIN) * best:
            break
        par, best = more, min(best, cost)
    return _fit_of(coarse, _LINEAR, reference_v).fitted(par, par.mask(*_BASE), n_steps=6, still=1e-3)[0]


def _imaginary_share(par: AxesParameters) -> float:
    """Return how far the modes' shapes are from real, each mode's phase free."""
    par = par.in_one_gauge()
    shapes = np.einsum("mo,mi->moi", par.output_shape, par.input_shape)
    return float(np.sum(shapes.imag**2) / np.sum(np.abs(shapes) ** 2))


def _cost_of(trial: tuple[float, float, AxesParameters]) -> float:
    return trial[0]


def _thinning(record: PeriodicRecord) -> int:
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
        least, _ = fit.fitted(least, least.mask(*_BASE), n_steps=6, still=1e-3)
        if not is_over and judge.cost(least) > (1.0 + _MODE_GAIN) * best:
            break
        par = least
    return par


def _one_more(fit: AxesFit, par: AxesParameters, top_hz: float) -> AxesParameters:
    """Return the fit with one more mode: the best of those begun where most is left, and above the band."""
    hz = fit.response.records[0].frequency_hz
    gains = []
    for start in np.concatenate([np.arange(hz[0] + 0.2 * top_hz, top_hz, top_hz / 100.0), top_hz * np.r_[1.04, 1.12]]):
        if np.min(np.abs(np.log(2.0 * np.pi * start) - par.log_frequency)) < 0.01:
            continue
        trial = with_mode(fit, par, float(start))
        gains.append((fit.cost(trial), start, trial))
    gains.sort(key=lambda found: found[0])
    outside = [found for found in gains if found[1] > top_hz]
    tried = []
    for _, _, trial in [*gains[:2], *outside[:1]]:
        fitted, _ = fit.fitted(trial, trial.mask(*_BASE), n_steps=5, still=2e-3)
        tried.append((fit.cost(fitted), fitted))
    best = min(tried, key=lambda found: found[0])[1]
    return fit.fitted(best, best.mask(*_BASE), n_steps=8, still=1e-3)[0]


def _joints(
    good: tuple[PeriodicRecord, ...],
    drive: _DriveShape,
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
    learnt, judge = _fit_of(top[:2], drive, reference_v), _fit_of(top[-1:], drive, reference_v)
    fit = _fit_of(good, drive, reference_v)
    generator = np.random.default_rng(options.seed)
    soft = np.sqrt(np.abs(par.softening) / max(np.abs(par.softening).max(), 1e-12))
    linear, _ = learnt.fitted(par, par.mask(*_BASE), n_steps=3, still=1e-3)
    for k in range(options.n_joints):
        tried = []
        for _ in range(_JOINT_STARTS):
            strain = np.abs(linear.joint).max(initial=0.0) or _unit_strain(learnt, linear)
            shape = strain * soft * generator.choice([-1.0, 1.0], par.n_modes)
            trial = replace(linear, joint=np.vstack([linear.joint, shape]))
            trial, _ = learnt.fitted(trial, trial.mask(*_BASE), n_steps=2)
            trial, _ = learnt.fitted(trial, trial.mask(*_BASE, "joint"), n_steps=6, still=3e-3)
            tried.append((judge.cost(trial), trial))
        cost, best = min(tried, key=lambda found: found[0])
        if cost > (1.0 - _JOINT_GAIN) * judge.cost(linear):
            break
        linear = best
        par = replace(par, joint=best.joint)
        par, _ = fit.fitted(par, par.mask(*names, "joint"), n_steps=9, still=2e-3)
        tell(0.55 + 0.1 * k, f"{k + 1} joints, error {100.0 * np.sqrt(fit.cost(par)):.2f} %")
    return par, (*names, "joint") if par.joint.size else names


def _unit_strain(fit: AxesFit, par: AxesParameters) -> float:
    """Return the size of a joint's shape that takes a thousandth of the modes' own stiffness."""
    spectrum = fit.response.drive(par, 0)
    return float((0.0016 / np.sqrt(np.mean(np.sum(np.abs(spectrum) ** 2, axis=1)))) ** (1.0 / 3.0))


_LINEAR = _DriveShape(np.zeros(0), 0.0)


def _fit_of(records: tuple[PeriodicRecord, ...], drive: _DriveShape, reference_v: float) -> AxesFit:
    spectra = [drive.spectra(record) for record in records]
    return AxesFit(ResponseFit(records, spectra, reference_v, drive.thresholds.size))


@compiled
def settled_plays(voltage_v: Array, thresholds: Array) -> Array:
    """Return the plays of periodic drives (I, N) in their second period, (P, I, N)."""
    out = np.empty((thresholds.size, voltage_v.shape[0], voltage_v.shape[1]))
    for p in range(thresholds.size):
        for i in range(voltage_v.shape[0]):
            play = 0.0
            for _ in range(2):
                for n in range(voltage_v.shape[1]):
                    value = voltage_v[i, n]
                    play = min(max(play, value - thresholds[p]), value + thresholds[p])
                    out[p, i, n] = play
    return out


def _variances(matrix: Array, free: Mask, variance: float) -> Array:
    found = np.zeros(free.size)
    block = matrix[np.ix_(free, free)]
    block = block + 1e-10 * np.diag(np.diag(block))
    found[free] = np.maximum(np.diag(np.linalg.pinv(block, hermitian=True)), 0.0) * variance
    return found


def _n_values(records: tuple[PeriodicRecord, ...]) -> int:
    return sum(2 * record.displacement.size for record in records)

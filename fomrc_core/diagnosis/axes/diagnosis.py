"""What a model of several axes gets wrong, why, and what mending it gains.

    diagnose_axes(records, model) -> AxesDiagnosis

Causes of the stage as a whole come first; what they leave of an axis above the noise is asked for one-axis causes,
the others' part and that of the modes taken out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.blas_threads import with_one_algebra_thread
from fomrc_core.diagnosis.axes.belief import axes_probabilities
from fomrc_core.diagnosis.axes.causes import CAUSES
from fomrc_core.diagnosis.axes.findings import AxesFinding, AxisDiagnosis
from fomrc_core.diagnosis.axes.fit import Residuals
from fomrc_core.diagnosis.axes.records import AxesRecord, check_fit
from fomrc_core.diagnosis.axes.search import AxesStep, search_causes
from fomrc_core.diagnosis.belief import sureness_of
from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.diagnosis.judgement import Judgement, Status, judge
from fomrc_core.diagnosis.remainder import DrivenRecord, dependences
from fomrc_core.errors import ParameterError, RecordingError
from fomrc_core.model.axes import AxesModel
from fomrc_core.records.recording import Recording

Progress = Callable[[float, str], None]

# Times the floor on held-out samples from which an axis is asked for causes of its own: what judge() allows.
_ABOVE_FLOOR = 1.2
# What is left beside the modes is theirs: an axis is asked where at least this share of its power is below half of
# the lowest mode, where a stage moves as its axes do by themselves.
_SLOW_SHARE = 0.5
_SHARE_OF_SEARCH = 0.7  # of the time, where axes are asked one by one as well


@dataclass(frozen=True, eq=False)
class AxesDiagnosis:
    """What a model of several axes gets wrong, and why.

    Attributes:
        status: of the whole.
        judgement: whether what is left is noise; its sizes are shares of the displacements' rms.
        probability_of_unknown: that something acts that is not in the library [1].
        findings: causes of the stage as a whole, in order of acceptance.
        axes: what one-axis causes were asked for, axis by axis.
        percent_before: held-out error of the base model, of the displacements' rms [%].
        percent_after: the same of the extended model [%].
        percent_floor: noise, or the model's own error when it was identified where that is larger, the same way [%].
        axis_percent: of each output, before, after and floor [%], (n_outputs, 3).
        not_asked: axes above the floor not asked for one-axis causes, as what is left of them is at the modes.
        next_experiment: what to measure next, and why.
        base_model: the model that was asked.
        extended_model: the model with what was found of the stage as a whole.
        records: what it rests on.
    """

    status: Status
    judgement: Judgement
    probability_of_unknown: float
    findings: tuple[AxesFinding, ...]
    axes: tuple[AxisDiagnosis, ...]
    percent_before: float
    percent_after: float
    percent_floor: float
    axis_percent: Array
    not_asked: tuple[int, ...]
    next_experiment: str
    base_model: AxesModel
    extended_model: AxesModel
    records: tuple[AxesRecord, ...]

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why what was named does not explain what the model missed, in words; empty where it does."""
        of_axes = [axis.diagnosis for axis in self.axes]
        probabilities, asked = sureness_of([*self.findings, *(f for one in of_axes for f in one.findings)])
        return self.judgement.doubts(probabilities, any(one.stand_ins for one in of_axes), asked)

    def __str__(self) -> str:
        lines = [f"status: {self.status.value}; floor {self.percent_floor:.3g} % of the displacements' rms"]
        lines += [str(finding) for finding in self.findings]
        lines += [f"cannot be told from: {', '.join(f.tied)}" for f in self.findings if f.tied]
        lines += [str(axis) for axis in self.axes]
        if self.not_asked:
            axes = ", ".join(map(str, self.not_asked))
            lines.append(f"axis {axes} by itself: not asked, what is left of it is at the modes")
        lines.append(
            f"held-out error: {self.percent_before:.4g} % -> {self.percent_after:.4g} % of the displacements' rms; "
            f"unexplained {100.0 * self.judgement.unexplained_share:.3g} %"
        )
        lines += self.doubts
        lines.append(f"next: {self.next_experiment}")
        return "\n".join(lines)


@with_one_algebra_thread
def diagnose_axes(
    records: Sequence[AxesRecord],
    model: AxesModel,
    *,
    model_error: float = 0.0,
    excluded_causes: Sequence[str] = (),
    progress: Progress | None = None,
    executor: ThreadPoolExecutor | None = None,
) -> AxesDiagnosis:
    """Return what a model of several axes gets wrong.

    Args:
        records: with samples to learn from and samples held out.
        model: of as many voltages and displacements.
        model_error: what the model left when it was identified, of the displacements' rms [1]; 0 where not known.
        excluded_causes: causes of several axes not to try.
        progress: told share and text.
        executor: of one-axis diagnoses.

    Raises:
        RecordingError: records that do not fit the model or one another, or nothing held out.
        ParameterError: an unknown cause.
    """
    tell = progress or (lambda _share, _text: None)
    check_fit(records, model)
    for word, masks in (("learnt from", [r.is_learnt for r in records]), ("held out", [r.is_held for r in records])):
        if not any(np.any(mask) for mask in masks):
            raise RecordingError(f"nothing {word}", where="records", value=0, allowed="1 record or more")
    names = [kind.name for kind in CAUSES]
    for name in excluded_causes:
        if name not in names:
            raise ParameterError("unknown cause", where="excluded_causes", value=name, allowed=", ".join(names))
    steps = search_causes(model, records, lambda s, t: tell(_SHARE_OF_SEARCH * s, t), excluded_causes, model_error)
    extended = steps[-1].accepted.model if steps else model
    before, after = Residuals.of(model, records), Residuals.of(extended, records)
    floor = np.maximum(_noise_by_output(records), model_error)
    sizes = np.stack([_by_output(before), _by_output(after), floor], axis=1)
    axes, not_asked = _by_axis(records, extended, sizes, tell, executor)
    whole = np.sqrt(np.mean(sizes**2, axis=0))
    judgement = _judgement(extended, after, (float(whole[0]), float(whole[1]), float(whole[2])))
    findings = axes_probabilities(_findings(steps, float(whole[2])), float(whole[0] ** 2 - whole[2] ** 2))
    probabilities, asked = sureness_of([*findings, *(f for axis in axes for f in axis.diagnosis.findings)])
    has_stand_ins = any(axis.diagnosis.stand_ins for axis in axes)
    status = judgement.status(probabilities, any(step.tied for step in steps), has_stand_ins, asked)
    unknown = 0.0 if judgement.is_noise else 1.0 - min(probabilities, default=0.0)
    found = AxesDiagnosis(
        status,
        judgement,
        unknown,
        findings,
        axes,
        100.0 * float(whole[0]),
        100.0 * float(whole[1]),
        100.0 * float(whole[2]),
        100.0 * sizes,
        not_asked,
        "",
        model,
        extended,
        tuple(records),
    )
    return replace(found, next_experiment=_next_experiment(found))


def _by_output(residuals: Residuals) -> Array:
    """Return the rms on held-out samples of each output, as a share of its displacement's, (n_outputs,)."""
    held = [e[r.is_held] for r, e in zip(residuals.records, residuals.relative, strict=True)]
    return np.asarray(np.sqrt(np.mean(np.concatenate(held) ** 2, axis=0)))


def _noise_by_output(records: Sequence[AxesRecord]) -> Array:
    weights = np.array([r.is_held.sum() for r in records], dtype=np.float64)
    noise = np.array([(r.noise_um / r.scale_um) ** 2 for r in records])
    return np.asarray(np.sqrt(weights @ noise / weights.sum()))


def _judgement(model: AxesModel, after: Residuals, sizes: tuple[float, float, float]) -> Judgement:
    records = after.records
    # periods that repeat show noise of every speed; differences of samples do not, and there what is left is asked
    # whether it follows the drives
    sees_slow_noise = all(record.is_periodic for record in records)
    tests = () if sees_slow_noise else dependences(_driven(model, after))
    worst = max(float(np.sqrt(np.mean(e**2))) for e in after.relative)
    n_learnt = sum(int(r.is_learnt.sum()) * r.displacement_um.shape[1] for r in records)
    learnt = math.sqrt(after.squared_error / n_learnt)
    return judge(sizes[2], sees_slow_noise, sizes[0], sizes[1], worst, tests, learned_um=learnt)


def _driven(model: AxesModel, after: Residuals) -> list[DrivenRecord]:
    """Return each voltage with each displacement it belongs to, by its number, in one list of records."""
    found = []
    for record, relative in zip(after.records, after.relative, strict=True):
        time = np.arange(record.n_samples) / record.rate_hz
        predicted = record.predicted_um(model) / record.scale_um
        everywhere = np.ones(record.n_samples, dtype=np.bool_)
        for k in range(min(model.n_inputs, model.n_outputs)):
            found.append(DrivenRecord(time, record.voltage_v[:, k], predicted[:, k], relative[:, k], everywhere))
    return found


def _findings(steps: Sequence[AxesStep], noise: float) -> tuple[AxesFinding, ...]:
    found = []
    for step in steps:
        fitted, cause = step.accepted, step.accepted.cause
        score = fitted.score
        before, after = score.rms_before_um, score.rms_after_um
        evidence = (
            f"held-out error {100.0 * before:.3g} -> {100.0 * after:.3g} % (log gain {score.log_gain:.2f}, "
            f"p {score.p_value:.1e}); training log gain {fitted.learnt_log_gain:.2f}; {cause.signature}"
        )
        found.append(
            AxesFinding(
                cause.name,
                cause.kind,
                cause.parameters(step.model_before),
                tuple(fitted.standard_errors.tolist()),
                100.0 * before,
                100.0 * after,
                (before**2 - after**2) / max(before**2 - noise**2, 1e-18),
                score.p_value,
                evidence,
                cause.meaning,
                cause.experiment,
                step.margin,
                step.tied,
            )
        )
    return tuple(found)


def _by_axis(
    records: Sequence[AxesRecord],
    model: AxesModel,
    sizes: Array,
    tell: Progress,
    executor: ThreadPoolExecutor | None,
) -> tuple[tuple[AxisDiagnosis, ...], tuple[int, ...]]:
    """Return the one-axis diagnosis of each axis above the floor, and the axes that were not asked."""
    if model.n_inputs != model.n_outputs:
        return (), ()
    above = [o for o in range(model.n_outputs) if sizes[o, 1] > _ABOVE_FLOOR * sizes[o, 2]]
    slow = [o for o in above if _slow_share(records, model, o) >= _SLOW_SHARE]
    gain, found = model.static_gain(), []
    for k, o in enumerate(slow):
        tell(_SHARE_OF_SEARCH + (1.0 - _SHARE_OF_SEARCH) * k / len(slow), f"axis {o + 1} by itself")
        own = [_own_record(record, model, o, float(gain[o, o])) for record in records]
        found.append(AxisDiagnosis(o + 1, diagnose(own, executor=executor)))
    return tuple(found), tuple(o + 1 for o in above if o not in slow)


def _slow_share(records: Sequence[AxesRecord], model: AxesModel, output: int) -> float:
    """Return the share of what is left of an output that is below half of the lowest mode [1]."""
    if model.modes is None:
        return 1.0
    slow, whole = 0.0, 0.0
    for record in records:
        power = np.abs(np.fft.rfft(record.relative_residual(model)[:, output])) ** 2
        hz = np.fft.rfftfreq(record.n_samples, 1.0 / record.rate_hz)
        slow += float(np.sum(power[hz < 0.5 * float(model.modes.frequency_hz.min())]))
        whole += float(np.sum(power))
    return slow / whole if whole > 0.0 else 0.0


def _own_record(record: AxesRecord, model: AxesModel, axis: int, gain: float) -> Recording:
    """Return what one axis would do by itself and at rest, with all that the model leaves of it."""
    steps = np.full(record.n_samples, 1.0 / record.rate_hz)
    drive = record.voltage_v[:, axis]
    state = model.axes[axis].initial_state()
    if record.is_periodic:
        model.axes[axis].simulate(steps, drive, state)
    moved = gain * model.axes[axis].simulate(steps, drive, state) + record.residual_um(model)[:, axis]
    time = np.arange(record.n_samples) / record.rate_hz
    return Recording(time, drive, moved, name=f"{record.name}, axis {axis + 1}")


def _next_experiment(found: AxesDiagnosis) -> str:
    if any(record.is_periodic for record in found.records) is False:
        return "two or more periods of a multisine on all axes at once, so that the noise is known apart from the model"
    tied = [finding for finding in found.findings if finding.tied]
    if tied:
        return f"{tied[0].experiment}, to tell {tied[0].cause} from {', '.join(tied[0].tied)}"
    if found.findings and found.status is not Status.EXPLAINED:
        return f"{found.findings[0].experiment}, to see {found.findings[0].cause} alone"
    levels = [record.level_v for record in found.records]
    if max(levels) < 1.15 * min(levels):
        return "the same drive at two more levels: modes that follow the level are not seen at one"
    if found.status is Status.UNEXPLAINED:
        return "each axis by itself, slowly, so that one-axis causes are seen without modes"
    return (
        "nothing: what was recorded agrees with the model to its noise"
        if not found.findings
        else ("the same once more with the extended model, to see that it holds")
    )

"""The linear part of a model under fit: displacement per unit weight, and what the linear part can explain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.least_squares import gram_of, product, whitening_of
from fomrc_core.compute.pulse import beat
from fomrc_core.effects import Effect, Stage
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.play_columns import ColumnKinds, creep_columns
from fomrc_core.fitting.trial_model import (
    FIT_ACCURACY,
    TrialModel,
    fit_modes,
    needs_rate_within_steps,
    predict,
    relaxed_trial,
)
from fomrc_core.fitting.work_of_run import operations_of_columns
from fomrc_core.model.divided_drive import ElementDrive
from fomrc_core.model.simulation import before_record, displacement_of_parts, drive_at_elements, of_stage
from fomrc_core.model.substeps import Substeps
from fomrc_core.operators.creep import creep_modes

_ORDER_STEP = 1e-4  # of the creep order [1]: some hundredths of a usual one, far above the rounding of a simulation
MIN_ORDER, MAX_ORDER = 0.0, 1.0  # creep orders a model may have


@dataclass(frozen=True, eq=False)
class Tangent:
    """Directions in which the linear part can move, and how to remove them from a signal.

    Attributes:
        columns: per record, displacement for a unit change of each weight and, last, of the creep order, less its
            mean over the used samples, shape (n_samples, n_columns + 1).
        whitening: turns the columns into orthonormal ones over the used samples, shape (n_columns + 1, rank).
    """

    columns: tuple[Array, ...]
    whitening: Array

    @classmethod
    def none(cls, trial: TrialModel, records: tuple[FitRecord, ...]) -> Tangent:
        """Return no directions at all: the linear part is held."""
        n_columns = trial.weights.size + 1
        return cls(tuple(np.zeros((r.time_s.size, n_columns)) for r in records), np.zeros((n_columns, 1)))

    def solve(self, records: tuple[FitRecord, ...], signals: tuple[Array, ...]) -> Array:
        """Return the change of weights and creep order that fits the signals best, shape (n_columns + 1,)."""
        moment = sum(product(c, s, r.is_used) for c, r, s in zip(self.columns, records, signals, strict=True))
        return np.asarray(self.whitening @ (self.whitening.T @ moment))

    def remove(self, records: tuple[FitRecord, ...], signals: tuple[Array, ...]) -> tuple[Array, ...]:
        """Return the signals less what the linear part could explain of them."""
        coefficients = self.solve(records, signals)
        return tuple(s - c @ coefficients for s, c in zip(signals, self.columns, strict=True))


def centred(values: Array, is_used: Mask) -> Array:
    """Return the values less their mean over the used samples: what an unknown offset leaves."""
    used = values if np.all(is_used) else values[is_used]  # copying all rows would cost more than the mean
    return np.asarray(values - np.mean(used, axis=0))


def residuals(trial: TrialModel, records: tuple[FitRecord, ...]) -> tuple[Array, ...]:
    """Return measured minus predicted, offset removed [um], per record."""
    return tuple(centred(r.measured_um - predict(trial, r, i), r.is_used) for i, r in enumerate(records))


def squared_error(records: tuple[FitRecord, ...], signals: tuple[Array, ...]) -> float:
    """Return the sum of squares over the used samples [um^2], at least that of the rounding of what was measured."""
    sums, rounding = 0.0, 0.0
    for record, signal in zip(records, signals, strict=True):
        used = signal[record.is_used]
        sums += float(np.dot(used, used))
        rounding += used.size * float(np.spacing(np.max(np.abs(record.measured_um)))) ** 2
    return max(sums, rounding)


def record_columns(trial: TrialModel, record: FitRecord, index: int, about: TrialModel | None = None) -> Array:
    """Return displacement per unit weight [V], shape (n_samples, n_columns).

    A fit measures its residual exactly and uses these columns as directions only, so that one step per sample
    suffices, but not where a mass rings or an amplifier lags: there the bend within a large step has a phase, and
    wrong directions would leave a fit short of its least error.

    Args:
        trial: the model whose columns, effects and start they are.
        record: the record.
        index: which record it is.
        about: the model whose displacement effects on the sensor are linearized about; ``trial`` unless given.
    """
    effects = trial.effects_in(index)
    is_divided = record.substeps is not Substeps.NONE and any(effect.needs_substeps for effect in effects)
    substeps = Substeps.FEW if is_divided else Substeps.NONE
    if record.substeps is Substeps.BENDS and needs_rate_within_steps(effects):
        substeps = Substeps.FIT
    before, drive = _element_drives(trial, record, index, substeps)
    steps_s = np.concatenate((before.steps_s, drive.steps_s))
    voltage_v = np.concatenate((before.voltage_v, drive.voltage_v))
    mechanical = of_stage(effects, Stage.MECHANICAL)
    n_before = before.steps_s.size
    n_skipped = 0 if mechanical else n_before
    widening = None
    if drive.widening is not None:
        earlier = np.ones(n_before) if before.widening is None else before.widening
        widening = np.concatenate((earlier, drive.widening))
    modes = fit_modes(trial)
    columns = creep_columns(trial.columns, modes, voltage_v, steps_s, n_skipped, widening)
    beat("simulations", columns.shape[1])
    record.tally.add(operations_of_columns(columns.size, modes.n_modes, len(effects)))
    for effect in mechanical:
        # a clock that starts with the record sees nothing of what went before it
        first = 0 if effect.acts_before_record() else n_before
        values = None
        if effect.slope_depends_on_input:
            values = _input_of(effect, about or trial, record, index, (before, drive))[first:]
        passed = effect.linearized(columns[first:], steps_s[first:], values)
        if effect.follows_elements:
            passed = passed + _of_plays(effect, trial.columns, voltage_v, steps_s)[first:]
        if first == 0:
            columns = passed
        else:
            columns[first:] = passed
    columns = np.ascontiguousarray(drive.at_samples(columns[n_before - n_skipped :]))
    beat("simulations", 0)
    for effect in of_stage(effects, Stage.SENSED):
        values = None
        if effect.slope_depends_on_input:
            values = _input_of(effect, about or trial, record, index, (before, drive))
        columns = effect.linearized(columns, record.steps_s, values)
    return columns


def _of_plays(effect: Effect, columns: ColumnKinds, drive_v: Array, steps_s: Array) -> Array:
    """Return what each column makes an effect add that follows the elements, shape (n_samples, n_columns)."""
    added = np.zeros((drive_v.size, columns.thresholds_v.size))
    plays = columns.is_plain & (columns.thresholds_v > 0.0)
    chosen = columns.chosen(plays)
    plays_v = creep_columns(chosen, creep_modes(0.0, FIT_ACCURACY), drive_v, steps_s)
    added[:, plays] = effect.of_plays(chosen.thresholds_v, plays_v, steps_s)
    return added


def _element_drives(
    trial: TrialModel, record: FitRecord, index: int, substeps: Substeps
) -> tuple[ElementDrive, ElementDrive]:
    """Return what the elements see before a record, which may be nothing, and in it."""
    effects = trial.effects_in(index)
    state, _ = relaxed_trial(trial, effects)
    largest_v = float(np.max(trial.columns.thresholds_v))
    before, start = ElementDrive(np.zeros(0), np.zeros(0), None), trial.start_of(index)
    if start is not None:
        before = drive_at_elements(state, before_record(effects), *start.drive(), substeps, largest_v)
    return before, drive_at_elements(state, effects, record.steps_s, record.voltage_v, substeps, largest_v)


def _input_of(
    effect: Effect, about: TrialModel, record: FitRecord, index: int, drives: tuple[ElementDrive, ElementDrive]
) -> Array:
    """Return the displacement an effect is given [um]: at all parts for a mechanical one, else at the samples."""
    before, drive = drives
    effects = about.effects_in(index)
    earlier = effects[: [e.name for e in effects].index(effect.name)]
    state, at_creep = relaxed_trial(about, effects)
    moved_before = displacement_of_parts(state, at_creep, before_record(earlier), before)
    moved = displacement_of_parts(state, at_creep, earlier, drive)
    if effect.stage is Stage.MECHANICAL:
        return np.concatenate((moved_before, moved))
    values = drive.at_samples(moved)
    for sensed in of_stage(earlier, Stage.SENSED):
        covariate = record.covariates.of(sensed.covariate)
        values = sensed.run(state.effects[sensed.name], values, record.steps_s, covariate)
    return values


def order_slope(trial: TrialModel, record: FitRecord, index: int) -> Array:
    """Return the change of the displacement with the creep order [um], by differences, shape (n_samples,)."""
    step = _ORDER_STEP if trial.creep_order + _ORDER_STEP <= MAX_ORDER else -_ORDER_STEP
    ahead = replace(trial, creep_order=trial.creep_order + step)
    return (predict(ahead, record, index, is_coarse=True) - predict(trial, record, index, is_coarse=True)) / step


def tangent(trial: TrialModel, records: tuple[FitRecord, ...]) -> Tangent:
    """Return the directions in which the linear part can move at a model under fit."""
    parts = []
    for index, record in enumerate(records):
        slope = np.zeros(record.time_s.size) if trial.replaces_creep else order_slope(trial, record, index)
        columns = np.column_stack((record_columns(trial, record, index), slope))
        parts.append(centred(columns, record.is_used))
    return Tangent(tuple(parts), whitening_of(gram_of((c, r.is_used) for c, r in zip(parts, records, strict=True))))


def moved(trial: TrialModel, change: Array) -> TrialModel:
    """Return the model with weights and, last, creep order changed; the order stays within what a model may have."""
    order = float(np.clip(trial.creep_order + change[-1], MIN_ORDER, MAX_ORDER))
    if trial.replaces_creep:
        order = trial.creep_order
    return replace(trial, weights=trial.weights + change[:-1], creep_order=order)

"""The linear part of a fit: weights of the operators, creep order and offsets, by least squares."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.least_squares import product, signed_weights, whitening_of
from fomrc_core.effects import Stage
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.gain_drift import GainDrift
from fomrc_core.effects.initial_state import InitialState
from fomrc_core.effects.sensor_nonlinearity import SensorNonlinearity
from fomrc_core.errors import RecordingError
from fomrc_core.fitting.play_columns import ColumnKinds, creep_columns
from fomrc_core.fitting.trial_model import FitRecord, TrialModel, fit_modes, predict
from fomrc_core.model.substeps import parts_of_steps, subdivide
from fomrc_core.records.drive import begins_at_zero

Array = NDArray[np.float64]

FIRST_ORDER_GUESS = 0.02
_ORDER_STEP = 1e-4
_MIN_ORDER, _MAX_ORDER = 0.0, 0.6
_N_PARTS = 4


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

    def solve(self, records: tuple[FitRecord, ...], signals: tuple[Array, ...]) -> Array:
        """Return the change of weights and creep order that fits the signals best, shape (n_columns + 1,)."""
        moment = sum(product(c, s, r.is_used) for c, r, s in zip(self.columns, records, signals, strict=True))
        return np.asarray(self.whitening @ (self.whitening.T @ moment))

    def remove(self, records: tuple[FitRecord, ...], signals: tuple[Array, ...]) -> tuple[Array, ...]:
        """Return the signals less what the linear part could explain of them."""
        coefficients = self.solve(records, signals)
        return tuple(s - c @ coefficients for s, c in zip(signals, self.columns, strict=True))


def threshold_grid(records: tuple[FitRecord, ...], n_thresholds: int) -> Array:
    """Return thresholds [V] over what the drives reach, zero first, denser near zero, shape (n_thresholds + 1,)."""
    reach = max(float(np.max(np.abs(r.voltage_v))) for r in records)
    span = max(float(np.ptp(r.voltage_v)) for r in records)
    if not span > 0.0:
        name, value = records[0].recording.name, float(records[0].voltage_v[0])
        raise RecordingError("voltage is constant", where=name, value=value, allowed="a voltage that moves")
    # A play moves on a first rise up to the reach; once the drive has turned, up to half the span.
    top = max(reach, 0.5 * span)
    return np.asarray(top * (np.arange(n_thresholds + 1) / n_thresholds) ** 1.6)[:-1]


def centred(values: Array, is_used: NDArray[np.bool_]) -> Array:
    """Return the values less their mean over the used samples: what an unknown offset leaves."""
    return np.asarray(values - np.mean(values[is_used], axis=0))


def residuals(chain: TrialModel, records: tuple[FitRecord, ...]) -> tuple[Array, ...]:
    """Return measured minus predicted, offset removed [um], per record."""
    return tuple(centred(r.measured_um - predict(chain, r, i), r.is_used) for i, r in enumerate(records))


def squared_error(records: tuple[FitRecord, ...], signals: tuple[Array, ...]) -> float:
    """Return the sum of squares over the used samples [um^2]."""
    return float(sum(np.dot(s[r.is_used], s[r.is_used]) for r, s in zip(records, signals, strict=True)))


def record_columns(chain: TrialModel, record: FitRecord, index: int, about: TrialModel | None = None) -> Array:
    """Return displacement per unit weight [V], shape (n_samples, n_columns).

    A fit measures its residual exactly and uses these columns as directions only, so that one step per sample
    suffices, but not where a mass rings or an amplifier lags: there the bend within a large step has a phase, and
    wrong directions would leave a fit short of its least error. A sensor that is not linear turns them by its slope
    where the displacement of ``about`` (the chain itself unless given) stands.
    """
    effects = chain.effects_in(index)
    steps, drive = record.steps_s, record.voltage_v
    for effect in effects:
        if effect.stage is Stage.SAMPLED_DRIVE:
            drive = effect.run(effect.initial_state(), drive, steps)
    n_before = 0
    for effect in effects:
        if isinstance(effect, InitialState):
            before_steps, before = effect.prehistory()
            n_before = before.size
            steps, drive = np.concatenate((before_steps, steps)), np.concatenate((before, drive))
    ends = None
    if any(effect.needs_substeps for effect in effects):
        change = np.diff(drive, prepend=drive[0])
        parts, _ = parts_of_steps(change, float(np.max(chain.columns.thresholds_v)), effects, is_coarse=True)
        if np.any(parts > 1):
            steps, drive, ends = subdivide(steps, drive, float(drive[0]), np.minimum(parts, _N_PARTS))
    for effect in effects:
        if effect.stage is Stage.DRIVE:
            drive = effect.run(effect.initial_state(), drive, steps)
    for effect in effects:
        if isinstance(effect, AsymmetricHysteresis):
            drive = effect.warp(drive)
    mechanical = [effect for effect in effects if effect.stage is Stage.MECHANICAL]
    n_skipped = 0 if mechanical or ends is not None else n_before
    columns = creep_columns(chain.columns, fit_modes(chain.creep_order), drive, steps, n_skipped)
    if mechanical:
        for j in range(columns.shape[1]):
            column = np.ascontiguousarray(columns[:, j])
            for effect in mechanical:
                column = effect.run(effect.initial_state(), column, steps)
            columns[:, j] = column
    if ends is not None:
        columns = columns[ends[n_before:]]
    elif mechanical:
        columns = columns[n_before:]
    for effect in effects:
        if isinstance(effect, GainDrift):
            columns *= (1.0 + effect.per_s * record.time_s)[:, None]
        elif isinstance(effect, SensorNonlinearity):
            x = predict((about or chain).without(effect.name), record, index, is_coarse=True)
            columns *= (1.0 + x * (2.0 * effect.quadratic_per_um + 3.0 * effect.cubic_per_um2 * x))[:, None]
    return columns


def tangent(chain: TrialModel, records: tuple[FitRecord, ...]) -> Tangent:
    """Return the tangent space of the linear part at the chain."""
    step = _ORDER_STEP if chain.creep_order + _ORDER_STEP <= 1.0 else -_ORDER_STEP
    moved = replace(chain, creep_order=chain.creep_order + step)
    parts = []
    gram = np.zeros((chain.weights.size + 1,) * 2)
    for index, record in enumerate(records):
        slope = (predict(moved, record, index, is_coarse=True) - predict(chain, record, index, is_coarse=True)) / step
        columns = np.column_stack((record_columns(chain, record, index), slope))
        columns = centred(columns, record.is_used)
        used = columns if np.all(record.is_used) else columns[record.is_used]
        gram += used.T @ used
        parts.append(columns)
    return Tangent(tuple(parts), whitening_of(gram))


def moved(chain: TrialModel, change: Array) -> TrialModel:
    """Return the chain with weights and, last, creep order changed."""
    order = float(np.clip(chain.creep_order + change[-1], _MIN_ORDER, _MAX_ORDER))
    return replace(chain, weights=chain.weights + change[:-1], creep_order=order)


def fit_base(
    records: tuple[FitRecord, ...],
    columns: ColumnKinds,
    record_effects: tuple[tuple[InitialState, ...], ...] | None = None,
    order_guess: float = FIRST_ORDER_GUESS,
) -> tuple[TrialModel, Tangent, float]:
    """Return the chain without effects that fits best, its tangent, and its sum of squares [um^2].

    Least squares in the weights, Gauss-Newton in the creep order; no start values are needed.
    """
    own = record_effects or tuple(() for _ in records)
    weights = np.zeros(columns.thresholds_v.size)
    weights[0] = 1.0
    chain = TrialModel(columns, weights, order_guess, (), own)
    space = None
    for _ in range(8):
        parts = tuple(record_columns(chain, r, i) for i, r in enumerate(records))
        chain = replace(chain, weights=_least_squares(records, parts))
        space = tangent(chain, records)
        change = space.solve(records, residuals(chain, records))
        before = chain.creep_order
        chain = moved(chain, _damped(change))
        if abs(chain.creep_order - before) < 2e-5:
            break
    assert space is not None
    left = residuals(chain, records)
    chain = moved(chain, np.append(space.solve(records, left)[:-1], 0.0))
    return chain, space, squared_error(records, residuals(chain, records))


def rebased(chain: TrialModel, records: tuple[FitRecord, ...]) -> TrialModel:
    """Return the chain with its plays chosen anew from its grid: those that get weight when none may be negative.

    Weights of either sign on the whole grid can imitate a lag with hysteresis no ceramic has, so the physical sign
    is asked for here; a refit may then move the weights of what was chosen freely.
    """
    if chain.grid_v is None:
        return chain
    kneed = np.isfinite(chain.columns.knees_v)
    knees = ColumnKinds(chain.columns.thresholds_v[kneed], chain.columns.knees_v[kneed], chain.columns.kinds[kneed])
    columns = ColumnKinds.plays(chain.grid_v).joined(knees)
    n_grid, n = chain.grid_v.size, columns.thresholds_v.size
    full = replace(chain, columns=columns, weights=np.zeros(n))
    gram, moment = np.zeros((n, n)), np.zeros(n)
    for index, (record, left) in enumerate(zip(records, residuals(chain, records), strict=True)):
        here = centred(record_columns(full, record, index, chain), record.is_used)
        target = left + centred(record_columns(chain, record, index), record.is_used) @ chain.weights
        gram += product(here, here, record.is_used)
        moment += product(here, target, record.is_used)
    is_positive = np.arange(n) < n_grid
    weights = signed_weights(gram, moment, is_positive)
    active = weights[:n_grid] > 1e-9 * float(np.max(weights[:n_grid]))
    active[0] = True
    chosen = np.concatenate((active, np.ones(n - n_grid, dtype=np.bool_)))
    chosen_columns = ColumnKinds(columns.thresholds_v[chosen], columns.knees_v[chosen], columns.kinds[chosen])
    return replace(chain, columns=chosen_columns, weights=weights[chosen])


def _damped(change: Array) -> Array:
    # far from the answer the linear step in the order overshoots
    limit = 0.05
    if abs(change[-1]) > limit:
        change = change.copy()
        change[-1] = np.sign(change[-1]) * limit
    return change


def _least_squares(records: tuple[FitRecord, ...], parts: tuple[Array, ...]) -> Array:
    gram: Array | float = 0.0
    moment: Array | float = 0.0
    for record, columns in zip(records, parts, strict=True):
        c = centred(columns, record.is_used)[record.is_used]
        gram = gram + c.T @ c
        moment = moment + c.T @ (record.measured_um - np.mean(record.measured_um[record.is_used]))[record.is_used]
    whitening = whitening_of(np.asarray(gram))
    return np.asarray(whitening @ (whitening.T @ moment))


def choose_starts(records: tuple[FitRecord, ...]) -> tuple[tuple[InitialState, ...], ...]:
    """Return for each record whether it begins relaxed (nothing) or after a long rest at its first voltage.

    A record that begins near zero volts begins relaxed; for another both are fitted with few thresholds and the
    better one is taken.
    """
    starts: list[tuple[InitialState, ...]] = []
    for record in records:
        if begins_at_zero(record.voltage_v):
            starts.append(())
            continue
        one = (record,)
        columns = ColumnKinds.plays(threshold_grid(one, 12))
        relaxed = fit_base(one, columns)[2]
        rested = fit_base(one, columns, ((record.at_rest(),),))[2]
        starts.append((record.at_rest(),) if rested < relaxed else ())
    return tuple(starts)

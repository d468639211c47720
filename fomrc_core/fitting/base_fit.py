"""The base of a fit: hysteresis and creep alone, by least squares in the weights and Gauss-Newton in the order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fomrc_core.compute.arrays import Array, Mask
from fomrc_core.compute.least_squares import normal_equations, signed_weights
from fomrc_core.errors import RecordingError
from fomrc_core.fitting.fit_record import FitRecord, shortest_time
from fomrc_core.fitting.linear_part import Tangent, centred, moved, record_columns, residuals, squared_error, tangent
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.records.drive import begins_at_zero

FIRST_ORDER_GUESS = 0.02  # of a piezo ceramic; the fit leaves it at once
_N_FITS = 8  # of the order: two or three do
_LONGEST_ORDER_STEP = 0.05  # far from the answer the linear step in the order overshoots
_ORDER_STILL = 2e-5  # a change of the order [1] that changes a displacement by less than a part in ten thousand
_DENSER_NEAR_ZERO = 1.6  # power of the grid of thresholds
_N_START_THRESHOLDS = 12  # to tell how a record begins few suffice
_WEIGHTLESS = 1e-9  # of the largest weight


def threshold_grid(records: tuple[FitRecord, ...], n_thresholds: int) -> Array:
    """Return thresholds [V] over what the drives reach, zero first, denser near zero, shape (n_thresholds + 1,)."""
    if not any(np.ptp(r.voltage_v) > 0.0 for r in records):
        name, value = records[0].recording.name, float(records[0].voltage_v[0])
        raise RecordingError("voltage is constant", where=name, value=value, allowed="a voltage that moves")
    return np.asarray(widest_play_v(records) * (np.arange(n_thresholds + 1) / n_thresholds) ** _DENSER_NEAR_ZERO)[:-1]


def widest_play_v(records: tuple[FitRecord, ...]) -> float:
    """Return the threshold of the widest play that the drives move [V].

    A play moves on a first rise up to the reach of the drive; once that has turned, up to half its span.
    """
    return max(max(float(np.max(np.abs(r.voltage_v))), 0.5 * float(np.ptp(r.voltage_v))) for r in records)


def fit_base(
    records: tuple[FitRecord, ...],
    columns: ColumnKinds,
    starts: tuple[Prehistory | None, ...] = (),
    order_guess: float = FIRST_ORDER_GUESS,
    shortest_time_s: float | None = None,
) -> tuple[TrialModel, Tangent, float]:
    """Return the model without effects that fits best, its tangent, and its sum of squares [um^2].

    Least squares in the weights, Gauss-Newton in the creep order; no start values are needed.

    Args:
        records: what to fit.
        columns: plays of the elements.
        starts: what went before each record; relaxed where not given.
        order_guess: creep order to begin with [1].
        shortest_time_s: shortest time creep must hold for [s]; that of these records where not given.
    """
    weights = np.zeros(columns.thresholds_v.size)
    weights[0] = 1.0
    nothing = tuple(() for _ in records)
    shortest_s = shortest_time(records) if shortest_time_s is None else shortest_time_s
    trial = TrialModel(columns, weights, order_guess, (), nothing, starts=starts, shortest_time_s=shortest_s)
    directions = None
    for _ in range(_N_FITS):
        equations = normal_equations(
            (centred(record_columns(trial, r, i), r.is_used), centred(r.measured_um, r.is_used), r.is_used)
            for i, r in enumerate(records)
        )
        trial = replace(trial, weights=equations.solution())
        directions = tangent(trial, records)
        change = directions.solve(records, residuals(trial, records))
        before = trial.creep_order
        trial = moved(trial, _with_short_order_step(change))
        if abs(trial.creep_order - before) < _ORDER_STILL:
            break
    assert directions is not None
    change = directions.solve(records, residuals(trial, records))
    trial = moved(trial, np.append(change[:-1], 0.0))
    return trial, directions, squared_error(records, residuals(trial, records))


def rebased(trial: TrialModel, records: tuple[FitRecord, ...], left_um: tuple[Array, ...] | None = None) -> TrialModel:
    """Return the model with its plays chosen anew from its grid: those that get weight when none may be negative.

    Weights of either sign on the whole grid can imitate a lag with hysteresis no ceramic has, so the physical sign
    is asked for here; a refit may then move the weights of what was chosen freely.

    Args:
        trial: the model.
        records: what it is fitted to.
        left_um: what it leaves of each record [um]; simulated unless given.
    """
    if trial.grid_v is None:
        return trial
    owned = trial.columns.chosen(~trial.columns.is_plain)
    columns = ColumnKinds.plays(trial.grid_v).joined(owned)
    n_grid, n = trial.grid_v.size, columns.thresholds_v.size
    full = replace(trial, columns=columns, weights=np.zeros(n))
    present = _among(trial, trial.grid_v, n)

    def rows(index: int, record: FitRecord, residual_um: Array) -> tuple[Array, Array, Mask]:
        here = centred(record_columns(full, record, index, trial), record.is_used)
        if present is not None:
            return here, residual_um + here @ present, record.is_used
        present_um = centred(record_columns(trial, record, index), record.is_used) @ trial.weights
        return here, residual_um + present_um, record.is_used

    left_um = residuals(trial, records) if left_um is None else left_um
    equations = normal_equations(rows(i, r, v) for i, (r, v) in enumerate(zip(records, left_um, strict=True)))
    weights = signed_weights(equations.gram, equations.moment, columns.is_plain)
    active = ~columns.is_plain | (weights > _WEIGHTLESS * float(np.max(weights[:n_grid])))
    active[0] = True
    return replace(trial, columns=columns.chosen(active), weights=weights[active])


def _among(trial: TrialModel, grid_v: Array, n_columns: int) -> Array | None:
    """Return the weights of a model on the columns of its grid and its own.

    None where a play is not of the grid, or an effect makes of each column what depends on the weights of all.
    """
    if any(effect.follows_elements for effect in trial.effects):
        return None
    plain = trial.columns.is_plain
    at = np.minimum(np.searchsorted(grid_v, trial.columns.thresholds_v[plain]), grid_v.size - 1)
    if not np.array_equal(grid_v[at], trial.columns.thresholds_v[plain]):
        return None
    weights = np.zeros(n_columns)
    np.add.at(weights, at, trial.weights[plain])
    weights[grid_v.size :] = trial.weights[~plain]
    return weights


def _with_short_order_step(change: Array) -> Array:
    if abs(change[-1]) <= _LONGEST_ORDER_STEP:
        return change
    return np.append(change[:-1], np.sign(change[-1]) * _LONGEST_ORDER_STEP)


def choose_starts(records: tuple[FitRecord, ...]) -> tuple[Prehistory | None, ...]:
    """Return for each record whether it begins relaxed (None) or after a long rest at its first voltage.

    A record that begins near zero volts begins relaxed; for another both are fitted with few thresholds and the
    better one is taken.
    """
    starts: list[Prehistory | None] = []
    for record in records:
        if begins_at_zero(record.voltage_v):
            starts.append(None)
            continue
        columns = ColumnKinds.plays(threshold_grid((record,), _N_START_THRESHOLDS))
        options = (None, record.at_rest())
        errors = [fit_base((record,), columns, (start,))[2] for start in options]
        starts.append(options[int(np.argmin(errors))])
    return tuple(starts)

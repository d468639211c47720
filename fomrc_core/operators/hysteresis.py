"""Hysteresis: the Maxwell resistive capacitor, equations (15)-(17), in both directions without iteration.

Displacement to voltage is a sum of stop operators (elements in series, each limited at its saturation voltage).
Its inverse, voltage to displacement, is a sum of play operators with thresholds and weights in closed form
(Krejci and Kuhnen 2001, references 5 and 6 of the paper):

    voltage      = slope * displacement + sum_j weight_j * stop_{threshold_j}[displacement],
    displacement = slope * voltage      + sum_j weight_j * play_{threshold_j}[voltage].

A stop is its input less a play, so both keep play states: absolute values of the input, nothing is summed up
and nothing drifts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled_inline, compiled_sums
from fomrc_core.compute.vector_registers import in_whole_registers
from fomrc_core.errors import ParameterError

Array = NDArray[np.float64]

# Layout of a hysteresis block in a packed array: header, then thresholds, weights, play states.
N_PLAYS, SLOPE, HEADER = range(3)
_NEVER = 1e300  # a threshold that nothing passes, widened or not


@dataclass(frozen=True, eq=False)
class OperatorSum:
    """A slope and a weighted sum of play or of stop operators.

    Attributes:
        slope: weight of the input itself [output/input].
        thresholds: half-widths of the operators [input], ascending, shape (n_plays,).
        weights: their weights [output/input], shape (n_plays,).
    """

    slope: float
    thresholds: Array
    weights: Array


def check_elements(kappa_um_per_v: Array, saturation_v: Array, where: str = "model") -> tuple[Array, Array]:
    """Return both arrays as float64; raises ParameterError unless n + 1 and n positive finite numbers."""
    kappa = _positive(kappa_um_per_v, f"{where}.kappa_um_per_v")
    saturation = _positive(saturation_v, f"{where}.saturation_v")
    if kappa.size != saturation.size + 1:
        raise ParameterError(
            "number of kappa_um_per_v does not fit saturation_v",
            where=where,
            value=kappa.size,
            allowed=f"{saturation.size + 1}, one more than saturation_v",
        )
    return kappa, saturation


def _positive(values: object, where: str) -> Array:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ParameterError("not a list of numbers", where=where, value=values, allowed="finite, > 0") from None
    if array.ndim != 1 or array.dtype != np.float64:
        raise ParameterError("not a flat list", where=where, value=array.shape, allowed="shape (n,)")
    bad = ~(np.isfinite(array) & (array > 0.0))
    if np.any(bad):
        k = int(np.argmax(bad))
        raise ParameterError(f"entry {k} out of range", where=where, value=float(array[k]), allowed="finite, > 0")
    return array


def stop_form(kappa_um_per_v: Array, saturation_v: Array) -> OperatorSum:
    """Return displacement -> voltage, (15)-(17), a sum of stops: thresholds [um], slope and weights [V/um].

    Args:
        kappa_um_per_v: gains [um/V], shape (n + 1,); the last element never saturates.
        saturation_v: saturation voltages [V], shape (n,).
    """
    compliance = 1.0 / kappa_um_per_v
    thresholds = kappa_um_per_v[:-1] * saturation_v
    order = np.argsort(thresholds, kind="stable")
    return OperatorSum(float(compliance[-1]), thresholds[order], compliance[:-1][order])


def play_form(kappa_um_per_v: Array, saturation_v: Array) -> OperatorSum:
    """Return voltage -> displacement, a sum of plays, the exact inverse of ``stop_form`` (Krejci and Kuhnen 2001).

    Holds for states that can be reached from the relaxed one; for others see ``walk_breakpoints``.

    Args:
        kappa_um_per_v: gains [um/V], shape (n + 1,).
        saturation_v: saturation voltages [V], shape (n,).
    """
    stop = stop_form(kappa_um_per_v, saturation_v)
    # s_j: slope with the j lowest elements saturated, summed from the tail to avoid cancellation
    tail = np.cumsum(np.concatenate(([stop.slope], stop.weights[::-1])))[::-1]
    rho = np.cumsum(stop.weights * stop.thresholds) + tail[1:] * stop.thresholds
    return OperatorSum(1.0 / float(tail[0]), rho, stop.weights / (tail[1:] * tail[:-1]))


def elements_from_play_form(play: OperatorSum) -> tuple[Array, Array]:
    """Return (kappa_um_per_v, saturation_v) of the Maxwell elements whose play form is given.

    The exact way back of ``play_form``: slope > 0, weights > 0 and thresholds > 0 ascending, shape (n_plays,).

    Raises:
        ParameterError: a slope, weight or threshold that is not positive.
    """
    if not play.slope > 0.0 or np.any(play.weights <= 0.0) or np.any(play.thresholds <= 0.0):
        raise ParameterError(
            "play form is not that of Maxwell elements",
            where="play form",
            value=(play.slope, *play.weights.tolist()),
            allowed="all > 0",
        )
    order = np.argsort(play.thresholds, kind="stable")
    rho, g = play.thresholds[order], play.weights[order]
    gain = play.slope + np.concatenate(([0.0], np.cumsum(g)))  # slope with the j lowest plays moving
    compliance = g / (gain[1:] * gain[:-1])
    # the displacement at which play j begins to move on the first rising curve
    thresholds = play.slope * rho + np.array([np.sum(g[:j] * (rho[j] - rho[:j])) for j in range(rho.size)])
    return np.concatenate((1.0 / compliance, [gain[-1]])), thresholds * compliance


def displacement_stops_to_voltage_stops(stop: OperatorSum, stops_um: Array) -> Array:
    """Return the stop values [V] of the play form that belong to element stretches [um], shape (n,).

    The exact passage between the two forms' states, for reachable states: with thresholds ascending,
    sigma_j = sum_{i<j} w_i s_i + (sum_{i>=j} w_i + slope) s_j.
    """
    tail = stop.slope + np.cumsum(stop.weights[::-1])[::-1]
    below = np.concatenate(([0.0], np.cumsum(stop.weights * stops_um)[:-1]))
    return below + tail * stops_um


def voltage_stops_to_displacement_stops(stop: OperatorSum, stops_v: Array) -> Array:
    """Return element stretches [um] from the stop values [V] of the play form; the inverse passage."""
    tail = stop.slope + np.cumsum(stop.weights[::-1])[::-1]
    stretches = np.empty(stop.weights.size)
    below = 0.0
    for j in range(stretches.size):
        stretches[j] = (stops_v[j] - below) / tail[j]
        below += stop.weights[j] * stretches[j]
    return stretches


@compiled_inline
def _fields(packed: Array, at: int) -> tuple[int, Array, Array, Array]:
    n_plays = int(packed[at + N_PLAYS])
    first = at + HEADER
    thresholds = packed[first : first + n_plays]
    weights = packed[first + n_plays : first + 2 * n_plays]
    return n_plays, thresholds, weights, packed[first + 2 * n_plays : first + 3 * n_plays]


@compiled_inline
def move_plays(packed: Array, at: int, value: float) -> float:
    """Return the play sum at the new input; the play states of the block move on."""
    n_plays, thresholds, weights, plays = _fields(packed, at)
    total = 0.0
    for j in range(n_plays):
        play = min(max(plays[j], value - thresholds[j]), value + thresholds[j])
        plays[j] = play
        total += weights[j] * play
    output: float = packed[at + SLOPE] * value + total
    return output


@compiled_inline
def move_stops(packed: Array, at: int, value: float) -> float:
    """Return the stop sum at the new input; the play states of the block move on."""
    n_plays, thresholds, weights, plays = _fields(packed, at)
    total = 0.0
    for j in range(n_plays):
        # A saturated stop is exactly its threshold: input less play would carry the rounding of the input.
        stop = min(max(value - plays[j], -thresholds[j]), thresholds[j])
        plays[j] = value - stop
        total += weights[j] * stop
    output: float = packed[at + SLOPE] * value + total
    return output


@compiled_inline
def peek_stops(packed: Array, at: int, value: float) -> float:
    """Return the stop sum at an input; the state stays as it is."""
    n_plays, thresholds, weights, plays = _fields(packed, at)
    total = 0.0
    for j in range(n_plays):
        total += weights[j] * min(max(value - plays[j], -thresholds[j]), thresholds[j])
    output: float = packed[at + SLOPE] * value + total
    return output


@compiled_sums
def move_plays_batch(packed: Array, at: int, values: Array, out: Array) -> None:
    """Fill ``out`` with the play sum for each input, shape (n_samples,); the block's state moves on.

    ``out`` may be ``values`` itself.
    """
    # The same loop as move_plays once more: views made once, not per sample.
    n_plays, thresholds, weights, plays = _fields(packed, at)
    slope = packed[at + SLOPE]
    for k in range(values.size):
        value = values[k]
        total = 0.0
        for j in range(n_plays):
            play = min(max(plays[j], value - thresholds[j]), value + thresholds[j])
            plays[j] = play
            total += weights[j] * play
        out[k] = slope * value + total


@compiled_inline
def _whole_registers(thresholds: Array, weights: Array, plays: Array) -> tuple[Array, Array, Array]:
    """Return thresholds, weights and states of plays, and of so many more that never move and weigh nothing."""
    n_plays = plays.size
    n_whole = in_whole_registers(n_plays)
    widths, shares, moved = np.full(n_whole, _NEVER), np.zeros(n_whole), np.zeros(n_whole)
    for j in range(n_plays):
        widths[j], shares[j], moved[j] = thresholds[j], weights[j], plays[j]
    return widths, shares, moved


@compiled_sums
def move_plays_at_once(packed: Array, at: int, values: Array, widening: Array, out: Array) -> None:
    """Fill ``out`` with the play sum for each input, to rounding, shape (n_samples,); the block's state moves on.

    In whole vector registers, so that sums are in another order. Thresholds are widened as by
    ``move_widened_plays_batch``, by nothing where no factor is given. ``out`` may be ``values`` itself.
    """
    n_plays, thresholds, weights, plays = _fields(packed, at)
    widths, shares, moved = _whole_registers(thresholds, weights, plays)
    slope, is_widened = packed[at + SLOPE], widening.size > 0
    for k in range(values.size):
        value, factor = values[k], widening[k] if is_widened else 1.0
        total = 0.0
        for j in range(moved.size):
            threshold = factor * widths[j]
            play = min(max(moved[j], value - threshold), value + threshold)
            moved[j] = play
            total += shares[j] * play
        out[k] = slope * value + total
    for j in range(n_plays):
        plays[j] = moved[j]


@compiled_sums
def move_widened_plays_batch(packed: Array, at: int, values: Array, widening: Array, out: Array) -> None:
    """Fill ``out`` with the play sum for each input, all thresholds times a factor of each sample, (n_samples,).

    A play whose threshold shrinks is taken along by its walls, as by an input that moves.
    """
    n_plays, thresholds, weights, plays = _fields(packed, at)
    slope = packed[at + SLOPE]
    for k in range(values.size):
        value, factor = values[k], widening[k]
        total = 0.0
        for j in range(n_plays):
            threshold = factor * thresholds[j]
            play = min(max(plays[j], value - threshold), value + threshold)
            plays[j] = play
            total += weights[j] * play
        out[k] = slope * value + total


@compiled_sums
def move_stops_batch(packed: Array, at: int, values: Array, out: Array) -> None:
    """Fill ``out`` with the stop sum for each input, shape (n_samples,); the block's state moves on.

    ``out`` may be ``values`` itself.
    """
    n_plays, thresholds, weights, plays = _fields(packed, at)
    slope = packed[at + SLOPE]
    for k in range(values.size):
        value = values[k]
        total = 0.0
        for j in range(n_plays):
            stop = min(max(value - plays[j], -thresholds[j]), thresholds[j])
            plays[j] = value - stop
            total += weights[j] * stop
        out[k] = slope * value + total


def hysteresis_block(form: OperatorSum, plays: Array | None = None) -> Array:
    """Return a packed hysteresis block; play states relaxed (zero) unless given, shape (n_plays,)."""
    n_plays = form.thresholds.size
    block = np.zeros(HEADER + 3 * n_plays)
    block[N_PLAYS] = n_plays
    block[SLOPE] = form.slope
    block[HEADER : HEADER + n_plays] = form.thresholds
    block[HEADER + n_plays : HEADER + 2 * n_plays] = form.weights
    if plays is not None:
        block[HEADER + 2 * n_plays :] = plays
    return block


def play_states(block: Array) -> Array:
    """Return a view of the play states of a hysteresis block, shape (n_plays,)."""
    n_plays = int(block[N_PLAYS])
    return block[HEADER + 2 * n_plays : HEADER + 3 * n_plays]


def walk_breakpoints(stop: OperatorSum, stretches_um: Array, change_v: float) -> tuple[float, Array]:
    """Return the displacement change [um] for a voltage change [V], and the new stretches, from any state.

    Voltage against displacement is monotone and piecewise linear with one breakpoint per element: walk them in
    order instead of iterating. Valid for states that no input reaches too (a changed model, a guessed start).

    Args:
        stop: the stop form, thresholds [um] and weights [V/um].
        stretches_um: present stretch of each element [um], |stretch| <= threshold, shape (n,).
        change_v: change of voltage [V].
    """
    sign = 1.0 if change_v >= 0.0 else -1.0
    room = stop.thresholds - sign * stretches_um  # displacement until each element saturates
    remaining = abs(change_v)
    travelled = 0.0
    slope = stop.slope + float(np.sum(stop.weights))
    for j in np.argsort(room, kind="stable"):
        reach = slope * (room[j] - travelled)
        if reach >= remaining:
            break
        remaining -= reach
        travelled = float(room[j])
        slope -= stop.weights[j]
    travelled += remaining / max(slope, stop.slope)
    moved = sign * np.minimum(sign * stretches_um + travelled, stop.thresholds)
    return sign * travelled, moved


def maxwell_slip_force(stiffness: Array, breakaway_force: Array, position: Array) -> Array:
    """Return the friction force of the parallel Maxwell-slip model, (1)-(2), relaxed at the start.

    The same operator as the stop form in other units: stiffness for 1/kappa, breakaway force for saturation
    voltage, and no element that never slips.

    Args:
        stiffness: spring stiffness k_i [N/m], shape (n,).
        breakaway_force: breakaway force f_i [N], shape (n,).
        position: positions x [m], shape (n_samples,).
    """
    k = _positive(stiffness, "stiffness")
    f = _positive(breakaway_force, "breakaway_force")
    if k.size != f.size:
        raise ParameterError(
            "number of breakaway forces does not fit stiffnesses",
            where="breakaway_force",
            value=f.size,
            allowed=f"{k.size}",
        )
    block = hysteresis_block(OperatorSum(0.0, f / k, k))
    values = np.ascontiguousarray(position, dtype=np.float64)
    force = np.empty(values.size)
    move_stops_batch(block, 0, values, force)
    return force

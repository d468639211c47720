"""The steps of many actuators, one after the other: rows of arrays, a row for each actuator (actuator_array.py)."""

from __future__ import annotations

from fomrc_core.compute.arrays import Array
from fomrc_core.compute.compiled import compiled_sums


@compiled_sums
def simulate_array(
    slopes: Array,
    thresholds: Array,
    weights: Array,
    plays: Array,
    decays: Array,
    weighted: Array,
    held: Array,
    now: Array,
    modes: Array,
    previous: Array,
    values: Array,
    out: Array,
) -> None:
    """Fill ``out`` with the displacement [um] of every actuator at each sample, (n_samples, n_actuators).

    Args:
        slopes: of the play forms, (n_actuators,).
        thresholds: of the plays, (n_actuators, n_plays).
        weights: of the plays.
        plays: their states, which move on.
        decays: what a step leaves of each mode, (n_modes,).
        weighted: weight of each shifted mode, (n_actuators, n_modes).
        held: weight of the former input of creep, (n_actuators,).
        now: weight of the present one.
        modes: shifted modes, which move on, (n_actuators, n_modes).
        previous: former input of creep, which moves on, (n_actuators,).
        values: voltages [V], (n_samples, n_actuators).
        out: of the same shape.
    """
    # Many arguments: a compiled kernel takes arrays, and packing them would copy what is to be changed in place.
    n_plays, n_modes = plays.shape[1], modes.shape[1]
    for k in range(values.shape[0]):
        for i in range(values.shape[1]):
            value, before = values[k, i], previous[i]
            play, threshold, weight = plays[i], thresholds[i], weights[i]
            moved = 0.0
            for j in range(n_plays):
                at = min(max(play[j], value - threshold[j]), value + threshold[j])
                play[j] = at
                moved += weight[j] * at
            moved += slopes[i] * value
            mode, share = modes[i], weighted[i]
            history = 0.0
            for j in range(n_modes):
                history += share[j] * mode[j]
                mode[j] = decays[j] * mode[j] + before
            out[k, i] = now[i] * moved + (held[i] * before + history)
            previous[i] = moved


@compiled_sums
def compensate_array(
    slopes: Array,
    thresholds: Array,
    weights: Array,
    plays: Array,
    decays: Array,
    weighted: Array,
    held: Array,
    now: Array,
    modes: Array,
    previous: Array,
    values: Array,
    out: Array,
) -> None:
    """Fill ``out`` with the voltage [V] of every actuator; arguments as of ``simulate_array``, of the stop forms."""
    # Many arguments, as simulate_array.
    n_plays, n_modes = plays.shape[1], modes.shape[1]
    for k in range(values.shape[0]):
        for i in range(values.shape[1]):
            before = previous[i]
            mode, share = modes[i], weighted[i]
            history = 0.0
            for j in range(n_modes):
                history += share[j] * mode[j]
                mode[j] = decays[j] * mode[j] + before
            value = (values[k, i] - (held[i] * before + history)) / now[i]
            play, threshold, weight = plays[i], thresholds[i], weights[i]
            voltage = 0.0
            for j in range(n_plays):
                stop = min(max(value - play[j], -threshold[j]), threshold[j])
                play[j] = value - stop
                voltage += weight[j] * stop
            out[k, i] = voltage + slopes[i] * value
            previous[i] = value

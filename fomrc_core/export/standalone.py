"""Hysteresis and creep by the step in plain Python, with nothing but ``math``: the core of an exported Python file.

The text of this file is copied into each of them (``python_file.py``), and the tables of an exported C file are
computed with it: sums in one order, so that the same model gives the same bytes. No annotations and no classes of
the typing module: MicroPython reads it too. It agrees with the compiled kernels to rounding (the golden data of
each export are theirs).
"""

# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=True

import math


def prepare_creep(rates, weights, order, inverse_gamma, feedthrough, step_s):
    """Return what a step length [s] makes of the creep modes: exact for an input linear over the step.

    A tuple: what is gone of each mode after the step, its weight in what the past alone gives, what the input before
    and the input at the end add to it, the weight of the present input, and that of the input before.
    """
    gone_of, weighted, from_previous, from_current = [], [], [], []
    held = 0.0
    for rate, weight in zip(rates, weights):  # noqa: B905 - MicroPython has no strict=
        a = rate * step_s
        if a < 0.5:
            # series of (1 - (1 - e^-a)/a)/a, sum of (-a)^k / (k + 2)!: the closed form cancels for small a
            ramp = 1.0 / 87178291200.0 - a / 1307674368000.0
            ramp = 1.0 / 479001600.0 - a * (1.0 / 6227020800.0 - a * ramp)
            ramp = 1.0 / 3628800.0 - a * (1.0 / 39916800.0 - a * ramp)
            ramp = 1.0 / 40320.0 - a * (1.0 / 362880.0 - a * ramp)
            ramp = 1.0 / 720.0 - a * (1.0 / 5040.0 - a * ramp)
            ramp = 1.0 / 24.0 - a * (1.0 / 120.0 - a * ramp)
            ramp = 0.5 - a * (1.0 / 6.0 - a * ramp)
            mean = 1.0 - a * ramp
            gone = a * mean
        else:
            gone = 1.0 - math.exp(-a)
            mean = gone / a
            ramp = (1.0 - mean) / a
        gone_of.append(gone)
        weighted.append(weight * (1.0 - gone))
        from_previous.append(step_s * (mean - ramp))
        from_current.append(step_s * ramp)
        held += weight * (from_previous[-1] + from_current[-1])
    current_weight = math.pow(step_s, order) * inverse_gamma
    return gone_of, weighted, from_previous, from_current, current_weight, feedthrough - current_weight + held


def creep_history(creep, modes, previous):
    """Return what the past alone gives at the end of the step."""
    history = creep[5] * previous
    for weight, mode in zip(creep[1], modes):  # noqa: B905
        history += weight * mode
    return history


def creep_remember(creep, modes, previous, current):
    """Move the modes to the end of the step, at which the input is ``current``."""
    gone, _, from_previous, from_current, _, _ = creep
    for j in range(len(modes)):
        modes[j] = (1.0 - gone[j]) * modes[j] + (from_previous[j] * previous + from_current[j] * current)


def move_plays(slope, thresholds, weights, plays, value):
    """Return the play sum at a new input; the plays move on."""
    total = slope * value
    for j in range(len(plays)):
        plays[j] = min(max(plays[j], value - thresholds[j]), value + thresholds[j])
        total += weights[j] * plays[j]
    return total


def sum_plays(slope, thresholds, weights, plays, value):
    """Return the play sum at an input; nothing moves."""
    total = slope * value
    for j in range(len(plays)):
        total += weights[j] * min(max(plays[j], value - thresholds[j]), value + thresholds[j])
    return total


def sum_stops(slope, thresholds, weights, plays, value):
    """Return the stop sum at an input, each stop the input less a play; nothing moves."""
    total = slope * value
    for j in range(len(plays)):
        total += weights[j] * min(max(value - plays[j], -thresholds[j]), thresholds[j])
    return total


def move_stops(slope, thresholds, weights, plays, value):
    """Return the stop sum at a new input; the plays move on."""
    total = slope * value
    for j in range(len(plays)):
        stop = min(max(value - plays[j], -thresholds[j]), thresholds[j])
        plays[j] = value - stop
        total += weights[j] * stop
    return total


def input_for_stop_sum(slope, thresholds, weights, plays, start, wanted):
    """Return the input at which the stop sum is as wanted, from the input at which the plays stand now.

    The sum rises in straight pieces, steep ones first on either way: Newton's method walks them in order.
    """
    value = start
    error = wanted - sum_stops(slope, thresholds, weights, plays, value)
    rises = error > 0.0
    for _ in range(len(plays) + 3):
        if error == 0.0 or (error > 0.0) is not rises:
            break
        steepness = slope
        for j in range(len(plays)):
            stop = value - plays[j]
            if (stop < thresholds[j]) if rises else (stop > -thresholds[j]):
                steepness += weights[j]
        value += error / steepness
        error = wanted - sum_stops(slope, thresholds, weights, plays, value)
    return value

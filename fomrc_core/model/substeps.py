"""Into how many parts a step is divided where hysteresis and creep bend the response within it."""

from __future__ import annotations

import math
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects import Effect
from fomrc_core.errors import ParameterError

Array = NDArray[np.float64]

# What a model file without the key ``substeps`` means: it was written before there was one.
BY_EFFECTS = "by_effects"

# In how many parts: a mass that rings was then followed to 0.2 % of its swing after jumps of a tenth of the range and
# more (test_substeps.py).
N_SUBSTEPS = 5
N_PARTS_LARGE = 8
N_PARTS_FEW = 4  # for directions of a fit, whose residual is measured with more
LARGE_CHANGE = 0.02  # of the largest threshold
SMALL_CHANGE = 1e-3  # of the same: the bend within a step goes with the square of its change, here a millionth

# Creep after a jump D bends by about D a / m^2 in the m-th step after it (a: creep order, a few hundredths).
BEND_AFTER = 0.1
BEND_FADES = 0.5


class Substeps(Enum):
    """How finely a model divides steps, within which the drive is linear.

    A property of the model, or of the record it is fitted to: no effect, however small or large, changes it.
    """

    NONE = "none"  # from sample to sample: what the compensator undoes to rounding
    FEW = "few"  # jumps, in few parts: for directions of a fit
    JUMPS = "jumps"  # jumps alone
    BENDS = "bends"  # every step in which the elements bend, and those after a jump in which creep does
    FIT = "fit"  # as bends, but where a drive goes straight on, or what swings does so slowly, in fewer parts
    DIRECTIONS = "directions"  # for directions of a fit that is measured by bends: jumps, in few parts, and swings


MODEL_SUBSTEPS = (Substeps.NONE, Substeps.JUMPS, Substeps.BENDS)  # what a model may have


# Of a fit, which goes over a record some thousand times. A lag behind a drive that goes straight on has no bend; where
# the drive turns it turns later, within a step whose end does not show how far it went, and plays remember how far.
# So fits divide steps by their turns. Where the drive goes straight on the plays' bend is left, which a sensor that is
# late sees between samples; it goes with the square of the change. A model is met to some millionths of the stroke.
TURN = 2e-3  # of the largest threshold, change from step to step
STRAIGHT = 5e-3  # of the same, change within a part

# By how much what swings turns in a part [rad]: a straight line over it is off by an eighth of its square at most.
TURNS = {Substeps.FIT: 0.05, Substeps.DIRECTIONS: 0.4}
# Of the largest threshold, by how much it may be off where little swings (swing_parts.py).
SWING = 5e-6


def substeps_of(word: object, effects: tuple[Effect, ...], has_start: bool, where: str) -> Substeps:
    """Return how finely the model of a file divides steps; raises ParameterError for an unknown word.

    Args:
        word: what the file says; ``by_effects`` where it says nothing: then as before files could say it, finely where
            an effect depends on it, at jumps where any effect or a past acts, else not at all.
        effects: effects the file names.
        has_start: whether it says what went before the record.
        where: the key, for the message.
    """
    words = {kind.value: kind for kind in MODEL_SUBSTEPS}
    if word == BY_EFFECTS:
        acting = [effect for effect in effects if not effect.is_null()]
        if any(effect.needs_substeps for effect in acting):
            return Substeps.BENDS
        return Substeps.JUMPS if acting or has_start else Substeps.NONE
    if not isinstance(word, str) or word not in words:
        raise ParameterError("unknown substeps", where=where, value=word, allowed=", ".join((BY_EFFECTS, *words)))
    return words[word]


def least_parts(effects: tuple[Effect, ...], steps_s: Array, substeps: Substeps) -> int:
    """Return into how many parts a chain's effects ask for each step to be divided at least.

    Args:
        effects: of the chain.
        steps_s: steps of the record [s], shape (n_samples,).
        substeps: how finely steps are divided.
    """
    if substeps is Substeps.BENDS:
        return max((effect.least_parts(effects) for effect in effects), default=1)
    if substeps in TURNS:
        # what is measured is so in its longest step, too; of a direction a usual step will do
        step_s = float(np.max(steps_s) if substeps is Substeps.FIT else np.mean(steps_s))
        return max((effect.parts_of_turn(effects, step_s, TURNS[substeps]) for effect in effects), default=1)
    return 1


def parts_of_steps(
    change_v: Array, scale_v: float, n_least: int | NDArray[np.int64], substeps: Substeps, bend_v: float = 0.0
) -> tuple[NDArray[np.int64], float]:
    """Return into how many equal parts each step is divided, shape (n_samples,), and the bend left for the next [V].

    Within a step the drive is linear but hysteresis bends it, and creep and the effects see the bend; it grows with
    the change of the drive. After a jump creep goes on bending for a few steps in which the drive rests: a ringing
    mass would be driven by a straight line there that is not what drives it.

    Args:
        change_v: change of the drive over each step [V], shape (n_samples,).
        scale_v: largest threshold of the plays [V].
        n_least: parts of each step at least, or of each its own, shape (n_samples,); see ``least_parts``.
        substeps: how finely.
        bend_v: bend left over from the steps before [V].
    """
    if substeps is Substeps.NONE:
        return np.ones(change_v.size, dtype=np.int64), 0.0
    parts = np.empty(change_v.size, dtype=np.int64)
    if substeps not in (Substeps.BENDS, Substeps.FIT):
        n_large = N_PARTS_LARGE if substeps is Substeps.JUMPS else N_PARTS_FEW
        _fill_jumps(change_v, LARGE_CHANGE * scale_v, n_large, parts)
        return np.maximum(parts, n_least), 0.0
    bend_v = _fill_bends(change_v, scale_v, substeps is Substeps.FIT, bend_v, parts)
    return np.maximum(parts, n_least), bend_v


@compiled
def _fill_jumps(change_v: Array, large_v: float, n_large: int, parts: NDArray[np.int64]) -> None:
    for k in range(change_v.size):
        parts[k] = n_large if abs(change_v[k]) > large_v else 1


@compiled
def _fill_bends(change_v: Array, scale_v: float, is_of_fit: bool, bend_v: float, parts: NDArray[np.int64]) -> float:
    """Fill ``parts`` and return the bend left for the next step [V]."""
    turn_v, n_steps, before_v = 0.0, 1.0, 0.0
    for k in range(change_v.size):
        size_v = abs(change_v[k])
        bent_v = max(size_v, bend_v)
        bend_v = max(BEND_AFTER * size_v, BEND_FADES * bend_v)
        n_parts = 1
        if bent_v > LARGE_CHANGE * scale_v:
            n_parts = N_PARTS_LARGE
        elif bent_v > SMALL_CHANGE * scale_v:
            n_parts = N_SUBSTEPS
        if is_of_fit:
            # what follows a turn with some steps' delay turns the less the longer it takes
            now_v = abs(change_v[k] - before_v)
            before_v = change_v[k]
            if now_v >= turn_v / (n_steps + 1.0):
                turn_v, n_steps = now_v, 1.0
            else:
                n_steps += 1.0
            asked = max(bent_v / (STRAIGHT * scale_v), turn_v / n_steps / (TURN * scale_v))
            n_parts = min(n_parts, math.ceil(min(max(asked, 1.0), N_PARTS_LARGE)))
        parts[k] = n_parts
    return bend_v


def subdivide(
    steps: Array, drive: Array, last: float, parts: NDArray[np.int64]
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return steps and a linear drive on equal parts of each step, and where each sample then stands."""
    n_parts = int(np.sum(parts))
    fine_steps, fine, ends = np.empty(n_parts), np.empty(n_parts), np.empty(parts.size, dtype=np.int64)
    _fill_parts(steps, drive, last, parts, fine_steps, fine, ends)
    return fine_steps, fine, ends


@compiled
def _fill_parts(
    steps: Array,
    drive: Array,
    last: float,
    parts: NDArray[np.int64],
    fine_steps: Array,
    fine: Array,
    ends: NDArray[np.int64],
) -> None:
    # Many arguments: what ``subdivide`` takes and what it returns.
    at, before = 0, last
    for k in range(parts.size):
        step, change = steps[k] / parts[k], (drive[k] - before) / parts[k]
        for i in range(1, parts[k] + 1):
            fine_steps[at] = step
            fine[at] = before + change * i
            at += 1
        ends[k] = at - 1
        fine[at - 1] = drive[k]
        before = drive[k]


def held_parts(before_v: Array, drive_v: Array, parts: NDArray[np.int64]) -> Array:
    """Return a drive that jumps from sample to sample [V] on equal parts of each step, shape (n_parts,).

    The jump lies in the middle of the step's parts, so that their mean is what is read over a sample, half of it
    before the jump and half after: as by a converter that integrates, which reads no value in the midst of a jump.

    Args:
        before_v: level before each sample [V], shape (n_samples,).
        drive_v: level from it on [V], shape (n_samples,).
        parts: number of parts of each step.
    """
    held_v = np.empty(int(np.sum(parts)))
    _fill_held(before_v, drive_v, parts, held_v)
    return held_v


@compiled
def _fill_held(before_v: Array, drive_v: Array, parts: NDArray[np.int64], held_v: Array) -> None:
    at = 0
    for k in range(parts.size):
        for i in range(1, parts[k] + 1):
            beyond = 2 * i - (parts[k] + 1)
            after = 0.5 if beyond == 0 else (1.0 if beyond > 0 else 0.0)
            held_v[at] = before_v[k] + after * (drive_v[k] - before_v[k])
            at += 1


def means_of_parts(values: Array, ends: NDArray[np.int64]) -> Array:
    """Return the mean of values over the parts of each step, shape (n_samples, ...).

    Args:
        values: of each part, along the first axis, shape (n_parts, ...).
        ends: part that ends at each sample, shape (n_samples,).
    """
    means = np.empty((ends.size, *values.shape[1:]))
    rows, out = values.reshape(len(values), -1), means.reshape(ends.size, -1)
    _fill_means(rows, ends, out)
    return means


@compiled
def _fill_means(rows: Array, ends: NDArray[np.int64], out: Array) -> None:
    begin = 0
    for k in range(ends.size):
        n_parts = ends[k] + 1 - begin
        for j in range(rows.shape[1]):
            out[k, j] = rows[begin, j]
        for i in range(begin + 1, ends[k] + 1):
            for j in range(rows.shape[1]):
                out[k, j] += rows[i, j]
        for j in range(rows.shape[1]):
            out[k, j] /= n_parts
        begin = ends[k] + 1

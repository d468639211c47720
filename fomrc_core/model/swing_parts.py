"""Into how many parts a fit divides each step for what swings: many after a jump, few where hardly anything swings.

A straight line over a part of a swing is off by its size times an eighth of the square of what it turns in the part. So
parts are made as small as the swing at that step asks for, and none smaller than what swings by the whole range does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.effects import Effect, Stage
from fomrc_core.model.substeps import SWING, TURNS, Substeps

Array = NDArray[np.float64]

_TINY = float(np.finfo(np.float64).tiny)  # of plays that nothing moves


def swinging(effects: tuple[Effect, ...]) -> tuple[Effect, ...]:
    """Return the effects that say how large a swing is at each step: those that ring, and what drives them."""
    if not any(effect.rings for effect in effects):
        return ()
    return tuple(effect for effect in effects if effect.rings or effect.stage is Stage.DRIVE)


def least_of_steps(
    effects: tuple[Effect, ...], steps_s: Array, drive_v: Array, scale_v: float, substeps: Substeps, n_least: int
) -> int | NDArray[np.int64]:
    """Return into how many parts each step is divided at least for a chain, shape (n_samples,), or all of them.

    Args:
        effects: of the chain.
        steps_s: step that leads to each sample [s], shape (n_samples,).
        drive_v: drive after the effects at its samples [V], shape (n_samples,).
        scale_v: largest threshold of the plays [V].
        substeps: how finely steps are divided.
        n_least: parts that the largest swing asks for, see ``least_parts``.
    """
    # Many arguments: a chain, its drive, and how it is divided.
    if substeps is not Substeps.FIT or n_least == 1 or any(effect.holds for effect in effects):
        return n_least
    if not any(effect.rings for effect in effects):
        return n_least
    turn, longest_s = TURNS[substeps], float(np.max(steps_s))
    parts, seen_v = np.ones(drive_v.size, dtype=np.int64), drive_v
    for effect in effects:
        n_most = effect.parts_of_turn(effects, longest_s, turn)
        if effect.rings:
            turned = effect.turn_at_swing(seen_v, steps_s, max(SWING * scale_v, _TINY))
            np.maximum(parts, np.clip(np.ceil(turned), 1, n_most).astype(np.int64), out=parts)
        else:
            np.maximum(parts, n_most, out=parts)
        if effect.stage is Stage.DRIVE:
            seen_v = effect.run(effect.initial_state(), seen_v, steps_s)
    return parts

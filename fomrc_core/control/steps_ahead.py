"""What a loop does in the steps to come, were its target held and nothing limited."""

from __future__ import annotations

import math

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.control.compensation_loop import CompensationLoop


def driven_ahead(loop: CompensationLoop, n_steps: int) -> Array:
    """Return where the stage is driven in the next steps [um], before the mechanics, shape (n_steps,)."""
    driven_um = None if loop.previewed is None else loop.previewed.driven_ahead(n_steps)
    return np.full(n_steps, loop.target_um) if driven_um is None else driven_um


def voltages_ahead(loop: CompensationLoop, n_steps: int) -> Array:
    """Return what is put out in the next steps [V], shape (n_steps,); the loop has a target."""
    state, correction_um = loop.memory.state, loop.correction_um
    if loop.previewed is not None:
        voltages_v = loop.previewed.voltages_ahead(state, n_steps, correction_um, loop.cross)
        if voltages_v is not None:
            return voltages_v
    assert loop.target_um is not None
    steps_s, goal_um = np.full(n_steps, loop.settings.period_s), np.full(n_steps, loop.target_um + correction_um)
    beside = None if math.isnan(loop.cross) else np.full(n_steps, loop.cross)
    return loop.compensator.run(steps_s, goal_um, state.copy(), cross=beside)

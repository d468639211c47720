"""The slope of an effect's response by differences, for effects whose slope has no simple form."""

from __future__ import annotations

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect

_DIFFERENCE = 1e-5  # of the span: far from rounding, and near


def slope_by_differences(effect: Effect, changes: Array, steps_s: Array, values: Array, span_um: float) -> Array:
    """Return what small changes of the input make of the output, shape (n_samples, n_changes).

    Args:
        effect: whose response it is.
        changes: of the input, shape (n_samples, n_changes).
        steps_s: step that leads to each sample [s], shape (n_samples,).
        values: the input itself [um], shape (n_samples,).
        span_um: largest displacement [um].
    """
    found = np.empty_like(changes)
    for column in range(changes.shape[1]):
        largest = float(np.max(np.abs(changes[:, column])))
        size = _DIFFERENCE * span_um / largest if largest > 0.0 else 1.0
        moved = [
            effect.run(effect.initial_state(), values + sign * size * changes[:, column], steps_s)
            for sign in (1.0, -1.0)
        ]
        found[:, column] = (moved[0] - moved[1]) / (2.0 * size)
    return found

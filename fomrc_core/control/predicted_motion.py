"""Where the stage is by the model: what the memory says it was driven to, passed through what is not undone at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.effects import Effect
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.preview_inverse import PreviewInverse


def late_effects(compensator: Compensator, preview: PreviewInverse | None) -> tuple[Effect, ...]:
    """Return the linear effects that lie between what the compensator makes and the displacement.

    Without a preview an amplifier that is left as it is is among them: it lags a drive as it does a displacement, but
    for the hysteresis between the two.
    """
    mechanics = () if preview is None else preview.mechanics
    left = [effect for effect in compensator.model.effects if not effect.can_invert and not effect.is_null()]
    return (*(effect for effect in left if effect.response(np.zeros(1)) is not None), *mechanics)


class PredictedMotion:
    """The displacement by the model, stepped with the memory.

    Args:
        effects: linear, what is driven passes through them.
        position_um: where the stage rests at first [um].
    """

    def __init__(self, effects: Sequence[Effect], position_um: float) -> None:
        self._effects = tuple(effects)
        # Linear effects begin at rest at zero, and so is counted from here.
        self._origin_um = position_um
        self._states = [effect.initial_state() for effect in effects]
        self.displacement_um = position_um

    def advance(self, steps_s: Array, driven_um: Array) -> float:
        """Return the displacement [um] after steps [s] to where the stage was driven [um], shapes (n_steps,)."""
        if steps_s.size:
            self.displacement_um = float(self._passed(self._states, steps_s, driven_um)[-1])
        return self.displacement_um

    def ahead(self, steps_s: Array, driven_um: Array) -> Array:
        """Return the displacement [um] of steps to come, shape (n_steps,); nothing moves on."""
        return self._passed([state.copy() for state in self._states], steps_s, driven_um)

    def _passed(self, states: Sequence[Array], steps_s: Array, driven_um: Array) -> Array:
        values = driven_um - self._origin_um
        for effect, state in zip(self._effects, states, strict=True):
            values = effect.run(state, values, steps_s)
        return np.asarray(values + self._origin_um)

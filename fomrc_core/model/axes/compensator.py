"""The inverse of several axes: static coupling undone, then hysteresis and creep of each input exactly.

    displacement = S(axis models of the voltages)   ->   voltages = axis inverses of S^-1 displacement

Modes are taken at rest, as a stage that is moved slowly has them; what they do on the way is undone where a target is
known as a whole (dynamic_inverse.py). Joints, the relay of the rate and the level law are left out: at rest they
vanish.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import ParameterError
from fomrc_core.model.axes.axes_model import AxesModel
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.state import ModelState

Array = NDArray[np.float64]

_WORST_CONDITION = 1e8  # beyond it rounding alone moves the stage by more than any sensor sees


class AxesCompensator:
    """Feedforward of several axes.

    Args:
        model: with as many outputs as inputs, each of which moves by an input of its own.
        level_v: level of the drive for which coupling holds [V rms]; the reference level if left out.

    Raises:
        ParameterError: outputs and inputs differ in number, or cannot be told from one another.
    """

    def __init__(self, model: AxesModel, level_v: float | None = None) -> None:
        gain = model.static_gain(level_v)
        if gain.shape[0] != gain.shape[1]:
            raise ParameterError(
                "no inverse", where="model.axes", value=gain.shape, allowed="as many outputs as inputs"
            )
        condition = float(np.linalg.cond(gain))
        if not condition < _WORST_CONDITION:
            raise ParameterError(
                "outputs cannot be told apart", where="model.axes", value=condition, allowed="a coupling of full rank"
            )
        self.model = model
        self._decoupling = np.linalg.inv(gain)
        self._axes = tuple(Compensator(axis) for axis in model.axes)

    @property
    def not_inverted(self) -> tuple[tuple[tuple[str, str], ...], ...]:
        """Name and reason of what each input's own model holds and is left as it is."""
        return tuple(axis.not_inverted for axis in self._axes)

    def initial_state(self) -> tuple[ModelState, ...]:
        """Return the state at rest."""
        return tuple(axis.initial_state() for axis in self._axes)

    def decoupled_um(self, desired_um: Array) -> Array:
        """Return what each input's own model must move [um] for displacements [um], both (n_samples, n_axes)."""
        # sums in a fixed order: one sample alone gives what it gives among many
        own = np.zeros_like(desired_um)
        for k in range(desired_um.shape[1]):
            own += desired_um[:, k : k + 1] * self._decoupling[:, k]
        return own

    def run(self, steps_s: Array, desired_um: Array, state: tuple[ModelState, ...] | None = None) -> Array:
        """Return the voltages [V] of desired displacements [um], both of shape (n_samples, n_axes)."""
        desired = np.asarray(desired_um, dtype=np.float64)
        if desired.ndim != 2 or desired.shape[1] != len(self._axes):
            raise ParameterError(
                "targets do not fit", where="desired_um", value=desired.shape, allowed=f"(n_samples, {len(self._axes)})"
            )
        return self.own_voltages(steps_s, self.decoupled_um(desired), state)

    def own_voltages(self, steps_s: Array, own_um: Array, state: tuple[ModelState, ...] | None = None) -> Array:
        """Return the voltages [V] of what each input's own model must move [um], both (n_samples, n_axes)."""
        states = self.initial_state() if state is None else state
        columns = [axis.run(steps_s, own_um[:, i], states[i]) for i, axis in enumerate(self._axes)]
        return np.stack(columns, axis=1)

    def advance(self, state: tuple[ModelState, ...], desired_um: Array, step_s: float) -> Array:
        """Return the voltages [V] after one step, shape (n_axes,)."""
        return np.asarray(self.run(np.array([step_s]), np.asarray(desired_um).reshape(1, -1), state)[0])

"""The direct inverse of section 4.3: desired displacement in, voltage out, without iteration.

    y = D^alpha x,   u_i = stop_i(y),   u = sum_i u_i + y / kappa_{n+1}         (26), (20), (22)

Effects of an extended model are undone in reverse order where they can be; the others are named, with the reason.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import IS_COMPILED, compiled
from fomrc_core.effects import Covariates, Effect, Stage
from fomrc_core.effects.base.kernels import knee_sum
from fomrc_core.model.inputs import check_step, checked_inputs
from fomrc_core.model.kernels import inverse, inverse_step
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.state import ModelState
from fomrc_core.operators.creep import creep_block, differentiate_step
from fomrc_core.operators.hysteresis import HEADER, N_PLAYS, SLOPE, hysteresis_block, move_plays

Array = NDArray[np.float64]


@compiled
def _peek_plays(packed: Array, value: float) -> float:
    n_plays = int(packed[N_PLAYS])
    total: float = packed[SLOPE] * value
    for j in range(n_plays):
        threshold = packed[HEADER + j]
        play = min(max(packed[HEADER + 2 * n_plays + j], value - threshold), value + threshold)
        total += packed[HEADER + n_plays + j] * play
    return total


@compiled
def _inverse_beside(
    packed: Array, at_creep: int, knees: Array, desired_um: Array, steps_s: Array, last_v: float, out: Array
) -> None:
    # Plays with knees have no closed inverse beside the elements: bracket the voltage, then bisect with secants.
    voltage = last_v
    for k in range(desired_um.size):
        wanted = differentiate_step(packed, at_creep, desired_um[k], steps_s[k])
        error = _peek_plays(packed, voltage) + knee_sum(knees, voltage, False) - wanted
        reach = max(abs(error / packed[SLOPE]), 1e-12)
        low, high = voltage, voltage
        low_error, high_error = error, error
        for _ in range(60):
            if low_error > 0.0:
                low -= reach
                low_error = _peek_plays(packed, low) + knee_sum(knees, low, False) - wanted
            elif high_error < 0.0:
                high += reach
                high_error = _peek_plays(packed, high) + knee_sum(knees, high, False) - wanted
            else:
                break
            reach *= 2.0
        for i in range(100):
            if high - low <= 1e-14 * (abs(high) + abs(low)) + 1e-300 or high_error == low_error:
                break
            if i % 3 == 2:
                middle = 0.5 * (low + high)
            else:
                middle = low - low_error * (high - low) / (high_error - low_error)
            error = _peek_plays(packed, middle) + knee_sum(knees, middle, False) - wanted
            if error >= 0.0:
                high, high_error = middle, error
            if error <= 0.0:
                low, low_error = middle, error
        voltage = low if abs(low_error) <= abs(high_error) else high
        move_plays(packed, 0, voltage)
        knee_sum(knees, voltage, True)
        out[k] = voltage


class Compensator:
    """Feedforward: the voltage that makes the actuator follow a desired displacement.

    Args:
        model: the actuator; its effects are inverted where they can be.
    """

    def __init__(self, model: PiezoModel) -> None:
        self.model = model
        self.not_inverted: tuple[tuple[str, str], ...] = tuple(
            (cause.name, cause.inverse_note) for cause in model.causes if not cause.can_invert
        )
        # plays with knees: what an effect beside the elements must be made of for it to be inverted
        self._beside = [effect for effect in model.of_stage(Stage.HYSTERESIS) if effect.can_invert]
        undone = [effect for effect in reversed(model.effects) if effect.can_invert]
        self._before = [effect for effect in undone if effect.stage in (Stage.SENSED, Stage.MECHANICAL)]
        self._after = [effect for effect in undone if effect.stage in (Stage.SAMPLED_DRIVE, Stage.DRIVE)]
        form = model.play_form if self._beside else model.stop_form
        self._hysteresis = hysteresis_block(form)
        self.at_creep = int(self._hysteresis.size)

    def __str__(self) -> str:
        lines = [f"compensator of a {self.model}"]
        return "\n".join([*lines, *(f"{name} is left as it is: {reason}" for name, reason in self.not_inverted)])

    def initial_state(self) -> ModelState:
        """Return the relaxed state."""
        packed = np.concatenate((self._hysteresis, creep_block(self.model.creep_modes)))
        return ModelState(packed, {effect.name: effect.initial_state() for effect in self.model.effects})

    def advance(
        self,
        state: ModelState,
        desired_um: float,
        step_s: float,
        *,
        temperature_c: float = np.nan,
        cross: float = np.nan,
    ) -> float:
        """Return the voltage [V] after one step of ``step_s`` [s] that ends at ``desired_um`` [um]."""
        if not self.model.effects:
            if IS_COMPILED:
                voltage_v = inverse_step(state.packed, self.at_creep, desired_um, step_s)
            else:
                voltage_v = state.plain_kernels(self.at_creep).inverse(desired_um, step_s)
            if voltage_v != voltage_v:  # the kernels answer unfit input with NaN
                check_step(step_s, desired_um, "desired_um")
            state.last_input = desired_um
            return voltage_v
        check_step(step_s, desired_um, "desired_um")
        one = self.run(
            np.array([step_s]),
            np.array([desired_um]),
            state,
            temperature_c=None if np.isnan(temperature_c) else np.array([temperature_c]),
            cross=None if np.isnan(cross) else np.array([cross]),
        )
        return float(one[0])

    def run(
        self,
        steps_s: Array,
        desired_um: Array,
        state: ModelState | None = None,
        *,
        temperature_c: Array | None = None,
        cross: Array | None = None,
    ) -> Array:
        """Return the voltage [V] of each sample, shape (n_samples,).

        Args:
            steps_s: step that leads to each sample [s], > 0, shape (n_samples,).
            desired_um: desired displacement [um], shape (n_samples,).
            state: moves on where given; else it starts relaxed.
            temperature_c: temperature [degC], shape (n_samples,), for effects that use it.
            cross: second axis, shape (n_samples,), for effects that use it.
        """
        steps, wanted = checked_inputs(steps_s, desired_um, "desired_um")
        state = self.initial_state() if state is None else state
        covariates = Covariates(temperature_c, cross)
        state.last_input = float(wanted[-1])
        for effect in self._before:
            wanted = self._undo(effect, state, wanted, steps, covariates)
        voltage = np.empty(wanted.size)
        if self._beside:
            self._run_beside(state, wanted, steps, voltage)
            for beside in reversed(self._beside):
                voltage = beside.unwarp(voltage)
        else:
            inverse(state.packed, self.at_creep, wanted, steps, voltage)
        for effect in self._after:
            voltage = self._undo(effect, state, voltage, steps, covariates)
        return voltage

    @staticmethod
    def _undo(effect: Effect, state: ModelState, values: Array, steps: Array, covariates: Covariates) -> Array:
        return effect.invert(state.effects[effect.name], values, steps, covariates.of(effect.covariate))

    def _run_beside(self, state: ModelState, wanted: Array, steps: Array, voltage: Array) -> None:
        blocks = [state.effects[effect.name] for effect in self._beside]
        sizes = [int(block[0]) for block in blocks]
        parts = [block[1:].reshape(4, size) for block, size in zip(blocks, sizes, strict=True)]
        joined = np.concatenate(([float(sum(sizes))], np.hstack(parts).reshape(-1)))
        _inverse_beside(state.packed, self.at_creep, joined, wanted, steps, state.last_voltage_v, voltage)
        state.last_voltage_v = float(voltage[-1])
        plays = joined[1:].reshape(4, sum(sizes))[3]
        for block, part in zip(blocks, np.split(plays, np.cumsum(sizes)[:-1]), strict=True):
            block[1 + 3 * int(block[0]) :] = part

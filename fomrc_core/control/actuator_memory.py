"""What is remembered of an actuator, and how a changed model takes it over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.control.turning_points import TurningPoints
from fomrc_core.effects import Stage
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.state import ModelState
from fomrc_core.operators.creep import PREVIOUS, mode_states
from fomrc_core.operators.hysteresis import play_states

Array = NDArray[np.float64]

_FURTHEST_UM = 1e5
# While the compensator was down the target counts as held: this long at full rate, then in growing steps.
_UNIFORM_AGING_S = 5.0
_AGING_GROWTH = 1.01
# Less than this of a period is rounding.
_PART_OF_PERIOD = 1e-6


def hysteresis_input(compensator: Compensator, state: ModelState) -> float:
    """Return the present input of the hysteresis, y of (21): what creep has been taken out of."""
    return float(state.packed[compensator.at_creep + PREVIOUS])


@dataclass
class ActuatorMemory:
    """A compensator's state, and the turning points that let another model take it over.

    Attributes:
        state: the compensator's state.
        turning_points: those of the hysteresis input.
    """

    state: ModelState
    turning_points: TurningPoints

    @classmethod
    def relaxed(cls, compensator: Compensator) -> ActuatorMemory:
        """Return the memory of a relaxed actuator."""
        return cls(compensator.initial_state(), TurningPoints())

    def copy(self) -> ActuatorMemory:
        """Return an independent copy."""
        return ActuatorMemory(self.state.copy(), self.turning_points.copy())

    def advance(self, compensator: Compensator, desired_um: float, step_s: float, cross: float = np.nan) -> float:
        """Return the voltage [V] after one step; the memory moves on."""
        voltage_v = compensator.advance(self.state, desired_um, step_s, cross=cross)
        self.note_turning_point(compensator)
        return voltage_v

    def note_turning_point(self, compensator: Compensator) -> None:
        """Note the hysteresis input after a step the state has made."""
        self.turning_points.move(hysteresis_input(compensator, self.state))


def carries_exactly(old: Compensator, new: Compensator) -> bool:
    """Tell whether the memory of one model is exactly that of the other.

    The hysteresis input is the desired displacement with creep taken out: the same for both where the creep
    order is the same, and so are the creep modes. Effects may have a state that depends on the elements.
    """
    return not old.model.effects and not new.model.effects and old.model.creep_order == new.model.creep_order


def carried(old: Compensator, new: Compensator, memory: ActuatorMemory) -> ActuatorMemory:
    """Return the memory a changed model would have, exact where ``carries_exactly``.

    Elsewhere it is the best that can be had without the history: turning points and mode states as they are.
    """
    state = new.initial_state()
    n_hysteresis = new.at_creep
    if not new.model.of_stage(Stage.HYSTERESIS):
        plays = play_states(state.packed[:n_hysteresis])
        plays[:] = memory.turning_points.plays(new.model.stop_form.thresholds)
    old_creep, new_creep = memory.state.packed[old.at_creep :], state.packed[n_hysteresis:]
    new_creep[PREVIOUS] = old_creep[PREVIOUS]
    if mode_states(old_creep).size == mode_states(new_creep).size:
        mode_states(new_creep)[:] = mode_states(old_creep)
    for effect in new.model.effects:
        if effect.name in memory.state.effects:
            state.effects[effect.name] = effect.carried_state(memory.state.effects[effect.name])
    state.last_input, state.bend = memory.state.last_input, memory.state.bend
    state.last_voltage_v = memory.state.last_voltage_v
    return ActuatorMemory(state, memory.turning_points.copy())


def aging_steps(down_time_s: float, period_s: float) -> list[float]:
    """Return steps that add up to a down time [s]: the loop's own at first, then each one per cent longer."""
    n_uniform = int(min(down_time_s, _UNIFORM_AGING_S) / period_s)
    steps = [period_s] * n_uniform
    left = down_time_s - n_uniform * period_s
    step = period_s
    while left > 1e-6:
        step = min(step * _AGING_GROWTH, left) if n_uniform else min(step, left)
        steps.append(step)
        left -= step
    return steps


def pause_steps(pause_s: float, period_s: float) -> list[float]:
    """Return steps that add up to a time [s] at a held voltage: one period at first, then each twice the last."""
    steps, left_s, step_s = [], pause_s, period_s
    while left_s > _PART_OF_PERIOD * period_s:
        # What would be left of less than this step goes with it.
        step_s = left_s if left_s < 2.0 * step_s else step_s
        steps.append(step_s)
        left_s -= step_s
        step_s *= 2.0
    return steps


def displacement_for_voltage(
    compensator: Compensator,
    state: ModelState,
    voltage_v: float,
    step_s: float,
    near_um: float,
    gain_um_per_v: float,
    cross: float = np.nan,
) -> float:
    """Return the displacement [um] a compensator must be told for it to answer with a given voltage.

    Where a voltage was limited, the actuator did not go where it was wanted: this is where it went. The
    answer rises with the displacement and is piecewise linear, so a bracketed secant ends in a few steps.

    Args:
        compensator: the compensator.
        state: its state before the step; not changed.
        voltage_v: the voltage that was applied [V].
        step_s: length of the step [s].
        near_um: a displacement near the answer [um].
        gain_um_per_v: how far the actuator moves per volt, for the first guess [um/V].
        cross: second axis, not a number where there is none.
    """
    # Many arguments: what is known at a tick, asked once a tick, without an object made for it.

    def error(desired_um: float) -> float:
        return compensator.advance(state.copy(), desired_um, step_s, cross=cross) - voltage_v

    low = high = near_um
    low_error = high_error = error(near_um)
    reach = max(abs(low_error) * gain_um_per_v, 1e-9)
    for _ in range(60):
        if low_error > 0.0:
            high, high_error = low, low_error
            low -= reach
            low_error = error(low)
        elif high_error < 0.0:
            low, low_error = high, high_error
            high += reach
            high_error = error(high)
        else:
            break
        reach *= 2.0
        if reach > _FURTHEST_UM:
            return near_um  # an effect keeps the answer from following: stay
    for k in range(60):
        if high_error - low_error < 1e-12 or high - low <= 1e-13 * max(abs(high), 1e-3):
            break
        middle = low - low_error * (high - low) / (high_error - low_error) if k % 4 != 3 else 0.5 * (low + high)
        middle_error = error(middle)
        if abs(middle_error) < 1e-12:
            return middle
        if middle_error > 0.0:
            high, high_error = middle, middle_error
        else:
            low, low_error = middle, middle_error
    return low if abs(low_error) < abs(high_error) else high

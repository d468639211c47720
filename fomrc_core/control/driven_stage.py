"""Where the stage is by the model, driven by the very voltages put out: between the samples as well.

What the inverse makes of a target is right at the samples. Between them the voltage goes straight (or is held), the
amplifier answers with an exponential, and hysteresis bends where an element gives way: so little that a sample does not
show it, but every bend strikes a mass that rings. So each period is taken in parts here:

    voltage --[amplifier]--> hysteresis --> creep --[mechanics]--> displacement
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.control.actuator_memory import ActuatorMemory
from fomrc_core.control.loop_account import Move
from fomrc_core.effects import Effect, Stage
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.kernels import forward
from fomrc_core.model.preview_inverse import PreviewInverse
from fomrc_core.model.substeps import held_parts, subdivide
from fomrc_core.operators.creep import mode_states
from fomrc_core.operators.hysteresis import hysteresis_block, move_plays, move_stops, play_states

# Of a mass that swings three times in ten periods 2 parts miss a tenth of what bends strike it with, 8 half a per cent.
_N_PARTS = 8
_N_WAITING = 64  # periods that wait before they are stepped: one call for many, in a tick with room for it
_DRIVE = (Stage.SAMPLED_DRIVE, Stage.DRIVE)


def _is_linear(effect: Effect) -> bool:
    return effect.response(np.zeros(1)) is not None


class DrivenStage:
    """Steps the displacement along with the voltages; begun where a memory says the actuator is, at rest.

    Args:
        compensator: the inverse in force.
        preview: what undoes dynamics before it, None without.
        memory: of the actuator.
        position_um: where the stage rests [um].
        voltage_v: voltage on the actuator [V].
    """

    # Many arguments: what is known of a stage at rest.
    def __init__(
        self,
        compensator: Compensator,
        preview: PreviewInverse | None,
        memory: ActuatorMemory,
        position_um: float,
        voltage_v: float,
    ) -> None:
        effects = _effects_of(compensator, preview)
        self._sampled = tuple(effect for effect in effects if effect.stage is Stage.SAMPLED_DRIVE)
        self._drive = tuple(effect for effect in effects if effect.stage is Stage.DRIVE)
        self._mechanics = tuple(effect for effect in effects if effect.stage not in _DRIVE)
        self._is_held = any(effect.holds for effect in self._sampled)
        self._states = {effect.name: effect.initial_state() for effect in effects}
        # Linear effects begin at rest at zero, and so is counted from here.
        self._origin_um, self._origin_v = position_um, voltage_v
        self._last_v = 0.0
        self._at_creep, self._packed = _forward_state(compensator, memory)
        self._steps_s: list[float] = []
        self._voltages_v: list[float] = []
        self.displacement_um = position_um
        self.ahead(preview.step_s if preview is not None else 1e-3, np.array([voltage_v]))  # nothing is compiled later

    @staticmethod
    def knows(compensator: Compensator, preview: PreviewInverse | None) -> bool:
        """Tell whether the model is stepped here: its effects linear, and the mechanical ones not undone at once.

        What bends or hangs on signals beside is not.
        """
        effects = _effects_of(compensator, preview)
        undone = [e for e in compensator.model.effects if e.can_invert]
        return all(_is_linear(effect) for effect in effects) and all(effect.stage in _DRIVE for effect in undone)

    def note(self, moves: Sequence[Move]) -> None:
        """Take what the memory has moved by, voltages among it."""
        for move in moves:
            self._steps_s.append(move.step_s)
            self._voltages_v.append(move.voltage_v)
        if len(self._steps_s) >= _N_WAITING:
            self.catch_up()

    def catch_up(self) -> float:
        """Step what waits; return the displacement [um]."""
        if self._steps_s:
            steps_s, voltages_v = np.array(self._steps_s), np.array(self._voltages_v)
            self._steps_s, self._voltages_v = [], []
            self.displacement_um = float(self._passed(steps_s, voltages_v)[-1])
        return self.displacement_um

    def ahead(self, step_s: float, voltages_v: Array) -> Array:
        """Return the displacement [um] of steps to come, shape (n_steps,); nothing moves on.

        Args:
            step_s: length of each [s].
            voltages_v: what will be put out [V], shape (n_steps,).
        """
        self.catch_up()
        kept = self._packed.copy(), {name: state.copy() for name, state in self._states.items()}, self._last_v
        moved_um = self._passed(np.full(voltages_v.size, step_s), voltages_v)
        self._packed, self._states, self._last_v = kept
        return moved_um

    def _passed(self, steps_s: Array, voltages_v: Array) -> Array:
        drive_v = self._run(self._sampled, voltages_v - self._origin_v, steps_s)
        before_v = np.concatenate(([self._last_v], drive_v[:-1]))
        n_parts = np.full(drive_v.size, _N_PARTS)
        parts_s, parts_v, ends = subdivide(steps_s, drive_v, self._last_v, n_parts)
        if self._is_held:
            parts_v = held_parts(before_v, drive_v, n_parts)
        self._last_v = float(drive_v[-1])
        inner_v = np.ascontiguousarray(self._run(self._drive, parts_v, parts_s) + self._origin_v)
        moved_um = np.empty(inner_v.size)
        forward(self._packed, self._at_creep, inner_v, parts_s, moved_um)
        seen_um = self._run(self._mechanics, moved_um - self._origin_um, parts_s) + self._origin_um
        return np.asarray(seen_um.reshape(-1, _N_PARTS).mean(axis=1) if self._is_held else seen_um[ends])

    def _run(self, effects: Sequence[Effect], values: Array, steps_s: Array) -> Array:
        for effect in effects:
            values = effect.run(self._states[effect.name], values, steps_s)
        return values


def _effects_of(compensator: Compensator, preview: PreviewInverse | None) -> tuple[Effect, ...]:
    """Return the effects of the whole model, in the order of the chain."""
    beside = () if preview is None else (*preview.amplifier, *preview.mechanics)
    effects = [effect for effect in (*compensator.model.effects, *beside) if not effect.is_null()]
    return tuple(sorted(effects, key=lambda effect: (effect.stage, effect.place)))


def _forward_state(compensator: Compensator, memory: ActuatorMemory) -> tuple[int, Array]:
    """Return where the creep block begins, and hysteresis and creep from voltage to displacement, as they are now."""
    model = compensator.model
    stops, plays = hysteresis_block(model.stop_form), hysteresis_block(model.play_form)
    # The same turning points, of the displacement there and of the voltage here.
    play_states(stops)[:] = 0.0
    for point_um in memory.turning_points.to_list():
        move_plays(plays, 0, move_stops(stops, 0, point_um))
    creep = memory.state.packed[compensator.at_creep :].copy()
    assert mode_states(creep).size == model.creep_modes.n_modes
    return plays.size, np.concatenate((plays, creep))

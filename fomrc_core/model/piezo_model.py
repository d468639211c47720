"""The model of the chain: drive effects, hysteresis, creep, mechanical effects, sensor effects.

Without effects it is the FOMRC of equations (20)-(26): voltage through the play form of the Maxwell elements,
then the fractional integrator, sample by sample, so that the direct inverse undoes it to rounding. With effects the
drive is taken as linear between samples and the chain runs on parts of the larger steps (substeps.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import IS_COMPILED
from fomrc_core.effects import Effect, Stage, effect_class
from fomrc_core.effects.asymmetric_hysteresis import AsymmetricHysteresis
from fomrc_core.effects.initial_state import InitialState
from fomrc_core.errors import ParameterError
from fomrc_core.model.kernels import forward, forward_beside, forward_step
from fomrc_core.model.plain_kernels import PlainKernels
from fomrc_core.model.substeps import parts_of_steps, subdivide
from fomrc_core.operators.creep import CreepModes, check_order, creep_block, creep_modes
from fomrc_core.operators.hysteresis import HEADER as PLAYS_HEADER
from fomrc_core.operators.hysteresis import (
    N_PLAYS,
    OperatorSum,
    check_elements,
    hysteresis_block,
    play_form,
    stop_form,
)

Array = NDArray[np.float64]


@dataclass
class ModelState:
    """What a model or a compensator remembers; the one mutable thing, bounded in size.

    Attributes:
        packed: hysteresis and creep blocks in one array.
        effects: state of each effect by its name.
        last_input: input of the last step [V], or [um] for a compensator.
        bend: what jumps of the drive leave bending in the next step [V] (substeps.py).
    """

    packed: Array
    effects: dict[str, Array] = field(default_factory=dict)
    last_input: float = 0.0
    bend: float = 0.0
    _chain: PlainKernels | None = field(default=None, init=False, repr=False, compare=False)

    def plain_kernels(self, at_creep: int) -> PlainKernels:
        """Return the steppers for plain Python on this state, made at their first use."""
        if self._chain is None or self._chain.packed is not self.packed:
            self._chain = PlainKernels(self.packed, at_creep)
        return self._chain

    def __getstate__(self) -> dict[str, Any]:
        # Views do not stay views of the state when they are pickled beside it.
        return {**self.__dict__, "_chain": None}

    def copy(self) -> ModelState:
        """Return an independent copy."""
        effects = {name: values.copy() for name, values in self.effects.items()}
        return ModelState(self.packed.copy(), effects, self.last_input, self.bend)

    def to_mapping(self) -> dict[str, Any]:
        """Return the state as plain numbers and lists."""
        effects = {name: values.tolist() for name, values in self.effects.items()}
        return {"packed": self.packed.tolist(), "effects": effects, "last_input": self.last_input, "bend": self.bend}

    @classmethod
    def from_mapping(cls, mapping: Any, where: str = "state") -> ModelState:
        """Return the state of a mapping; raises ParameterError for anything that is not one."""
        try:
            packed = np.array(mapping["packed"], dtype=np.float64)
            effects = {str(k): np.array(v, dtype=np.float64) for k, v in mapping["effects"].items()}
            state = cls(packed, effects, float(mapping["last_input"]), float(mapping["bend"]))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ParameterError(f"not a saved state ({error})", where=where, allowed="to_mapping()") from None
        if packed.ndim != 1 or not np.all(np.isfinite((*packed, state.last_input, state.bend))):
            raise ParameterError("saved state holds values that are not finite", where=where, allowed="finite")
        return state


@dataclass(frozen=True, eq=False)
class PiezoModel:
    """A piezo actuator: Maxwell elements, creep order and effects.

    Args:
        kappa_um_per_v: gains kappa_i [um/V], shape (n + 1,); the last element never saturates.
        saturation_v: saturation voltages u_S,i [V], shape (n,).
        creep_order: alpha [1], 0 (none) to 1 (integrator).
        effects: further effects, at most one of a kind; they act in the order of the chain.

    Raises:
        ParameterError: naming the field, its value and what is allowed.
    """

    kappa_um_per_v: Array
    saturation_v: Array
    creep_order: float
    effects: tuple[Effect, ...] = ()

    def __post_init__(self) -> None:
        kappa, saturation = check_elements(self.kappa_um_per_v, self.saturation_v)
        kappa.flags.writeable = saturation.flags.writeable = False
        object.__setattr__(self, "kappa_um_per_v", kappa)
        object.__setattr__(self, "saturation_v", saturation)
        object.__setattr__(self, "creep_order", check_order(self.creep_order, "model.creep_order"))
        names = [effect.name for effect in self.effects]
        for name in names:
            if names.count(name) > 1:
                raise ParameterError("effect named twice", where="model.effects", value=name, allowed="each once")
        object.__setattr__(self, "effects", tuple(sorted(self.effects, key=lambda effect: effect.place)))

    def __str__(self) -> str:
        gain = f"gain {self.play_form.slope:.5g} um/V at a turning point"
        if self.n_elements:
            low_v, high_v = self.saturation_v.min(), self.saturation_v.max()
            gain += f", {self.kappa_um_per_v[-1]:.5g} um/V once all elements slip; "
            gain += f"saturation voltages {low_v:.4g} to {high_v:.4g} V"
        lines = [f"piezo model: {self.n_elements} elements, creep order {self.creep_order:.5g}", gain]
        return "\n".join([*lines, *(f"effect {effect}" for effect in self.effects)])

    @property
    def n_elements(self) -> int:
        """Number of elements that saturate."""
        return int(self.saturation_v.size)

    @cached_property
    def stop_form(self) -> OperatorSum:
        """Displacement -> voltage."""
        return stop_form(self.kappa_um_per_v, self.saturation_v)

    @cached_property
    def play_form(self) -> OperatorSum:
        """Voltage -> displacement."""
        return play_form(self.kappa_um_per_v, self.saturation_v)

    @cached_property
    def creep_modes(self) -> CreepModes:
        """Modes of the fractional operator."""
        return creep_modes(self.creep_order)

    @cached_property
    def at_creep(self) -> int:
        """Where the creep block begins in the packed state."""
        return int(hysteresis_block(self.play_form).size)

    def of_stage(self, stage: Stage) -> tuple[Effect, ...]:
        """Return the effects of one stage, in the order of the chain."""
        return tuple(effect for effect in self.effects if effect.stage is stage)

    def with_effects(self, *effects: Effect) -> PiezoModel:
        """Return the model with these effects added, each taking the place of one of its kind."""
        new = {effect.name for effect in effects}
        kept = tuple(effect for effect in self.effects if effect.name not in new)
        return PiezoModel(self.kappa_um_per_v, self.saturation_v, self.creep_order, kept + effects)

    def initial_state(self) -> ModelState:
        """Return the relaxed state, or the one the effect ``initial_state`` describes."""
        packed = np.concatenate((hysteresis_block(self.play_form), creep_block(self.creep_modes)))
        state = ModelState(packed, {effect.name: effect.initial_state() for effect in self.effects})
        for effect in self.effects:
            if isinstance(effect, InitialState):
                self.settle(state, *effect.prehistory())
        return state

    def settle(self, state: ModelState, steps_s: Array, voltage_v: Array) -> None:
        """Move the state through what went before the record; clocks of time-dependent effects do not run."""
        settle_chain(state, self.at_creep, self.effects, steps_s, voltage_v)

    def advance(
        self,
        state: ModelState,
        voltage_v: float,
        step_s: float,
        *,
        temperature_c: float = np.nan,
        cross: float = np.nan,
    ) -> float:
        """Return the displacement [um] after one step of ``step_s`` [s] that ends at ``voltage_v`` [V].

        Args:
            state: from ``initial_state``; moves on.
            voltage_v: drive at the end of the step [V]; linear from the step before.
            step_s: length of the step [s], > 0, any length.
            temperature_c: temperature [degC], for effects that use it.
            cross: second axis, for effects that use it.
        """
        if not self.effects:
            if IS_COMPILED:
                moved = forward_step(state.packed, self.at_creep, voltage_v, step_s)
            else:
                moved = state.plain_kernels(self.at_creep).forward(voltage_v, step_s)
            if moved != moved:  # the kernels answer unfit input with NaN: half the cost of a check beforehand
                check_step(step_s, voltage_v, "voltage_v")
            state.last_input = voltage_v
            return moved
        check_step(step_s, voltage_v, "voltage_v")
        one = self.simulate(
            np.array([step_s]),
            np.array([voltage_v]),
            state,
            temperature_c=None if np.isnan(temperature_c) else np.array([temperature_c]),
            cross=None if np.isnan(cross) else np.array([cross]),
        )
        return float(one[0])

    def simulate(
        self,
        steps_s: Array,
        voltage_v: Array,
        state: ModelState | None = None,
        *,
        temperature_c: Array | None = None,
        cross: Array | None = None,
    ) -> Array:
        """Return the displacement [um] of each sample, shape (n_samples,).

        Args:
            steps_s: step that leads to each sample [s], > 0, any lengths, shape (n_samples,).
            voltage_v: drive [V], linear between samples, shape (n_samples,).
            state: moves on where given; else the initial state is used.
            temperature_c: temperature [degC], shape (n_samples,), for effects that use it.
            cross: second axis, shape (n_samples,), for effects that use it.
        """
        steps, drive = _checked_inputs(steps_s, voltage_v, "voltage_v")
        state = self.initial_state() if state is None else state
        if not self.effects:
            state.last_input = float(drive[-1])
            moved = np.empty(drive.size)
            forward(state.packed, self.at_creep, drive, steps, moved)
            return moved
        return run_chain(state, self.at_creep, self.effects, steps, drive, temperature_c=temperature_c, cross=cross)

    def to_mapping(self) -> dict[str, Any]:
        """Return the model as plain numbers and lists: the ``model`` block of a model file."""
        mapping: dict[str, Any] = {
            "kappa_um_per_v": self.kappa_um_per_v.tolist(),
            "saturation_v": self.saturation_v.tolist(),
            "creep_order": self.creep_order,
        }
        if self.effects:
            mapping["effects"] = [effect.name for effect in self.effects]
            mapping.update({effect.name: effect.to_mapping() for effect in self.effects})
        return mapping

    @classmethod
    def from_mapping(cls, mapping: Any, where: str = "model") -> PiezoModel:
        """Return the model of a ``model`` block; raises ParameterError naming key, value and what is allowed."""
        known = ("kappa_um_per_v", "saturation_v", "creep_order")
        if not isinstance(mapping, dict):
            raise ParameterError("not a mapping", where=where, value=mapping, allowed=", ".join(known))
        for key in known:
            if key not in mapping:
                raise ParameterError(f"{key} is missing", where=where, allowed=", ".join(known))
        names = mapping.get("effects") or []
        if not isinstance(names, (list, tuple)):
            raise ParameterError("not a list", where=f"{where}.effects", value=names, allowed="a list of effect names")
        effects = []
        for name in names:
            kind = effect_class(name, f"{where}.effects")
            if name not in mapping:
                raise ParameterError(f"parameters of {name} are missing", where=where, allowed=f"a block {name}")
            effects.append(kind.from_mapping(mapping[name], f"{where}.{name}"))
        for key in mapping:
            if key not in known and key != "effects" and key not in names:
                raise ParameterError(
                    "unknown key", where=where, value=key, allowed=", ".join((*known, "effects", *names))
                )
        for key in known[:2]:
            entries = _iterable(mapping[key])
            if isinstance(mapping[key], (str, bool)) or any(isinstance(v, (bool, str)) for v in entries):
                raise ParameterError(
                    "not a list of numbers", where=f"{where}.{key}", value=mapping[key], allowed="finite, > 0"
                )
        return cls(mapping["kappa_um_per_v"], mapping["saturation_v"], mapping["creep_order"], tuple(effects))


def check_step(step_s: float, value: float, name: str) -> None:
    """Raise ParameterError unless a step [s] is positive and finite and the value that ends it finite."""
    if not 0.0 < step_s < math.inf:
        raise ParameterError("step is not positive", where="step_s", value=step_s, allowed="> 0 s, finite")
    if not -math.inf < value < math.inf:
        raise ParameterError("value is not finite", where=name, value=value, allowed="finite numbers")


def _iterable(value: Any) -> Any:
    return value if isinstance(value, (list, tuple)) else ()


def _checked_inputs(steps_s: Array, values: Array, name: str) -> tuple[Array, Array]:
    steps = np.ascontiguousarray(steps_s, dtype=np.float64)
    inputs = np.ascontiguousarray(values, dtype=np.float64)
    if steps.ndim != 1 or steps.shape != inputs.shape or steps.size == 0:
        raise ParameterError(
            "steps_s and input do not fit",
            where=name,
            value=(steps.shape, inputs.shape),
            allowed="two arrays of one shape (n_samples,)",
        )
    is_bad = ~((steps > 0.0) & (steps < np.inf))
    if np.any(is_bad):
        k = int(np.argmax(is_bad))
        value = float(steps[k])
        raise ParameterError(f"step {k} is not positive", where="steps_s", value=value, allowed="> 0 s, finite")
    if not np.all(np.isfinite(inputs)):
        raise ParameterError("value is not finite", where=name, allowed="finite numbers")
    return steps, inputs


def settle_chain(state: ModelState, at_creep: int, effects: tuple[Effect, ...], steps: Array, drive: Array) -> None:
    """Move the state through what went before a record; clocks of time-dependent effects do not run."""
    lasting = tuple(e for e in effects if e.stage not in (Stage.SENSED, Stage.SAMPLED_DRIVE) and e.name != "clock_skew")
    run_chain(state, at_creep, lasting, steps, drive)


def run_chain(
    state: ModelState,
    at_creep: int,
    effects: tuple[Effect, ...],
    steps: Array,
    drive: Array,
    *,
    temperature_c: Array | None = None,
    cross: Array | None = None,
    is_coarse: bool = False,
) -> Array:
    """Return the displacement [um] the chain gives, shape (n_samples,); the state moves on.

    Args:
        state: packed hysteresis (play form) and creep blocks, and the effects' states.
        at_creep: where the creep block begins.
        effects: in the order of the chain.
        steps: steps [s], shape (n_samples,).
        drive: voltage [V], shape (n_samples,).
        temperature_c: temperature [degC], shape (n_samples,), where known.
        cross: second axis, shape (n_samples,), where known.
        is_coarse: divide the largest steps only, for directions and first looks.
    """
    covariates = {"cross_axis": cross, "thermal_drift": temperature_c}
    stages = {stage: [effect for effect in effects if effect.stage is stage] for stage in Stage}
    for effect in stages[Stage.SAMPLED_DRIVE]:
        drive = effect.run(state.effects[effect.name], drive, steps)
    last, state.last_input = state.last_input, float(drive[-1])
    n_plays = int(state.packed[N_PLAYS])
    scale_v = float(state.packed[PLAYS_HEADER + n_plays - 1]) if n_plays else float("inf")
    before = np.concatenate(([last], drive[:-1]))
    parts, state.bend = parts_of_steps(drive - before, scale_v, effects, is_coarse, state.bend)
    is_divided = bool(np.any(parts > 1))
    fine_steps, fine_drive, ends = subdivide(steps, drive, last, parts) if is_divided else (steps, drive, None)
    for effect in stages[Stage.DRIVE]:
        fine_drive = effect.run(state.effects[effect.name], fine_drive, fine_steps)
    moved = np.empty(fine_drive.size)
    for effect in stages[Stage.HYSTERESIS]:
        if isinstance(effect, AsymmetricHysteresis):
            fine_drive = effect.warp(fine_drive)
    if stages[Stage.HYSTERESIS]:
        added = np.zeros(fine_drive.size)
        for effect in stages[Stage.HYSTERESIS]:
            added += effect.run(state.effects[effect.name], fine_drive, fine_steps)
        forward_beside(state.packed, at_creep, fine_drive, added, fine_steps, moved)
    else:
        forward(state.packed, at_creep, fine_drive, fine_steps, moved)
    for effect in stages[Stage.MECHANICAL]:
        moved = effect.run(state.effects[effect.name], moved, fine_steps)
    if ends is not None:
        moved = moved[ends]
    for effect in stages[Stage.SENSED]:
        moved = effect.run(state.effects[effect.name], moved, steps, covariates.get(effect.name))
    return moved

"""The model of the chain: drive effects, hysteresis, creep, mechanical effects, sensor effects.

Without effects it is the FOMRC of equations (20)-(26): voltage through the play form of the Maxwell elements,
then the fractional integrator, sample by sample, so that the direct inverse undoes it to rounding. Where a model says
so (``substeps``) the drive is taken as linear between samples, and larger steps are divided.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.compiled import IS_COMPILED
from fomrc_core.compute.notebook import CurvePanel, curves_figure, shown_as_html
from fomrc_core.effects import Covariates, Effect, Stage, in_chain_order
from fomrc_core.effects.base.cause import Cause
from fomrc_core.errors import ParameterError
from fomrc_core.model.causes import cause_class, named_order
from fomrc_core.model.inputs import check_step, checked_inputs
from fomrc_core.model.kernels import forward_step
from fomrc_core.model.prehistory import Prehistory
from fomrc_core.model.simulation import of_stage, relaxed_state, run_chain, settle_chain
from fomrc_core.model.state import ModelState
from fomrc_core.model.substeps import BY_EFFECTS, Substeps, substeps_of
from fomrc_core.operators.creep import SHORTEST_TIME_S, CreepModes, check_order, creep_modes
from fomrc_core.operators.hysteresis import OperatorSum, check_elements, hysteresis_block, play_form, stop_form

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_DRAWN_HZ = 500.0
_SLIPPING = 4.0  # times the largest saturation voltage: the drive turns with every element slipping
_NEEDED = ("kappa_um_per_v", "saturation_v", "creep_order")  # of a model block


@dataclass(frozen=True, eq=False)
class PiezoModel:
    """A piezo actuator: Maxwell elements, creep order and effects.

    Args:
        kappa_um_per_v: gains kappa_i [um/V], shape (n + 1,); the last element never saturates.
        saturation_v: saturation voltages u_S,i [V], shape (n,).
        creep_order: alpha [1], 0 (none) to 1 (integrator).
        effects: further effects, at most one of a kind; they act in the order of the chain.
        start: what went before a record, where it does not begin relaxed.
        substeps: how finely steps are divided. NONE, from sample to sample, is what a compensator undoes to rounding;
            BENDS follows what hysteresis and creep do within a step, as a mass that rings or an amplifier sees it.
        shortest_time_s: shortest time its creep holds for [s]: about half the step of the fastest record it is for.

    Raises:
        ParameterError: naming the field, its value and what is allowed.
    """

    kappa_um_per_v: Array
    saturation_v: Array
    creep_order: float
    effects: tuple[Effect, ...] = ()
    start: Prehistory | None = None
    substeps: Substeps = Substeps.NONE
    shortest_time_s: float = SHORTEST_TIME_S

    def __post_init__(self) -> None:
        kappa, saturation = check_elements(self.kappa_um_per_v, self.saturation_v)
        kappa.flags.writeable = saturation.flags.writeable = False
        object.__setattr__(self, "kappa_um_per_v", kappa)
        object.__setattr__(self, "saturation_v", saturation)
        object.__setattr__(self, "creep_order", check_order(self.creep_order, "model.creep_order"))
        object.__setattr__(self, "shortest_time_s", _shortest_time(self.shortest_time_s))
        names = [effect.name for effect in self.effects]
        for name in names:
            if names.count(name) > 1:
                raise ParameterError("effect named twice", where="model.effects", value=name, allowed="each once")
        object.__setattr__(self, "effects", in_chain_order(self.effects))

    def __str__(self) -> str:
        gain = f"gain {self.play_form.slope:.5g} um/V at a turning point"
        if self.n_elements:
            low_v, high_v = self.saturation_v.min(), self.saturation_v.max()
            gain += f", {self.kappa_um_per_v[-1]:.5g} um/V once all elements slip; "
            gain += f"saturation voltages {low_v:.4g} to {high_v:.4g} V"
        lines = [f"piezo model: {self.n_elements} elements, creep order {self.creep_order:.5g}", gain]
        return "\n".join([*lines, *(f"effect {cause}" for cause in self.causes)])

    def _repr_html_(self) -> str:
        return shown_as_html("PiezoModel", str(self))

    def plot(self, largest_v: float | None = None) -> Figure:
        """Return a figure of its loop and of its displacement over time, on falling cycles at 1 Hz.

        Args:
            largest_v: largest voltage [V]; four times the largest saturation voltage where not given.

        Raises:
            ParameterError: a voltage outside what is allowed.
        """
        from fomrc_core.records.excitation import triangle

        amplitude_v = largest_v if largest_v is not None else _SLIPPING * float(self.saturation_v.max(initial=0.0))
        drive = triangle(amplitude_v or 1.0, slope_v_per_s=4.0 * (amplitude_v or 1.0), rate_hz=_DRAWN_HZ).to_recording()
        moved_um = self.simulate(drive.steps_s, drive.voltage_v)
        loop = CurvePanel("loop", "voltage [V]", "displacement [µm]", drive.voltage_v, {"simulated": moved_um})
        over_time = CurvePanel("over time", "time [s]", "displacement [µm]", drive.time_s, {"simulated": moved_um})
        return curves_figure((loop, over_time))

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
        return creep_modes(self.creep_order, shortest_time_s=self.shortest_time_s)

    @cached_property
    def _is_plain(self) -> bool:
        """Whether a step is one of hysteresis and creep and nothing else."""
        return not self.effects and self.substeps is Substeps.NONE

    @cached_property
    def at_creep(self) -> int:
        """Where the creep block begins in the packed state."""
        return int(hysteresis_block(self.play_form).size)

    def of_stage(self, stage: Stage) -> tuple[Effect, ...]:
        """Return the effects of one stage, in the order of the chain."""
        return of_stage(self.effects, stage)

    @property
    def causes(self) -> tuple[Cause, ...]:
        """What a model file names beside hysteresis and creep: the effects, and the start where it is not relaxed."""
        return named_order(self.effects, self.start)

    def with_effects(self, *effects: Effect) -> PiezoModel:
        """Return the model with these effects added, each taking the place of one of its kind."""
        new = {effect.name for effect in effects}
        kept = tuple(effect for effect in self.effects if effect.name not in new)
        return replace(self, effects=kept + effects)

    def sampled_every(self, step_s: float) -> PiezoModel:
        """Return the model with its effects as they are among even samples this far apart [s]."""
        return replace(self, effects=tuple(effect.sampled_every(step_s) for effect in self.effects))

    def with_start(self, start: Prehistory | None) -> PiezoModel:
        """Return the model with what went before a record replaced; None for a relaxed start."""
        return replace(self, start=start)

    def initial_state(self) -> ModelState:
        """Return the relaxed state, or the one the model's ``start`` leaves."""
        state, _ = relaxed_state(self.play_form, self.creep_modes, self.effects)
        if self.start is not None:
            self.settle(state, *self.start.drive())
        return state

    def settle(self, state: ModelState, steps_s: Array, voltage_v: Array) -> None:
        """Move the state through what went before the record; clocks of time-dependent effects do not run."""
        settle_chain(state, self.at_creep, self.effects, (steps_s, voltage_v), self.substeps)

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
        if self._is_plain:
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
        steps, drive = checked_inputs(steps_s, voltage_v, "voltage_v")
        state = self.initial_state() if state is None else state
        return run_chain(
            state,
            self.at_creep,
            self.effects,
            steps,
            drive,
            substeps=self.substeps,
            covariates=Covariates(temperature_c, cross),
        )

    def to_mapping(self) -> dict[str, Any]:
        """Return the model as plain numbers and lists: the ``model`` block of a model file."""
        mapping: dict[str, Any] = {
            "kappa_um_per_v": self.kappa_um_per_v.tolist(),
            "saturation_v": self.saturation_v.tolist(),
            "creep_order": self.creep_order,
        }
        if self.causes:
            mapping["effects"] = [cause.name for cause in self.causes]
            mapping.update({cause.name: cause.to_mapping() for cause in self.causes})
        if self.causes or self.substeps is not Substeps.NONE:
            mapping["substeps"] = self.substeps.value
        if self.shortest_time_s != SHORTEST_TIME_S:
            mapping["shortest_time_s"] = self.shortest_time_s
        return mapping

    @classmethod
    def from_mapping(cls, mapping: Any, where: str = "model") -> PiezoModel:
        """Return the model of a ``model`` block; raises ParameterError naming key, value and what is allowed."""
        if not isinstance(mapping, dict):
            raise ParameterError("not a mapping", where=where, value=mapping, allowed=", ".join(_NEEDED))
        for key in _NEEDED:
            if key not in mapping:
                raise ParameterError(f"{key} is missing", where=where, allowed=", ".join(_NEEDED))
        causes = _causes_of(mapping, where)
        allowed = (*_NEEDED, "effects", "substeps", "shortest_time_s", *(cause.name for cause in causes))
        for key in mapping:
            if key not in allowed:
                raise ParameterError("unknown key", where=where, value=key, allowed=", ".join(allowed))
        for key in ("kappa_um_per_v", "saturation_v"):
            entries = mapping[key] if isinstance(mapping[key], (list, tuple)) else ()
            if isinstance(mapping[key], (str, bool)) or any(isinstance(v, (bool, str)) for v in entries):
                raise ParameterError(
                    "not a list of numbers", where=f"{where}.{key}", value=mapping[key], allowed="finite, > 0"
                )
        effects = tuple(cause for cause in causes if isinstance(cause, Effect))
        start = next((cause for cause in causes if isinstance(cause, Prehistory)), None)
        substeps = substeps_of(mapping.get("substeps", BY_EFFECTS), effects, start is not None, f"{where}.substeps")
        shortest = mapping.get("shortest_time_s", SHORTEST_TIME_S)
        elements = mapping["kappa_um_per_v"], mapping["saturation_v"]
        return cls(*elements, mapping["creep_order"], effects, start, substeps, shortest)


def _shortest_time(value: Any) -> float:
    is_number = isinstance(value, (int, float, np.floating)) and not isinstance(value, bool)
    if not is_number or not 0.0 < value <= SHORTEST_TIME_S:
        allowed = f"> 0, at most {SHORTEST_TIME_S:g} s"
        raise ParameterError("shortest time out of range", where="model.shortest_time_s", value=value, allowed=allowed)
    return float(value)


def _causes_of(mapping: dict[str, Any], where: str) -> list[Cause]:
    """Return the causes a ``model`` block names, from their own blocks."""
    names = mapping.get("effects") or []
    if not isinstance(names, (list, tuple)):
        raise ParameterError("not a list", where=f"{where}.effects", value=names, allowed="a list of effect names")
    causes = []
    for name in names:
        kind = cause_class(name, f"{where}.effects")
        if names.count(name) > 1:
            raise ParameterError("effect named twice", where=f"{where}.effects", value=name, allowed="each once")
        if name not in mapping:
            raise ParameterError(f"parameters of {name} are missing", where=where, allowed=f"a block {name}")
        causes.append(kind.from_mapping(mapping[name], f"{where}.{name}"))
    return causes

"""Many actuators stepped together: hysteresis and creep of each, side by side in memory, one compiled step for all.

The same equations as ``PiezoModel`` and ``Compensator`` of models without effects, actuator by actuator. Numbers of all
actuators lie in one array each, a row for each actuator. The creep modes of all share their rates (creep_modes.py), so
that what a step makes of them is computed once; they are kept shifted and scaled, as in a batch of equal steps
(operators/creep_batch.py): two operations a mode.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.errors import ParameterError
from fomrc_core.model.array_kernels import compensate_array, simulate_array
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.substeps import Substeps
from fomrc_core.operators.creep import (
    DECAY,
    FROM_CURRENT,
    FROM_PREVIOUS,
    HEADER,
    CreepModes,
    creep_block,
    creep_modes,
    prepare_step,
)

_ANY_ORDER = 0.5  # the rates of the modes are the same for all orders between 0 and 1
# Rows are filled to whole vector registers with entries that stand for nothing: weight 0.
_LANES = 8


@dataclass(eq=False)
class ArrayState:
    """What an array remembers; changes as it is stepped, bounded in size.

    Attributes:
        is_inverse: whether it belongs to the compensation; else to the simulation.
        plays: play states, shape (n_actuators, n_plays): [V], of a compensation [um].
        modes: creep modes, shifted and scaled for steps of ``step_s``, shape (n_actuators, n_modes).
        previous_um: input of creep at the last step [um], shape (n_actuators,).
        step_s: length of step the modes are kept for [s]; 0 before the first.
    """

    is_inverse: bool
    plays: Array
    modes: Array
    previous_um: Array
    step_s: float = 0.0

    def copy(self) -> ArrayState:
        """Return an independent copy."""
        return ArrayState(self.is_inverse, self.plays.copy(), self.modes.copy(), self.previous_um.copy(), self.step_s)

    def to_mapping(self) -> dict[str, Any]:
        """Return the state as plain numbers and lists."""
        return {
            "is_inverse": self.is_inverse,
            "plays": self.plays.tolist(),
            "modes": self.modes.tolist(),
            "previous_um": self.previous_um.tolist(),
            "step_s": self.step_s,
        }


@dataclass(frozen=True, eq=False)
class _StepTables:
    """What a length of step makes of all actuators' creep; rows (n_actuators, n_modes), columns (n_actuators,)."""

    decays: Array
    gains: Array
    from_current: Array
    weighted: Array
    held: Array
    now: Array


@dataclass(frozen=True, eq=False)
class ActuatorArray:
    """N actuators with models of their own, stepped together.

    Args:
        models: one for each actuator; any number of elements, any creep order, no effects, and steps not divided.

    Raises:
        ParameterError: no model, or one with effects, a past or divided steps, naming the actuator.
    """

    models: Sequence[PiezoModel]

    def __post_init__(self) -> None:
        object.__setattr__(self, "models", tuple(self.models))
        if not self.models:
            raise ParameterError("no actuator", where="models", allowed="one model or more")
        for number, model in enumerate(self.models):
            if not model.effects and model.substeps is Substeps.NONE and model.start is None:
                continue
            raise ParameterError(
                "model is more than elements and creep",
                where=f"models[{number}]",
                value=", ".join(cause.name for cause in model.causes) or model.substeps.value,
                allowed="no effects, no past, steps not divided",
            )
        times_s = sorted({model.shortest_time_s for model in self.models})
        if len(times_s) > 1:
            raise ParameterError(
                "creep of the models does not hold from the same time on",
                where="models, shortest_time_s",
                value=times_s,
                allowed="one shortest time for all",
            )

    def __str__(self) -> str:
        orders = [model.creep_order for model in self.models]
        counts = [model.n_elements for model in self.models]
        return (
            f"array of {self.n_actuators} actuators: {min(counts)} to {max(counts)} elements, "
            f"creep order {min(orders):.4g} to {max(orders):.4g}"
        )

    @property
    def n_actuators(self) -> int:
        """Number of actuators."""
        return len(self.models)

    def initial_state(self, *, is_inverse: bool = False) -> ArrayState:
        """Return the relaxed state of the simulation, or of the compensation."""
        n_plays, n_modes = self._thresholds(is_inverse).shape[1], self._rates_per_s.size
        return ArrayState(
            is_inverse,
            np.zeros((self.n_actuators, n_plays)),
            np.zeros((self.n_actuators, n_modes)),
            np.zeros(self.n_actuators),
        )

    def advance(self, state: ArrayState, values: Array, step_s: float) -> Array:
        """Return the answer of every actuator after one step, shape (n_actuators,).

        Args:
            state: from ``initial_state``; moves on. Says which way: voltages [V] in and displacements [um] out, or
                desired displacements [um] in and voltages [V] out.
            values: voltages or desired displacements at the end of the step, shape (n_actuators,).
            step_s: length of the step [s], > 0.

        Raises:
            ParameterError: a value that is not finite, a shape or a step that does not fit.
        """
        given = np.ascontiguousarray(values, dtype=np.float64)
        if given.shape != (self.n_actuators,):
            raise ParameterError(
                "number of values does not fit", where="values", value=given.shape, allowed=f"({self.n_actuators},)"
            )
        if not 0.0 < step_s < math.inf:
            raise ParameterError("step is not positive", where="step_s", value=step_s, allowed="> 0 s, finite")
        _check_finite(given)
        out = np.empty((1, self.n_actuators))
        self._step_all(state, step_s, given[None], out)
        answer: Array = out[0]
        return answer

    def simulate(self, steps_s: Array, voltage_v: Array, state: ArrayState | None = None) -> Array:
        """Return the displacement [um] of every actuator at each sample, shape (n_samples, n_actuators).

        Args:
            steps_s: step that leads to each sample [s], > 0, shape (n_samples,).
            voltage_v: drive [V], linear between samples, shape (n_samples, n_actuators).
            state: moves on where given; else all start relaxed.

        Raises:
            ParameterError: a value that is not finite, a shape or a step that does not fit, a state of the other way.
        """
        return self._run(self._state_for(state, is_inverse=False), steps_s, voltage_v)

    def compensate(self, steps_s: Array, desired_um: Array, state: ArrayState | None = None) -> Array:
        """Return the voltage [V] for every actuator at each sample, shape (n_samples, n_actuators).

        Args:
            steps_s: step that leads to each sample [s], > 0, shape (n_samples,).
            desired_um: desired displacement [um], shape (n_samples, n_actuators).
            state: moves on where given; else all start relaxed.

        Raises:
            ParameterError: a value that is not finite, a shape or a step that does not fit, a state of the other way.
        """
        return self._run(self._state_for(state, is_inverse=True), steps_s, desired_um)

    def restore(self, mapping: Any, where: str = "state") -> ArrayState:
        """Return the state of a mapping; raises ParameterError for anything that is not a state of this array."""
        try:
            is_inverse, step_s = mapping["is_inverse"], float(mapping["step_s"])
            arrays = [np.array(mapping[name], dtype=np.float64) for name in ("plays", "modes", "previous_um")]
        except (KeyError, TypeError, ValueError) as error:
            raise ParameterError(f"not a saved state ({error})", where=where, allowed="to_mapping()") from None
        if not isinstance(is_inverse, bool):
            raise ParameterError("not a saved state", where=where, value=is_inverse, allowed="to_mapping()")
        fresh = self.initial_state(is_inverse=is_inverse)
        shapes = [fresh.plays.shape, fresh.modes.shape, fresh.previous_um.shape]
        if [array.shape for array in arrays] != shapes:
            raise ParameterError(
                "saved by another array", where=where, value=[array.shape for array in arrays], allowed=str(shapes)
            )
        if not (math.isfinite(step_s) and step_s >= 0.0 and all(np.all(np.isfinite(array)) for array in arrays)):
            raise ParameterError("saved state holds values that are not finite", where=where, allowed="finite")
        plays, modes, previous_um = arrays
        return ArrayState(is_inverse, plays, modes, previous_um, step_s)

    def _state_for(self, state: ArrayState | None, is_inverse: bool) -> ArrayState:
        if state is None:
            return self.initial_state(is_inverse=is_inverse)
        if state.is_inverse is not is_inverse:
            ways = {False: "a simulation", True: "a compensation"}
            raise ParameterError(
                f"state of {ways[state.is_inverse]}", where="state", allowed=f"one of {ways[is_inverse]}"
            )
        return state

    def _run(self, state: ArrayState, steps_s: Array, values: Array) -> Array:
        steps = np.ascontiguousarray(steps_s, dtype=np.float64)
        given = np.ascontiguousarray(values, dtype=np.float64)
        if steps.ndim != 1 or given.shape != (steps.size, self.n_actuators):
            raise ParameterError(
                "steps_s and values do not fit",
                where="values",
                value=(steps.shape, given.shape),
                allowed=f"(n_samples,) and (n_samples, {self.n_actuators})",
            )
        if not np.all((steps > 0.0) & (steps < math.inf)):
            raise ParameterError("step is not positive", where="steps_s", allowed="> 0 s, finite")
        _check_finite(given)
        out = np.empty_like(given)
        start = 0
        while start < steps.size:
            stop = start + 1
            while stop < steps.size and steps[stop] == steps[start]:
                stop += 1
            self._step_all(state, float(steps[start]), given[start:stop], out[start:stop])
            start = stop
        return out

    def _step_all(self, state: ArrayState, step_s: float, values: Array, out: Array) -> None:
        """Fill ``out`` with the answers to values that come in steps of one length, (n_samples, n_actuators)."""
        tables = self._prepared(state, step_s)
        slopes, thresholds, weights = self._form(state.is_inverse)
        kernel = compensate_array if state.is_inverse else simulate_array
        kernel(
            *(slopes, thresholds, weights, state.plays),
            *(tables.decays, tables.weighted, tables.held, tables.now, state.modes, state.previous_um),
            *(values, out),
        )

    def _prepared(self, state: ArrayState, step_s: float) -> _StepTables:
        """Return the tables of a step, with the state's modes brought to it."""
        tables = self._tables(step_s)
        if state.step_s != step_s:
            if state.step_s != 0.0:
                before = self._tables(state.step_s)
                modes = before.gains * state.modes + before.from_current * state.previous_um[:, None]
                state.modes[:] = (modes - tables.from_current * state.previous_um[:, None]) / tables.gains
            state.step_s = step_s
        return tables

    def _tables(self, step_s: float) -> _StepTables:
        known = self._known_tables
        if step_s not in known:
            while len(known) >= 4:  # a loop has one or two lengths of step; jittered steps are prepared each
                known.pop(next(iter(known)))
            known[step_s] = self._new_tables(step_s)
        return known[step_s]

    def _new_tables(self, step_s: float) -> _StepTables:
        block = creep_block(self._shared_modes)
        prepare_step(block, 0, step_s)
        n_shared = int(block[0])
        rows = block[HEADER:].reshape(-1, n_shared)
        n_modes = self._rates_per_s.size

        def filled(row: Array, idle: float) -> Array:
            return np.concatenate((row, np.full(n_modes - n_shared, idle)))

        decays = filled(rows[DECAY], 0.0)
        from_previous, from_current = filled(rows[FROM_PREVIOUS], 1.0), filled(rows[FROM_CURRENT], 0.0)
        gains = from_previous + decays * from_current
        orders = np.array([model.creep_order for model in self.models])
        now = np.array([step_s**order / math.gamma(order + 2.0) for order in orders])
        weights = self._mode_weights
        held = self._feedthroughs - now + weights @ (from_previous + from_current) + (weights * decays) @ from_current
        # Of a mode's former value, and of what the present input adds to it before it is kept.
        return _StepTables(decays, gains, from_current, weights * (decays * gains), held, now)

    @cached_property
    def _known_tables(self) -> dict[float, _StepTables]:
        return {}

    @cached_property
    def _shared_modes(self) -> CreepModes:
        return creep_modes(_ANY_ORDER, shortest_time_s=self.models[0].shortest_time_s)

    @cached_property
    def _rates_per_s(self) -> Array:
        shared = self._shared_modes.rates_per_s
        return np.concatenate((shared, np.zeros((-shared.size) % _LANES)))

    @cached_property
    def _mode_weights(self) -> Array:
        weights = np.zeros((self.n_actuators, self._rates_per_s.size))
        for row, model in zip(weights, self.models, strict=True):
            own = model.creep_modes.weights  # none for order 0, the integrator alone for order 1
            row[: own.size] = own
        return weights

    @cached_property
    def _feedthroughs(self) -> Array:
        return np.array([model.creep_modes.feedthrough for model in self.models])

    def _form(self, is_inverse: bool) -> tuple[Array, Array, Array]:
        return self._stop_forms if is_inverse else self._play_forms

    def _thresholds(self, is_inverse: bool) -> Array:
        return self._form(is_inverse)[1]

    @cached_property
    def _play_forms(self) -> tuple[Array, Array, Array]:
        return self._packed(is_inverse=False)

    @cached_property
    def _stop_forms(self) -> tuple[Array, Array, Array]:
        return self._packed(is_inverse=True)

    def _packed(self, is_inverse: bool) -> tuple[Array, Array, Array]:
        forms = [model.stop_form if is_inverse else model.play_form for model in self.models]
        n_plays = max(form.thresholds.size for form in forms)
        n_plays += (-n_plays) % _LANES
        thresholds, weights = np.zeros((2, self.n_actuators, n_plays))
        for row, form in enumerate(forms):
            thresholds[row, : form.thresholds.size] = form.thresholds
            weights[row, : form.weights.size] = form.weights
        return np.array([form.slope for form in forms]), thresholds, weights


def _check_finite(values: Array) -> None:
    # Not a number goes through both, and neither warns.
    if not (values.min() > -math.inf and values.max() < math.inf):
        raise ParameterError("value is not finite", where="values", allowed="finite numbers")

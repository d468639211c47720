"""A stage of several axes: what each input does by itself, then the modes and the coupling they share.

    voltages -> hysteresis and creep of each input -> delay -> modes + static coupling -> displacements

Every part can be left out; one axis without modes is its ``PiezoModel``, bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import ParameterError
from fomrc_core.model.axes.kernels import (
    LEVEL_TOLD,
    LEVEL_USED,
    N_PIECES,
    N_SCALARS,
    N_SLOTS,
    run_modes,
    set_level,
)
from fomrc_core.model.axes.modes import AxesModes, LevelLaw, RateRelay
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.state import ModelState

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass
class AxesState:
    """What a model of several axes remembers; the one mutable thing, bounded in size.

    Attributes:
        axes: state of each input's hysteresis and creep.
        arrays: of the modes, by name (kernels.py): pole states, queue of the delay, level.
        relay: last voltage [V] and last bent rate of each input, (2, n_inputs).
    """

    axes: tuple[ModelState, ...]
    arrays: dict[str, NDArray[Any]]
    relay: Array

    def copy(self) -> AxesState:
        """Return an independent copy."""
        arrays = {name: array.copy() for name, array in self.arrays.items()}
        return AxesState(tuple(axis.copy() for axis in self.axes), arrays, self.relay.copy())

    def to_mapping(self) -> dict[str, Any]:
        """Return the state as plain numbers and lists; complex numbers as pairs."""
        arrays = {k: _plain(v) for k, v in self.arrays.items()}
        axes = [axis.to_mapping() for axis in self.axes]
        return {"axes": axes, "arrays": arrays, "relay": self.relay.tolist()}


@dataclass(frozen=True, eq=False)
class AxesModel:
    """A stage with n voltages and m displacements.

    Args:
        axes: hysteresis and creep of each input, one for each voltage.
        modes: shared modes, driven by what the inputs' models move; none if left out.
        coupling: what moves at once [um/um], shape (n_outputs, n_inputs); each input its own output where there are
            no modes, nothing where there are.
        delay_s: between drive and everything that moves [s].
        level: the slow state by which modes change with the drive's level; none if left out.
        coupling_change: relative change of the coupling with q of the level.
        joints: shapes of joints whose force is s |s| of their strain s, shape (n_joints, n_modes): strain is the
            shapes' sum over the modes' motion, and its force acts on the modes by the same shapes; to first order,
            so that what stands still without joints stands still with them.

        rate_relay: what the drives' amplifiers add with the sign of the rate; none if left out.

    Raises:
        ParameterError: naming the field, its value and what is allowed.
    """

    axes: tuple[PiezoModel, ...]
    modes: AxesModes | None = None
    coupling: Array | None = None
    delay_s: float = 0.0
    level: LevelLaw | None = None
    coupling_change: float = 0.0
    joints: Array | None = None
    rate_relay: RateRelay | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", tuple(self.axes))
        if not self.axes:
            raise ParameterError("no axis", where="model.axes", value=0, allowed="1 or more")
        if not (np.isfinite(self.delay_s) and self.delay_s >= 0.0):
            raise ParameterError("delay out of range", where="model.axes.delay_s", value=self.delay_s, allowed=">= 0 s")
        if self.modes is not None and self.modes.input_shape.shape[1] != self.n_inputs:
            raise ParameterError(
                "modes do not fit the axes",
                where="model.axes.modes.input_shape",
                value=self.modes.input_shape.shape[1],
                allowed=f"{self.n_inputs} columns",
            )
        if self.rate_relay is not None:
            sizes = self.rate_relay.prompt_um.size, self.rate_relay.late_um.size
            if sizes != (self.n_inputs, self.n_inputs):
                where = "model.axes.rate_relay"
                raise ParameterError(
                    "relay does not fit the axes", where=where, value=sizes, allowed=str(self.n_inputs)
                )
        for name, shape in (("coupling", (None, self.n_inputs)), ("joints", (None, self._n_modes))):
            value = getattr(self, name)
            if value is None:
                continue
            array = np.array(value, dtype=np.float64)
            if array.ndim != 2 or array.shape[1] != shape[1] or not np.all(np.isfinite(array)):
                raise ParameterError(
                    "matrix does not fit", where=f"model.axes.{name}", value=array.shape, allowed=f"(n, {shape[1]})"
                )
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if self.modes is not None and self.static.shape[0] != self.modes.output_shape.shape[1]:
            raise ParameterError(
                "coupling does not fit the modes",
                where="model.axes.coupling",
                value=self.static.shape,
                allowed=f"({self.modes.output_shape.shape[1]}, {self.n_inputs})",
            )

    def __str__(self) -> str:
        lines = [f"axes model: {self.n_inputs} inputs, {self.n_outputs} outputs, {self._n_modes} modes"]
        if self.modes is not None:
            order = np.argsort(self.modes.frequency_hz)
            pairs = zip(self.modes.frequency_hz[order], self.modes.damping[order], strict=True)
            lines += [f"mode {hz:.2f} Hz, damping {100.0 * d:.2f} %" for hz, d in pairs]
        return "\n".join(lines)

    @property
    def n_inputs(self) -> int:
        """Number of voltages."""
        return len(self.axes)

    @property
    def n_outputs(self) -> int:
        """Number of displacements."""
        return int(self.static.shape[0])

    @property
    def _n_modes(self) -> int:
        return 0 if self.modes is None else self.modes.n_modes

    @cached_property
    def static(self) -> Array:
        """The coupling in use, shape (n_outputs, n_inputs)."""
        if self.coupling is not None:
            return self.coupling
        if self.modes is None:
            return np.eye(self.n_inputs)
        return np.zeros((self.modes.output_shape.shape[1], self.n_inputs))

    @cached_property
    def _is_plain(self) -> bool:
        return self.modes is None and self.coupling is None and self.delay_s == 0.0 and self.level is None

    @cached_property
    def _constants(self) -> tuple[NDArray[Any], ...]:
        law = np.zeros(4)
        if self.level is not None:
            law[:] = self.level.reference_v, self.level.exponent, self.level.memory_s, self.coupling_change
        n, n_out = self._n_modes, self.n_outputs
        base = np.zeros((6, n))
        shapes_in, shapes_out = np.zeros((n, self.n_inputs), complex), np.zeros((n, n_out), complex)
        if self.modes is not None:
            base[0], base[1] = 2.0 * np.pi * self.modes.frequency_hz, self.modes.damping
            base[2:] = self.modes.changes
            shapes_in, shapes_out = self.modes.input_shape.copy(), self.modes.output_shape.copy()
        joints = np.zeros((0, n)) if self.joints is None else self.joints.copy()
        return law, base, shapes_in, shapes_out, self.static.copy(), joints

    def initial_state(self, level_v: float | None = None) -> AxesState:
        """Return the state at rest.

        Args:
            level_v: level of the drive [V rms] where it is told; else the state finds it as it goes.
        """
        n, n_joints = self._n_modes, 0 if self.joints is None else len(self.joints)
        scalars, queue_s = np.zeros(N_SCALARS), np.zeros(N_PIECES)
        places = np.zeros(3, np.int64)
        if self.delay_s > 0.0:
            queue_s[0], places[1] = self.delay_s, 1
        arrays: dict[str, NDArray[Any]] = {
            "scalars": scalars,
            "places": places,
            "held": np.zeros(self.n_inputs),
            "queue_s": queue_s,
            "queue_um": np.zeros((N_PIECES, self.n_inputs)),
            "queue_modes": np.zeros((N_PIECES, n), complex),
            "xi": np.zeros((2, n), complex),
            "forces": np.zeros(n_joints),
            "poles": np.zeros(n, complex),
            "gains": np.ones(n + 1),
            "lengths": np.full(N_SLOTS, -1.0),
            "decay": np.zeros((N_SLOTS, n), complex),
            "drive": np.zeros((N_SLOTS, n), complex),
        }
        law, base = self._constants[:2]
        level = 0.0 if self.level is None else self.level.reference_v
        if level_v is not None:
            level = float(level_v)
            scalars[LEVEL_TOLD] = 1.0
        scalars[LEVEL_USED] = level
        set_level(level, law, base, arrays["poles"], arrays["gains"], arrays["lengths"])
        return AxesState(tuple(axis.initial_state() for axis in self.axes), arrays, np.zeros((2, self.n_inputs)))

    def restored_state(self, mapping: Any) -> AxesState:
        """Return the state of ``AxesState.to_mapping``; raises ParameterError where it does not fit this model."""
        state = self.initial_state()
        try:
            for own, kept in zip(state.axes, mapping["axes"], strict=True):
                own.packed[:] = kept["packed"]
                own.effects = {k: np.array(v, dtype=np.float64) for k, v in kept["effects"].items()}
                own.last_input, own.bend = float(kept["last_input"]), float(kept["bend"])
                own.last_voltage_v = float(kept["last_voltage_v"])
            state.relay[:] = kept_relay = np.array(mapping["relay"], dtype=np.float64)
            if kept_relay.shape != state.relay.shape:
                raise ValueError("number of inputs")
            for name, array in state.arrays.items():
                values = np.array(mapping["arrays"][name], dtype=np.float64)
                array[...] = values[..., 0] + 1j * values[..., 1] if np.iscomplexobj(array) else values
        except (KeyError, TypeError, ValueError) as error:
            raise ParameterError(
                f"state does not fit the model ({error})", where="state", allowed="one that this model saved"
            ) from None
        return state

    def simulate(self, steps_s: Array, voltage_v: Array, state: AxesState | None = None) -> Array:
        """Return the displacements [um] of each sample, shape (n_samples, n_outputs).

        Args:
            steps_s: step that leads to each sample [s], > 0, any lengths, shape (n_samples,).
            voltage_v: drives [V], shape (n_samples, n_inputs); held from one sample to the next before the modes.
            state: moves on where given; else the state at rest is used.

        Raises:
            ParameterError: shapes that do not fit, values that are not finite, a delay of too many steps.
        """
        steps = np.ascontiguousarray(steps_s, dtype=np.float64)
        drive = np.ascontiguousarray(voltage_v, dtype=np.float64)
        if drive.ndim != 2 or drive.shape[1] != self.n_inputs:
            raise ParameterError(
                "voltages do not fit", where="voltage_v", value=drive.shape, allowed=f"(n_samples, {self.n_inputs})"
            )
        state = self.initial_state() if state is None else state
        moved = np.empty(drive.shape)
        for i, axis in enumerate(self.axes):
            moved[:, i] = axis.simulate(steps, drive[:, i], state.axes[i])
        if self.rate_relay is not None:
            bent = self.rate_relay.bent(steps, drive, state.relay[0])
            late = np.concatenate([state.relay[1:], bent[:-1]])
            moved += self.rate_relay.prompt_um * bent + self.rate_relay.late_um * late
            state.relay[0], state.relay[1] = drive[-1], bent[-1]
        if self._is_plain:
            return moved
        out = np.empty((steps.size, self.n_outputs))
        arrays: tuple[Any, ...] = (steps, drive, moved, *self._constants, *state.arrays.values(), out)
        if not run_modes(*arrays):
            raise ParameterError(
                "delay of too many steps", where="model.axes.delay_s", value=self.delay_s, allowed=f"{N_PIECES - 1}"
            )
        return out

    def advance(self, state: AxesState, voltage_v: Array, step_s: float) -> Array:
        """Return the displacements [um] after one step, shape (n_outputs,).

        Args:
            state: from ``initial_state``; moves on.
            voltage_v: drives at the end of the step [V], shape (n_inputs,).
            step_s: length of the step [s], > 0.
        """
        drive = np.asarray(voltage_v, dtype=np.float64)
        return np.asarray(self.simulate(np.array([step_s]), drive.reshape(1, -1), state)[0])

    def static_gain(self, level_v: float | None = None) -> Array:
        """Return what the outputs move for a slow um of each input's own model, (n_outputs, n_inputs)."""
        q = 0.0 if level_v is None or self.level is None else self.level.change(level_v)
        gain = self.static * (1.0 + self.coupling_change * q)
        if self.modes is not None:
            _, damping, modal = self.modes.at(q)
            # a state comes to rest at 1 - j zeta / sqrt(1 - zeta^2) times what drives it
            rest = 1.0 - 1j * damping / np.sqrt(1.0 - damping**2)
            shapes = self.modes.output_shape * (modal * rest)[:, None]
            gain = gain + np.real(np.einsum("mo,mi->oi", shapes, self.modes.input_shape))
        return np.asarray(gain)


def _plain(array: NDArray[Any]) -> Any:
    return np.stack([array.real, array.imag], axis=-1).tolist() if np.iscomplexobj(array) else array.tolist()

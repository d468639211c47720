"""Mechanical modes shared by the axes, and how they change with the drive's level.

A mode is a pole and two shapes, one of the inputs and one of the outputs. The shapes are complex where damping is not
spread like mass and stiffness (Ewins, Modal Testing, 2000, section 2.7: general viscous damping); with real shapes
a mode is an oscillator of a force. Each is a state xi with

    d xi / dt = p xi - j w^2 / w_d * sum_i b_i w_i,    displacement_k += Re(c_k xi),

p = -zeta w + j w_d, so that a constant input moves a real mode by c_k b_i, whatever its frequency.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import ParameterError

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

LEAST_LEVEL = 1e-3  # of the reference level: below it a law that is a power of the level is not followed further


@dataclass(frozen=True, eq=False)
class AxesModes:
    """Modes of a structure with several inputs and outputs.

    Args:
        frequency_hz: undamped natural frequencies at the reference level [Hz], shape (n_modes,).
        damping: share of critical damping at the reference level [1], shape (n_modes,), 0 to 1.
        output_shape: c, complex, shape (n_modes, n_outputs); times input shape in um of output for a um of input.
        input_shape: b, complex, shape (n_modes, n_inputs).
        softening: relative change of frequency with q [1], shape (n_modes,); zero if left out.
        softening_squared: the same with q squared.
        damping_change: change of the logarithm of damping with q [1], shape (n_modes,); zero if left out.
        gain_change: relative change of the mode's displacement with q [1], shape (n_modes,); zero if left out.

    q = (level / reference level) ** exponent - 1, see ``LevelLaw``.

    Raises:
        ParameterError: naming the field, its value and what is allowed.
    """

    frequency_hz: Array
    damping: Array
    output_shape: ComplexArray
    input_shape: ComplexArray
    softening: Array | None = None
    softening_squared: Array | None = None
    damping_change: Array | None = None
    gain_change: Array | None = None

    def __post_init__(self) -> None:
        frequency = _of_shape(self.frequency_hz, "frequency_hz", None)
        n = frequency.size
        object.__setattr__(self, "frequency_hz", _frozen(frequency))
        damping = _of_shape(self.damping, "damping", n)
        if np.any(frequency <= 0.0):
            raise _bad("frequency_hz", frequency.min(), "greater than 0 Hz")
        if np.any((damping <= 0.0) | (damping >= 1.0)):
            raise _bad("damping", damping, "greater than 0, less than 1")
        object.__setattr__(self, "damping", _frozen(damping))
        for name in ("output_shape", "input_shape"):
            shape = np.array(getattr(self, name), dtype=np.complex128)
            if shape.ndim != 2 or shape.shape[0] != n or not np.all(np.isfinite(shape)):
                raise _bad(name, shape.shape, f"finite, shape ({n}, number of axes)")
            shape.flags.writeable = False
            object.__setattr__(self, name, shape)
        for name in ("softening", "softening_squared", "damping_change", "gain_change"):
            value = getattr(self, name)
            changed = np.zeros(n) if value is None else _of_shape(value, name, n)
            object.__setattr__(self, name, _frozen(changed))

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return int(self.frequency_hz.size)

    def at(self, q: float) -> tuple[Array, Array, Array]:
        """Return frequencies [rad/s], damping and gain at a level, each of shape (n_modes,)."""
        soft, squared, damping, gain = self.changes
        factor = np.clip(1.0 + soft * q + squared * q * q, 0.1, 10.0)
        return (
            2.0 * np.pi * self.frequency_hz * factor,
            np.clip(self.damping * np.exp(damping * q), 1e-6, 0.999),
            1.0 + gain * q,
        )

    @property
    def changes(self) -> tuple[Array, Array, Array, Array]:
        """Softening, its square, change of damping, change of gain."""
        found = (self.softening, self.softening_squared, self.damping_change, self.gain_change)
        return tuple(np.zeros(self.n_modes) if value is None else value for value in found)  # type: ignore[return-value]


@dataclass(frozen=True)
class LevelLaw:
    """The slow state: the root mean square of all voltages, with forgetting, and the law by which modes follow it.

    Causal: the mean of what was since the start, weighted by exp(-age / memory_s); so that the level is known after
    some periods of the drive, not after the memory.

    Args:
        reference_v: level at which the modes are as their fields say [V rms].
        exponent: of the law, see ``AxesModes``.
        memory_s: time constant of forgetting [s].
    """

    reference_v: float
    exponent: float = 1.0
    memory_s: float = 1.0

    def __post_init__(self) -> None:
        for name in ("reference_v", "exponent", "memory_s"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ParameterError("not a positive number", where=f"model.axes.level.{name}", value=value)

    def change(self, level_v: float) -> float:
        """Return q of a level [V rms]."""
        return float(max(level_v / self.reference_v, LEAST_LEVEL) ** self.exponent - 1.0)


@dataclass(frozen=True, eq=False)
class RateRelay:
    """What a drive's amplifier loses or adds as the drive turns: a smooth relay of its rate, now and a step later.

    The drive gains prompt * a_n + late * a_(n-1), a_n = arctan(rate_n / scale), rate_n the voltage's mean rate
    over the step that ends with sample n. Prompt and late of opposite sign act at the turns alone.

    Args:
        scale_v_per_s: rate at which it bends [V/s].
        prompt_um: of each input [um], shape (n_inputs,).
        late_um: the same a step later.
    """

    scale_v_per_s: float
    prompt_um: Array
    late_um: Array

    def __post_init__(self) -> None:
        if not (np.isfinite(self.scale_v_per_s) and self.scale_v_per_s > 0.0):
            where = "model.axes.rate_relay.scale_v_per_s"
            raise ParameterError("not a positive number", where=where, value=self.scale_v_per_s)
        for name in ("prompt_um", "late_um"):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.ndim != 1 or not np.all(np.isfinite(array)):
                where = f"model.axes.rate_relay.{name}"
                raise ParameterError("not a list of numbers", where=where, value=array.shape, allowed="(n_inputs,)")
            object.__setattr__(self, name, _frozen(array))

    def bent(self, steps_s: Array, voltage_v: Array, last_v: Array) -> Array:
        """Return a of each sample and input, (n_samples, n_inputs), after ``last_v`` (n_inputs,)."""
        before = np.concatenate([last_v[None], voltage_v[:-1]])
        return np.asarray(np.arctan((voltage_v - before) / (steps_s[:, None] * self.scale_v_per_s)))


def _frozen(array: Array) -> Array:
    array.flags.writeable = False
    return array


def _bad(name: str, value: object, allowed: str) -> ParameterError:
    return ParameterError("out of range", where=f"model.axes.modes.{name}", value=value, allowed=allowed)


def _of_shape(values: object, name: str, n: int | None) -> Array:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise _bad(name, values, "a list of numbers") from None
    if array.ndim != 1 or (n is not None and array.size != n) or not np.all(np.isfinite(array)):
        raise _bad(name, array.shape, "finite numbers, one for each mode")
    return array

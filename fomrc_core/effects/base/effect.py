"""What an effect is: its place in the chain, its parameters, its response, its inverse, and how it shows."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.errors import ParameterError

Array = NDArray[np.float64]


class Place(IntEnum):
    """Where in the chain an effect acts; the chain runs in this order."""

    DAC_QUANTIZATION = 1
    AMPLIFIER_SLEW_LIMIT = 2
    AMPLIFIER_BANDWIDTH = 3
    AMPLIFIER_SATURATION = 4
    DEAD_ZONE = 5
    HYSTERESIS = 6  # acts beside the Maxwell elements: its output is added to theirs, before creep
    INITIAL_STATE = 7  # the state in which the record begins
    SLOW_RELAXATION = 8
    MECHANICAL_RESONANCE = 9
    TRANSPORT_DELAY = 10
    CLOCK_SKEW = 11
    EXTERNAL_LOAD = 12
    CROSS_AXIS = 13
    THERMAL_DRIFT = 14
    GAIN_DRIFT = 15
    SENSOR_NONLINEARITY = 16
    MAINS_HUM = 17


class Stage(IntEnum):
    """Which part of the chain a place belongs to."""

    SAMPLED_DRIVE = 0  # on the drive at the samples
    DRIVE = 1  # on the drive between the samples as well
    HYSTERESIS = 2
    START = 3
    MECHANICAL = 4  # on the displacement, between the samples as well
    SENSED = 5  # on the displacement at the samples


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Attributes:
        name: field name, carrying its unit.
        unit: unit as text.
        lower: smallest value allowed.
        upper: largest value allowed.
        is_log: whether a fit moves its logarithm (positive scales).
        is_list: whether it is a list of values, each within the bounds.
        description: what it is.
        difference: share of the value by which a fit moves it to see what it does; 0 for the usual one.
    """

    name: str
    unit: str
    lower: float
    upper: float
    is_log: bool = False
    is_list: bool = False
    description: str = ""
    difference: float = 0.0


@dataclass(frozen=True)
class Effect(ABC):
    """A physical effect beside hysteresis and creep.

    A subclass is a frozen dataclass whose fields are its parameters; one file per effect.
    The state is one float64 array of fixed size, owned by the model's state.
    """

    name: ClassVar[str]
    place: ClassVar[Place]
    stage: ClassVar[Stage]
    parameters: ClassVar[tuple[Parameter, ...]]
    main_parameter: ClassVar[str]
    meaning: ClassVar[str]
    signature: ClassVar[str]
    experiment: ClassVar[str]
    inverse_note: ClassVar[str]
    needs_substeps: ClassVar[bool] = False
    can_invert: ClassVar[bool] = False
    is_record_bound: ClassVar[bool] = False  # its parameters belong to one record, not to the actuator
    linear_parameters: ClassVar[tuple[str, ...]] = ()  # those in which the response is linear
    size_exponent: ClassVar[float] = 1.0  # main parameter ~ size of the signature to this power, for small effects
    is_scanned: ClassVar[bool] = False  # its response jumps with the main parameter: a fit scans it
    held_parameters: ClassVar[tuple[str, ...]] = ()  # those a fit leaves where the screening put them

    def __post_init__(self) -> None:
        for spec in self.parameters:
            value = getattr(self, spec.name)
            where = f"{self.name}.{spec.name}"
            values = list(value) if spec.is_list and isinstance(value, (list, tuple, np.ndarray)) else [value]
            if spec.is_list and values == [value]:
                raise ParameterError("not a list", where=where, value=value, allowed="a list of numbers")
            checked = [_checked(v, spec, where) for v in values]
            object.__setattr__(self, spec.name, tuple(checked) if spec.is_list else checked[0])

    def __str__(self) -> str:
        values = ((spec.name, getattr(self, spec.name)) for spec in self.parameters)
        shown = (f"{name}: {len(v)} values" if isinstance(v, tuple) else f"{name} {v:.5g}" for name, v in values)
        return f"{self.name} ({', '.join(shown)})"

    @abstractmethod
    def initial_state(self) -> Array:
        """Return the state at rest, shape (n_state,)."""

    @abstractmethod
    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the effect's output for each sample, shape (n_samples,); the state moves on.

        Args:
            state: from ``initial_state`` or a former call; changed in place.
            values: drive [V] or displacement [um], whichever the place carries, shape (n_samples,).
            steps_s: step that leads to each sample [s], any lengths, shape (n_samples,).
            covariate: temperature [degC] or the second axis, for the effects that use them.
        """

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the input that gives the wanted output; only where ``can_invert``.

        Raises:
            ParameterError: the effect has no inverse.
        """
        raise ParameterError("effect has no inverse", where=self.name, allowed=self.inverse_note)

    def free_names(self) -> tuple[str, ...]:
        """Return the parameters a fit moves; a linear one that stands at zero is held there."""
        return tuple(
            spec.name
            for spec in self.parameters
            if not spec.is_list
            and spec.name not in self.held_parameters
            and not (spec.name in self.linear_parameters and getattr(self, spec.name) == 0.0)
        )

    def belongs_to_record(self) -> bool:
        """Return whether the parameters belong to one record and not to the actuator."""
        return self.is_record_bound

    def is_plausible(self, duration_s: float) -> bool:
        """Return whether records of this length [s] can show the effect with these parameters."""
        return True

    def is_confirmed(self, time_s: Array, voltage_v: Array, residual_um: Array) -> bool:
        """Return whether a record's residual, this effect left in it, shows what the effect must show.

        Args:
            time_s: time since the first sample [s], shape (n_samples,).
            voltage_v: drive [V], shape (n_samples,).
            residual_um: measured minus the model without this effect [um], shape (n_samples,).
        """
        return True

    def scale_of(self, name: str, value: float) -> float:
        """Return the unit in which a fit moves a parameter that is not moved by its logarithm."""
        return abs(value) if value != 0.0 else 1.0

    @classmethod
    def screening(cls, evidence: Evidence) -> list[Effect]:
        """Return trial instances whose signatures a diagnosis compares with what the model left over."""
        return []

    @classmethod
    def from_mapping(cls, mapping: Any, where: str) -> Effect:
        """Return the effect with these parameters; raises ParameterError naming the key at fault."""
        known = {spec.name for spec in cls.parameters}
        if not isinstance(mapping, dict):
            raise ParameterError("not a mapping", where=where, value=mapping, allowed=", ".join(sorted(known)))
        for key in mapping:
            if key not in known:
                raise ParameterError("unknown parameter", where=where, value=key, allowed=", ".join(sorted(known)))
        required = {f.name for f in fields(cls) if f.name in known and not _has_default(f)}
        for key in sorted(required - set(mapping)):
            raise ParameterError(f"parameter {key} is missing", where=where, allowed=", ".join(sorted(known)))
        return cls(**mapping)

    def to_mapping(self) -> dict[str, float | list[float]]:
        """Return the parameters as plain numbers and lists, as a model file holds them."""
        values = {spec.name: getattr(self, spec.name) for spec in self.parameters}
        # ROS cannot tell the type of an empty list, so an empty one is left out
        return {
            name: list(value) if isinstance(value, tuple) else float(value)
            for name, value in values.items()
            if value != ()
        }


def _has_default(field: Any) -> bool:
    from dataclasses import MISSING

    return field.default is not MISSING or field.default_factory is not MISSING


def _checked(value: Any, spec: Parameter, where: str) -> float:
    allowed = f"{spec.lower:g} to {spec.upper:g} {spec.unit}"
    if isinstance(value, (bool, str)) or not isinstance(value, (int, float, np.floating, np.integer)):
        raise ParameterError("not a number", where=where, value=value, allowed=allowed)
    if not (math.isfinite(value) and spec.lower <= value <= spec.upper):
        raise ParameterError("out of range", where=where, value=float(value), allowed=allowed)
    return float(value)

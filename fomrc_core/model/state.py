"""The one thing that changes while a model or a compensator is stepped."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fomrc_core.errors import ParameterError
from fomrc_core.model.plain_kernels import PlainKernels

Array = NDArray[np.float64]


@dataclass
class ModelState:
    """What a model or a compensator remembers; the one mutable thing, bounded in size.

    Attributes:
        packed: hysteresis and creep blocks in one array.
        effects: state of each effect by its name.
        last_input: input of the last step [V], or [um] for a compensator.
        bend: what jumps of the drive leave bending in the next step [V] (substeps.py).
        last_voltage_v: of a compensator that searches for its voltage: that of the hysteresis in the last step [V].
    """

    packed: Array
    effects: dict[str, Array] = field(default_factory=dict)
    last_input: float = 0.0
    bend: float = 0.0
    last_voltage_v: float = 0.0
    _plain: PlainKernels | None = field(default=None, init=False, repr=False, compare=False)

    def plain_kernels(self, at_creep: int) -> PlainKernels:
        """Return the steppers for plain Python on this state, made at their first use."""
        if self._plain is None or self._plain.packed is not self.packed:
            self._plain = PlainKernels(self.packed, at_creep)
        return self._plain

    def __getstate__(self) -> dict[str, Any]:
        # Views do not stay views of the state when they are pickled beside it.
        return {**self.__dict__, "_plain": None}

    def copy(self) -> ModelState:
        """Return an independent copy."""
        effects = {name: values.copy() for name, values in self.effects.items()}
        return ModelState(self.packed.copy(), effects, self.last_input, self.bend, self.last_voltage_v)

    def to_mapping(self) -> dict[str, Any]:
        """Return the state as plain numbers and lists."""
        return {
            "packed": self.packed.tolist(),
            "effects": {name: values.tolist() for name, values in self.effects.items()},
            "last_input": self.last_input,
            "bend": self.bend,
            "last_voltage_v": self.last_voltage_v,
        }

    @classmethod
    def from_mapping(cls, mapping: Any, where: str = "state") -> ModelState:
        """Return the state of a mapping; raises ParameterError for anything that is not one."""
        try:
            packed = np.array(mapping["packed"], dtype=np.float64)
            effects = {str(k): np.array(v, dtype=np.float64) for k, v in mapping["effects"].items()}
            numbers = [float(mapping[key]) for key in ("last_input", "bend")]
            numbers.append(float(mapping.get("last_voltage_v", 0.0)))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ParameterError(f"not a saved state ({error})", where=where, allowed="to_mapping()") from None
        if packed.ndim != 1 or not np.all(np.isfinite((*packed, *numbers))):
            raise ParameterError("saved state holds values that are not finite", where=where, allowed="finite")
        return cls(packed, effects, *numbers)

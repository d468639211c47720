"""A sensor that is not where its actuator pushes: between them the structure bends.

Where sensor and actuator meet, every mode answers the axis's own drive with the same sign, and between two resonances
the response has a zero (Preumont, Vibration Control of Active Structures, 2018, section 2.6); a sensor elsewhere sees
some modes with the other sign.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fomrc_core.diagnosis.axes.cause import AxesCause, AxesEvidence
from fomrc_core.model.axes import AxesModel

_ACTS = 0.02  # of the strongest mode's answer to the axis's own drive: a weaker one says nothing of where a sensor is


@dataclass(frozen=True, eq=False)
class NoncollocatedSensor(AxesCause):
    """The sensor of one axis sees each mode by another factor, and what moves at once by another still.

    Attributes:
        axis: which, from 0.
        acting: modes that answer the axis's own drive, their numbers from 0: those whose signs tell.
    """

    name: ClassVar[str] = "noncollocated_sensor"
    meaning: ClassVar[str] = "A sensor is not at its actuator: it sees some modes with the other sign."
    signature: ClassVar[str] = "beyond a resonance the zero is missing, and the phase goes on falling"
    experiment: ClassVar[str] = "a multisine over two resonances of each axis by itself"

    axis: int = 0
    acting: tuple[int, ...] = ()

    @classmethod
    def trials(cls, evidence: AxesEvidence) -> list[AxesCause]:
        """Return each axis that two modes or more move."""
        model, found = evidence.model, list[AxesCause]()
        if model.modes is None:
            return found
        for axis in range(min(model.n_inputs, model.n_outputs)):
            answer = np.abs(model.modes.output_shape[:, axis] * model.modes.input_shape[:, axis])
            acting: NDArray[np.int64] = np.flatnonzero(answer > _ACTS * answer.max())
            if acting.size > 1:
                found.append(cls(np.zeros(model.modes.n_modes + 1), axis, tuple(acting.tolist())))
        return found

    def applied(self, model: AxesModel) -> AxesModel:
        """Return the model with the sensor elsewhere."""
        modes = model.modes
        assert modes is not None
        shape, static = modes.output_shape.copy(), model.static.copy()
        shape[:, self.axis] *= 1.0 + self.values[:-1]
        static[self.axis, self.axis] += self.values[-1] * model.static_gain()[self.axis, self.axis]
        return replace(model, modes=replace(modes, output_shape=shape), coupling=static)

    def parameters(self, model: AxesModel) -> Mapping[str, float | str | list[float]]:
        """Return the axis, and the frequencies [Hz] of its modes with the factors [1] by which they are seen."""
        assert model.modes is not None
        hz = model.modes.frequency_hz[list(self.acting)]
        return {
            "axis": float(self.axis + 1),
            "mode_hz": hz.tolist(),
            "factor": (1.0 + self.values[list(self.acting)]).tolist(),
        }

    def is_plausible(self) -> bool:
        """Return whether some modes are seen with the other sign, and some not."""
        signs = np.sign(1.0 + self.values[list(self.acting)])
        return bool(np.any(signs > 0.0) and np.any(signs < 0.0))

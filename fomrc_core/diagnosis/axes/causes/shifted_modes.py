"""Modes are elsewhere than in the model: another load, another clamping, another temperature."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fomrc_core.diagnosis.axes.cause import AxesCause, AxesEvidence
from fomrc_core.model.axes import AxesModel

_UNIT = 0.01  # of a value: change of the logarithm of a frequency
_MOST = 3.0  # change of the logarithm of a damping, either way


@dataclass(frozen=True, eq=False)
class ShiftedModes(AxesCause):
    """Changes of each mode's frequency and damping."""

    name: ClassVar[str] = "shifted_modes"
    meaning: ClassVar[str] = "Modes are at other frequencies than in the model: another load, clamping or temperature."
    signature: ClassVar[str] = "the residual is two-sided beside the modes, at every level alike"
    experiment: ClassVar[str] = "the multisine the model was identified from, once with the load and once without"

    @classmethod
    def trials(cls, evidence: AxesEvidence) -> list[AxesCause]:
        """Return all modes together; none without modes."""
        modes = evidence.model.modes
        return [] if modes is None else [cls(np.zeros(2 * modes.n_modes))]

    def applied(self, model: AxesModel) -> AxesModel:
        """Return the model with the modes shifted."""
        modes = model.modes
        assert modes is not None
        frequency, damping = self.values.reshape(2, -1)
        changed = replace(
            modes,
            frequency_hz=modes.frequency_hz * np.exp(_UNIT * frequency),
            damping=modes.damping * np.exp(np.clip(damping, -_MOST, _MOST)),
        )
        return replace(model, modes=changed)

    def parameters(self, model: AxesModel) -> Mapping[str, float | str | list[float]]:
        """Return each mode's frequency in the model [Hz] and by how much it is higher [1]."""
        assert model.modes is not None
        shift = np.expm1(_UNIT * self.values[: model.modes.n_modes])
        return {"mode_hz": model.modes.frequency_hz.tolist(), "higher_by": shift.tolist()}

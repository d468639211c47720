"""Modes get softer as the drive's level rises."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.diagnosis.axes.cause import AxesCause, AxesEvidence
from fomrc_core.model.axes import AxesModel, LevelLaw

_SAME_LEVEL = 0.15  # relative spread of what counts as one level
_UNIT = 0.01  # of a value: relative change of frequency from no drive to the reference level


@dataclass(frozen=True, eq=False)
class SofteningModes(AxesCause):
    """Relative changes of each mode's frequency with q of the level and its square, and of its answer with q.

    Attributes:
        reference_v: level of q = 0 [V rms]; the model's own law where it has one.
        is_right_at_rest: whether the modes are as the model has them without a drive, and not at that level.
    """

    name: ClassVar[str] = "softening_modes"
    meaning: ClassVar[str] = "Joints or springs give way as the stage is driven harder, so that modes get lower."
    signature: ClassVar[str] = "the residual grows beside the modes, with the drive's level"
    experiment: ClassVar[str] = "the same multisine at two or three levels"

    reference_v: float = 1.0
    is_right_at_rest: bool = True

    @classmethod
    def trials(cls, evidence: AxesEvidence) -> list[AxesCause]:
        """Return one right at rest and one right at the reference; none of one level or without modes."""
        model = evidence.model
        levels = _levels(evidence)
        if model.modes is None or len(levels) < 2:
            return []
        reference = levels[len(levels) // 2] if model.level is None else model.level.reference_v
        n = 3 * model.modes.n_modes
        return [cls(np.zeros(n), reference, is_right) for is_right in (True, False)]

    def applied(self, model: AxesModel) -> AxesModel:
        """Return the model whose modes follow the level."""
        modes = model.modes
        assert modes is not None
        soft, squared, gain = _UNIT * self.values.reshape(3, -1)
        # without a drive q is -1
        offset = soft - squared if self.is_right_at_rest else np.zeros(soft.size)
        before_soft, before_squared, _, before_gain = modes.changes
        modes = replace(
            modes,
            frequency_hz=modes.frequency_hz * (1.0 + offset),
            softening=before_soft + soft,
            softening_squared=before_squared + squared,
            gain_change=before_gain + gain,
        )
        law = model.level if model.level is not None else LevelLaw(self.reference_v)
        return replace(model, modes=modes, level=law)

    def parameters(self, model: AxesModel) -> Mapping[str, float | str | list[float]]:
        """Return each frequency's relative change from no drive to the reference level [1], and that level [V]."""
        return {"softening": self._softening.tolist(), "reference_v": self.reference_v}

    @property
    def _softening(self) -> Array:
        soft, squared, _ = _UNIT * self.values.reshape(3, -1)
        return np.asarray(soft - squared)

    def is_plausible(self) -> bool:
        """Return whether the mode that changes most gets lower."""
        soft = self._softening
        return bool(soft[np.argmax(np.abs(soft))] < 0.0)


def _levels(evidence: AxesEvidence) -> list[float]:
    found: list[float] = []
    for level in sorted(record.level_v for record in evidence.records):
        if not found or level > (1.0 + _SAME_LEVEL) * found[-1]:
            found.append(level)
    return found

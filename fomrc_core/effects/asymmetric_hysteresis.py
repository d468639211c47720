"""The loop is not symmetric about its centre: rising and falling branch differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.effect import Array, Effect, Parameter, Place, Stage
from fomrc_core.effects.evidence import Evidence
from fomrc_core.effects.kernels import knee_block, run_knees
from fomrc_core.errors import ParameterError

_THRESHOLD_SHARES = (0.0, 0.03, 0.1, 0.25, 0.45)
_KNEE_SHARES = (0.15, 0.38, 0.62, 0.85)


@dataclass(frozen=True)
class AsymmetricHysteresis(Effect):
    """A sum of plays that count only above a knee, of either sign, beside the Maxwell elements.

    Threshold zero is a bend of the drive itself; the others make hysteresis depend on where in the range it
    happens. Together they are a coarse Preisach density that depends on the mean as well as on the width.
    """

    name: ClassVar[str] = "asymmetric_hysteresis"
    place: ClassVar[Place] = Place.HYSTERESIS
    stage: ClassVar[Stage] = Stage.HYSTERESIS
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("thresholds_v", "V", 0.0, 1e6, is_list=True, description="half widths of the one-sided plays"),
        Parameter("knees_v", "V", -1e6, 1e6, is_list=True, description="where each begins to count"),
        Parameter("weights_um_per_v", "um/V", -1e6, 1e6, is_list=True, description="their weights"),
    )
    main_parameter: ClassVar[str] = "weights_um_per_v"
    meaning: ClassVar[str] = "Poled ceramic switches more easily along the poling field than against it."
    signature: ClassVar[str] = "residual depends on voltage and branch: rising and falling halves differ in shape"
    experiment: ClassVar[str] = "small slow triangles about several mean voltages: loops of unequal width and slope"
    inverse_note: ClassVar[str] = "inverted by a scalar search, while displacement still rises with voltage"
    can_invert: ClassVar[bool] = True
    linear_parameters: ClassVar[tuple[str, ...]] = ("weights_um_per_v",)

    thresholds_v: tuple[float, ...]
    knees_v: tuple[float, ...]
    weights_um_per_v: tuple[float, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not len(self.thresholds_v) == len(self.knees_v) == len(self.weights_um_per_v):
            raise ParameterError("lists differ in length", where=self.name,
                                 value=(len(self.thresholds_v), len(self.knees_v), len(self.weights_um_per_v)),
                                 allowed="three lists of one length")  # fmt: skip

    def initial_state(self) -> Array:
        """Return the packed one-sided plays, relaxed."""
        return knee_block(np.array(self.thresholds_v), np.array(self.knees_v), np.array(self.weights_um_per_v))

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return what is added to the elements' sum [um], shape (n_samples,), for the drive [V]."""
        out = np.empty(values.size)
        run_knees(state, values, out)
        return out

    @classmethod
    def screening(cls, evidence: Evidence) -> list[Effect]:
        """Return the whole family of one-sided plays over the range of the drive, with zero weights."""
        low, span = evidence.smallest_v, evidence.largest_v - evidence.smallest_v
        pairs = [(span * t, low + span * k) for t in _THRESHOLD_SHARES for k in _KNEE_SHARES]
        return [cls(tuple(t for t, _ in pairs), tuple(k for _, k in pairs), (0.0,) * len(pairs))]

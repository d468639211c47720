"""The voltage amplifier cannot change faster than its current allows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compiled import compiled
from fomrc_core.effects.effect import Array, Effect, Parameter, Place, Stage
from fomrc_core.effects.evidence import Evidence


@compiled
def _run_slew(state: Array, slew_v_per_s: float, values: Array, steps_s: Array, out: Array) -> None:
    output = state[0]
    for k in range(values.size):
        room = slew_v_per_s * steps_s[k]
        output += min(max(values[k] - output, -room), room)
        out[k] = output
    state[0] = output


@dataclass(frozen=True)
class AmplifierSlewLimit(Effect):
    """Rate limit on the drive."""

    name: ClassVar[str] = "amplifier_slew_limit"
    place: ClassVar[Place] = Place.AMPLIFIER_SLEW_LIMIT
    stage: ClassVar[Stage] = Stage.DRIVE
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("slew_v_per_s", "V/s", 1e-6, 1e9, is_log=True, description="largest rate of the output"),
    )
    main_parameter: ClassVar[str] = "slew_v_per_s"
    meaning: ClassVar[str] = "The amplifier's current limit bounds how fast it can charge the actuator."
    signature: ClassVar[str] = "residual only where the drive is faster than the limit, growing with the step's size"
    experiment: ClassVar[str] = "steps of several sizes: the time to arrive is proportional to the size"
    inverse_note: ClassVar[str] = "no inverse: what is faster than the limit cannot be had; slow the target"
    needs_substeps: ClassVar[bool] = True
    size_exponent: ClassVar[float] = -1.0

    slew_v_per_s: float

    def initial_state(self) -> Array:
        """Return the output [V] at rest."""
        return np.zeros(1)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the limited drive [V], shape (n_samples,)."""
        out = np.empty(values.size)
        _run_slew(state, self.slew_v_per_s, values, steps_s, out)
        return out

    @classmethod
    def screening(cls, evidence: Evidence) -> list[Effect]:
        """Return limits from just below the drive's fastest rate down to a hundredth of it."""
        return [cls(slew_v_per_s=evidence.fastest_v_per_s * s) for s in (0.9, 0.6, 0.35, 0.2, 0.1, 0.05, 0.02)]

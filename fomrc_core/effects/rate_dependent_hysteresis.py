"""Loops widen with the rate of the drive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.course import Course
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.step_form import Fields, Number, StateField, StepForm

_USUAL = 0.9  # quantile of the drive's rates that are not zero: jumps are faster, but few
_TRIAL_WIDENING = 0.02  # of the thresholds at the usual rate: the response is still in proportion


def _widen(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    rate = abs(value - s.before) / step_s
    s.before = value
    return 1.0 + c.per_v_per_s * rate


@dataclass(frozen=True)
class RateDependentHysteresis(Effect):
    """Thresholds of the elements' plays that grow with the drive's rate, r (1 + per_v_per_s |du/dt|).

    Within a part of a step the rate is that of its straight line. A rate-dependent Prandtl-Ishlinskii operator
    (Al Janaideh, Rakheja and Su 2011), with dynamic thresholds in proportion to the static ones.
    """

    name: ClassVar[str] = "rate_dependent_hysteresis"
    stage: ClassVar[Stage] = Stage.HYSTERESIS
    order: ClassVar[float] = 30.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("per_v_per_s", "s/V", 0.0, 1e9, description="relative widening of the thresholds per V/s"),
    )
    main_parameter: ClassVar[str] = "per_v_per_s"
    linear_parameters: ClassVar[tuple[str, ...]] = ("per_v_per_s",)
    widens_with_rate: ClassVar[bool] = True
    meaning: ClassVar[str] = "Domain walls need more field to move faster, so that loops are wider at speed."
    signature: ClassVar[str] = "residual follows the branch of the loop by a share that grows with the drive's rate"
    experiment: ClassVar[str] = (
        "one triangle at several rates: thresholds that widen leave the slope after a turn as it is, a lag does not"
    )
    inverse_note: ClassVar[str] = "not inverted: thresholds depend on the rate of the voltage that is asked for"

    per_v_per_s: float

    def initial_state(self) -> Array:
        """Return (drive [V] of the step before), at rest."""
        return np.zeros(1)

    def widening(self, state: Array, drive_v: Array, steps_s: Array) -> Array:
        """Return the factor of the thresholds at each sample, shape (n_samples,)."""
        before = np.concatenate((state, drive_v[:-1]))
        state[0] = drive_v[-1]
        return np.asarray(1.0 + self.per_v_per_s * (np.abs(drive_v - before) / steps_s))

    def undo_known(self, wanted: Array, course: Course) -> Array:
        """Return what is wanted: what the widening makes of it is small, and found by asking again."""
        return wanted

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return that nothing is added to the elements' sum, shape (n_samples,)."""
        return np.zeros(values.size)

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=(("per_v_per_s", self.per_v_per_s),),
            state=(StateField("before", comment="drive of the step before [V]"),),
            widening=_widen,
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[RateDependentHysteresis]:
        """Return a small widening at the drive's usual rate, and at its fastest."""
        rates = np.concatenate([np.abs(np.diff(r.voltage_v) / r.steps_s[1:]) for r in evidence.records])
        moving = rates[rates > 0.0]
        if moving.size == 0:
            return []
        typical = (float(np.quantile(moving, _USUAL)), float(np.max(moving)))
        return cls.proposed({"per_v_per_s": _TRIAL_WIDENING / rate} for rate in typical)

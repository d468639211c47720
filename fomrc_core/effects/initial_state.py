"""The record does not begin in the relaxed state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Place, Stage
from fomrc_core.effects.base.evidence import Evidence

_RAMP_S = 0.2
_N_RAMP = 40
_N_HOLD = 40


@dataclass(frozen=True)
class InitialState(Effect):
    """What the drive did before the record: out to an extreme, held, then to a rest until the record began."""

    name: ClassVar[str] = "initial_state"
    place: ClassVar[Place] = Place.INITIAL_STATE
    stage: ClassVar[Stage] = Stage.START
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("extreme_v", "V", -1e4, 1e4, description="voltage of the excursion before the record"),
        Parameter("resting_v", "V", -1e4, 1e4, description="voltage just before the record"),
        Parameter("held_s", "s", 1e-3, 1e5, is_log=True, description="how long the excursion was held"),
        Parameter("resting_s", "s", 1e-3, 1e5, is_log=True, description="how long it then rested"),
    )
    main_parameter: ClassVar[str] = "extreme_v"
    meaning: ClassVar[str] = "The actuator had been moved before the record and was not relaxed."
    signature: ClassVar[str] = "a transient at the start that fades with log time, and a first branch off the origin"
    experiment: ClassVar[str] = "the relaxation routine before the record: the transient goes"
    inverse_note: ClassVar[str] = "not inverted: run the relaxation routine instead"
    is_record_bound: ClassVar[bool] = True
    held_parameters: ClassVar[tuple[str, ...]] = ("resting_v",)

    extreme_v: float = 0.0
    resting_v: float = 0.0
    held_s: float = 1.0
    resting_s: float = 1.0

    def initial_state(self) -> Array:
        """Return an empty state: the effect is in the states of the others."""
        return np.zeros(0)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the values unchanged: the effect acts before the first sample."""
        return values

    def free_names(self) -> tuple[str, ...]:
        """Return what a fit moves; nothing where the drive simply rested at one voltage."""
        return () if self.extreme_v == self.resting_v else super().free_names()

    def prehistory(self) -> tuple[Array, Array]:
        """Return steps [s] and voltages [V] of what went before, each of shape (n_steps,)."""
        ramp = np.arange(1, _N_RAMP + 1) / _N_RAMP
        steps, voltages = [], []
        before = 0.0
        for voltage, hold in ((self.extreme_v, self.held_s), (self.resting_v, self.resting_s)):
            steps.append(np.full(_N_RAMP, _RAMP_S / _N_RAMP))
            voltages.append(before + (voltage - before) * ramp)
            if hold > 0.0:
                held = np.geomspace(min(1e-3, 0.5 * hold), hold, _N_HOLD)
                steps.append(np.diff(held, prepend=0.0))
                voltages.append(np.full(_N_HOLD, voltage))
            before = voltage
        return np.concatenate(steps), np.concatenate(voltages)

    @classmethod
    def screening(cls, evidence: Evidence) -> list[Effect]:
        """Return excursions to either end of the range, some seconds before the record."""
        trials: list[Effect] = []
        span = evidence.largest_v - evidence.smallest_v
        first = float(evidence.records[0].voltage_v[0])
        for extreme in (evidence.largest_v, evidence.smallest_v, first + 0.3 * span, first - 0.3 * span):
            if abs(extreme - first) > 0.02 * span:
                trials += [cls(extreme, first, 2.0, rest) for rest in (0.15, 1.0, 6.0)]
        return trials

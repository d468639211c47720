"""The past of an actuator: what its drive did before a record, for a record that does not begin relaxed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fomrc_core.effects.base.cause import Cause
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.parameter import Parameter

Array = NDArray[np.float64]

_RAMP_S = 0.2  # of either move: quick beside a hold of a second, and its length is forgotten soon
_N_RAMP = 40  # steps of a move: plays and creep see it as straight
_N_HOLD = 40  # steps of a hold, ever longer, as creep forgets
_SHORTEST_HOLD_STEP_S = 1e-3
_LONG_REST_S = 1000.0  # creep of an order of some hundredths has come to rest by then
_FAR = 100.0  # times the length of a record
# Of the record: a rest shorter than the first sees it begin, longer than the last has faded for most of it.
_TRIAL_RESTS = (0.002, 0.013, 0.08)
_TRIAL_HELD = 0.03
_HELD_S = 1.0  # before a long rest at the same voltage: of no account


@dataclass(frozen=True)
class Prehistory(Cause):
    """What the drive did before the record: out to an extreme, held, then to a rest until the record began.

    It is no effect in the chain: it is where a model starts, a field of its own. Files and diagnoses name it
    ``initial_state``.
    """

    name: ClassVar[str] = "initial_state"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("extreme_v", "V", -1e6, 1e6, description="voltage of the excursion before the record"),
        Parameter("resting_v", "V", -1e6, 1e6, description="voltage just before the record"),
        Parameter("held_s", "s", 1e-9, 1e9, is_log=True, description="how long the excursion was held"),
        Parameter("resting_s", "s", 1e-9, 1e9, is_log=True, description="how long it then rested"),
    )
    main_parameter: ClassVar[str] = "extreme_v"
    meaning: ClassVar[str] = "The actuator had been moved before the record and was not relaxed."
    signature: ClassVar[str] = "a transient at the start that fades with log time, and a first branch off the origin"
    experiment: ClassVar[str] = "the relaxation routine before the record: the transient goes"
    inverse_note: ClassVar[str] = "not inverted: run the relaxation routine instead"
    bends_to_much: ClassVar[bool] = True
    is_record_bound: ClassVar[bool] = True
    held_parameters: ClassVar[tuple[str, ...]] = ("resting_v",)

    extreme_v: float = 0.0
    resting_v: float = 0.0
    held_s: float = 1.0
    resting_s: float = 1.0

    @classmethod
    def long_rest(cls, voltage_v: float) -> Prehistory:
        """Return a long rest at one voltage [V]."""
        return cls(voltage_v, voltage_v, _HELD_S, _LONG_REST_S)

    @property
    def is_plain_rest(self) -> bool:
        """Whether the drive simply rested at one voltage: how a record may begin, and no finding."""
        return self.extreme_v == self.resting_v

    def free_names(self) -> tuple[str, ...]:
        """Return what a fit moves; nothing where the drive simply rested at one voltage."""
        return () if self.is_plain_rest else super().free_names()

    def ran_away(self, duration_s: float) -> bool:
        """Return whether it was held or rested a hundred times as long: what creep tells of more has no slope."""
        return not self.is_plain_rest and max(self.held_s, self.resting_s) > _FAR * duration_s

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether it lasted for a sample: what is shorter than that is no past of a drive that is sampled so."""
        return self.is_plain_rest or max(self.held_s, self.resting_s) >= step_s

    def smallest_detectable(self, factor: float) -> dict[str, float]:
        """Return nothing: how far an excursion went says little of what it left."""
        return {}

    def drive(self) -> tuple[Array, Array]:
        """Return steps [s] and voltages [V] of what went before, each of shape (n_steps,)."""
        steps_s, voltage_v = _drive(self.extreme_v, self.resting_v, self.held_s, self.resting_s)
        return steps_s.copy(), voltage_v.copy()

    @classmethod
    def screening(cls, evidence: Evidence) -> list[Prehistory]:
        """Return excursions to either end of the range, held and rested for shares of what the record lasts."""
        trials: list[dict[str, float]] = []
        held_s = _TRIAL_HELD * evidence.duration_s
        span = evidence.largest_v - evidence.smallest_v
        first = float(evidence.records[0].voltage_v[0])
        for extreme in (evidence.largest_v, evidence.smallest_v, first + 0.3 * span, first - 0.3 * span):
            if abs(extreme - first) > 0.02 * span:
                rests_s = (share * evidence.duration_s for share in _TRIAL_RESTS)
                trials += [
                    {"extreme_v": extreme, "resting_v": first, "held_s": held_s, "resting_s": rest} for rest in rests_s
                ]
        return cls.proposed(trials)


@lru_cache(maxsize=256)
def _drive(extreme_v: float, resting_v: float, held_s: float, resting_s: float) -> tuple[Array, Array]:
    # a fit asks for the past of every record each time another of its parameters moves
    ramp = np.arange(1, _N_RAMP + 1) / _N_RAMP
    steps, voltages = [], []
    before = 0.0
    for voltage, hold in ((extreme_v, held_s), (resting_v, resting_s)):
        steps.append(np.full(_N_RAMP, _RAMP_S / _N_RAMP))
        voltages.append(before + (voltage - before) * ramp)
        held = np.geomspace(min(_SHORTEST_HOLD_STEP_S, 0.5 * hold), hold, _N_HOLD)
        steps.append(np.diff(held, prepend=0.0))
        voltages.append(np.full(_N_HOLD, voltage))
        before = voltage
    return np.concatenate(steps), np.concatenate(voltages)

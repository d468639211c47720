"""The ceramic's capacitance changes with its voltage, and with it the amplifier's lag."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.course import Course
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.kernels import lag_weights
from fomrc_core.effects.base.lag import is_seen
from fomrc_core.effects.base.step_form import FieldKind, Fields, Number, StateField, StepForm, ramp_in_step

_LEAST_CAPACITANCE = 0.05  # of that at zero volts: the straight line it is taken for must end somewhere
_BEND = 0.02  # relative change of the capacitance over a part of a step up to which its middle stands for it
_MOST_PARTS = 64
_LAGS = (0.15, 1.0, 8.0, 60.0)  # of trials, in samples: a lag of a part of a sample shows as well


@compiled
def _capacitance(voltage: float, per_v: float) -> float:
    return max(1.0 + per_v * voltage, _LEAST_CAPACITANCE)


@compiled
def _run_capacitance(
    state: Array, time_constant_s: float, per_v: float, values: Array, steps_s: Array, out: Array
) -> None:
    # T0 C(y) y' = u - y. Over a part in which C hardly changes the lag is exact with C at its middle, found by a
    # trapezoid with C at its start: second order in the part.
    output, before = state[0], state[1]
    for k in range(values.size):
        step, now = steps_s[k], values[k]
        present, old, new = _capacitance(output, per_v), _capacitance(before, per_v), _capacitance(now, per_v)
        lag_s = time_constant_s * present
        bends, least = max(abs(old - present), abs(new - present)), min(present, old, new)
        if bends * min(lag_s, step) < _BEND * least * lag_s:  # as nearly always: one part, no division to find that
            middle = output + step * (0.5 * (before + now) - output) / (2.0 * lag_s + step)
            decay, ramp = lag_weights(step / (time_constant_s * _capacitance(middle, per_v)))
            output = decay * output + (1.0 - decay - ramp) * before + ramp * now
        else:
            n_parts = int(min(1.0 + bends * min(1.0, step / lag_s) / (_BEND * least), _MOST_PARTS))
            part, rise = step / n_parts, (now - before) / n_parts
            for j in range(n_parts):
                first, last = before + j * rise, before + (j + 1) * rise
                lag_s = time_constant_s * _capacitance(output, per_v)
                middle = output + part * (0.5 * (first + last) - output) / (2.0 * lag_s + part)
                decay, ramp = lag_weights(part / (time_constant_s * _capacitance(middle, per_v)))
                output = decay * output + (1.0 - decay - ramp) * first + ramp * last
        before = now
        out[k] = output
    state[0], state[1] = output, before


def _charge(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    # The loop of _run_capacitance, once.
    present = max(1.0 + c.per_v * s.output, c.least_capacitance)
    old = max(1.0 + c.per_v * s.before, c.least_capacitance)
    new = max(1.0 + c.per_v * value, c.least_capacitance)
    reach = max(abs(old - present), abs(new - present)) * min(1.0, step_s / (c.time_constant_s * present))
    n_parts = int(min(1.0 + reach / (c.bend * min(present, min(old, new))), c.most_parts))
    part = step_s / n_parts
    rise = (value - s.before) / n_parts
    output = s.output
    for j in range(n_parts):
        first = s.before + j * rise
        last = s.before + (j + 1) * rise
        ratio = part / (c.time_constant_s * max(1.0 + c.per_v * output, c.least_capacitance))
        middle = output + 0.5 * ratio * (0.5 * (first + last) - output) / (1.0 + 0.5 * ratio)
        ratio = part / (c.time_constant_s * max(1.0 + c.per_v * middle, c.least_capacitance))
        decay = math.exp(-ratio)
        ramp = ramp_in_step(ratio)
        output = decay * output + (1.0 - decay - ramp) * first + ramp * last
    s.output = output
    s.before = value
    return s.output


def _lead(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    capacitance = max(1.0 + c.per_v * value, c.least_capacitance)
    led = value + c.time_constant_s * capacitance * (value - s.before) / step_s
    s.before = value
    return led


@dataclass(frozen=True)
class VoltageDependentCapacitance(Effect):
    """First-order lag of the drive whose time constant grows in proportion to the voltage at the ceramic."""

    name: ClassVar[str] = "voltage_dependent_capacitance"
    stage: ClassVar[Stage] = Stage.DRIVE
    order: ClassVar[float] = 26.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("time_constant_s", "s", 1e-10, 1e7, is_log=True, description="time constant at zero volts"),
        Parameter("per_v", "1/V", -1e6, 1e6, description="relative change of the capacitance per volt"),
    )
    main_parameter: ClassVar[str] = "time_constant_s"
    generalizes: ClassVar[str] = "amplifier_bandwidth"
    meaning: ClassVar[str] = "A ceramic's permittivity depends on its field, so the amplifier charges it less quickly."
    signature: ClassVar[str] = "residual follows the rate of the drive, by a share that depends on the voltage"
    experiment: ClassVar[str] = "equal small steps at several mean voltages, sampled fast: they arrive at unequal speed"
    inverse_note: ClassVar[str] = "inverted: the voltage leads by the time constant at its voltage times its rate"
    needs_substeps: ClassVar[bool] = True
    can_invert: ClassVar[bool] = True

    time_constant_s: float
    per_v: float

    def special_case(self) -> dict[str, float]:
        """Return the cutoff of an amplifier that lags as it does at zero volts."""
        return {"cutoff_hz": 1.0 / (2.0 * math.pi * self.time_constant_s)}

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether it is more than samples so far apart leave open."""
        return is_seen(self.time_constant_s, step_s)

    def initial_state(self) -> Array:
        """Return (output, input) [V] of the step before, at rest."""
        return np.zeros(2)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the voltage at the ceramic [V], shape (n_samples,)."""
        out = np.empty(values.size)
        _run_capacitance(state, self.time_constant_s, self.per_v, values, steps_s, out)
        return out

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the drive [V] that gives the wanted voltage; backward difference, so it cannot ring."""
        before = np.concatenate((state[:1], values[:-1]))
        state[0] = state[1] = values[-1]
        capacitance = np.maximum(1.0 + self.per_v * values, _LEAST_CAPACITANCE)
        return np.asarray(values + self.time_constant_s * capacitance * (values - before) / steps_s)

    def undo_known(self, wanted: Array, course: Course) -> Array:
        """Return the drive [V] that gives the wanted voltage, by its rate at the samples themselves."""
        capacitance = np.maximum(1.0 + self.per_v * wanted, _LEAST_CAPACITANCE)
        return np.asarray(wanted + self.time_constant_s * capacitance * course.rate(wanted))

    def scale_of(self, name: str, value: float) -> float:
        """Return a unit for a capacitance that does not change."""
        return abs(value) if value != 0.0 else 1e-3

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=(
                ("time_constant_s", self.time_constant_s),
                ("per_v", self.per_v),
                ("least_capacitance", _LEAST_CAPACITANCE),
                ("bend", _BEND),
                ("most_parts", float(_MOST_PARTS)),
            ),
            state=(
                StateField("output", kind=FieldKind.WIDE, comment="of the step before [V]"),
                StateField("before", comment="its input [V]"),
            ),
            forward=_charge,
            inverse=_lead,
            helpers=(ramp_in_step,),
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[VoltageDependentCapacitance]:
        """Return lags from a part of a sample to many, half as long again at the largest voltage, or half as long."""
        step_s, reach_v = evidence.sample_period_s, max(abs(evidence.largest_v), abs(evidence.smallest_v))
        if not reach_v > 0.0:
            return []
        trials = [(n, change / reach_v) for n in _LAGS for change in (0.5, -0.5)]
        return cls.proposed({"time_constant_s": n * step_s, "per_v": per_v} for n, per_v in trials)

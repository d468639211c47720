"""The voltage amplifier is a first-order low-pass."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compute.arrays import ComplexArray
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.kernels import run_lag
from fomrc_core.effects.base.lag import is_seen
from fomrc_core.effects.base.step_form import FieldKind, Fields, Number, StateField, StepForm, lag_ramp


def _prepare(k: Fields, c: Fields, step_s: float) -> None:
    k.gone = -math.expm1(-step_s / c.time_constant_s)
    k.ramp = lag_ramp(step_s / c.time_constant_s)


def _follow(s: Fields, k: Fields, value: float) -> Number:
    s.output = s.output + (k.ramp * value + (k.gone - k.ramp) * s.before - k.gone * s.output)
    s.before = value
    return s.output


def _lead(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    led = value + c.time_constant_s * (value - s.before) / step_s
    s.before = value
    return led


@dataclass(frozen=True)
class AmplifierBandwidth(Effect):
    """First-order low-pass on the drive, exact for a drive linear between samples."""

    name: ClassVar[str] = "amplifier_bandwidth"
    stage: ClassVar[Stage] = Stage.DRIVE
    order: ClassVar[float] = 20.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("cutoff_hz", "Hz", 1e-7, 1e9, is_log=True, description="-3 dB frequency"),
    )
    main_parameter: ClassVar[str] = "cutoff_hz"
    meaning: ClassVar[str] = "The amplifier charges the capacitive actuator through a resistance, so the drive lags."
    signature: ClassVar[str] = (
        "residual follows the rate of the drive, opens the loop with rising slope, decays exponentially after a step"
    )
    experiment: ClassVar[str] = "steps, and a multisine that reaches beyond the cutoff"
    inverse_note: ClassVar[str] = "inverted: the voltage leads by the time constant times its rate"
    paper_section: ClassVar[str] = "4.4"
    needs_substeps: ClassVar[bool] = True
    size_exponent: ClassVar[float] = -1.0
    can_invert: ClassVar[bool] = True

    cutoff_hz: float

    @property
    def time_constant_s(self) -> float:
        """Time constant [s]."""
        return 1.0 / (2.0 * np.pi * self.cutoff_hz)

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether it is more than samples so far apart leave open."""
        return is_seen(self.time_constant_s, step_s)

    def initial_state(self) -> Array:
        """Return (output, input) [V] of the step before, at rest."""
        return np.zeros(2)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the amplifier's output [V], shape (n_samples,)."""
        out = np.empty(values.size)
        run_lag(state, self.time_constant_s, values, steps_s, out)
        return out

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the drive [V] that gives the wanted output; backward difference, so it cannot ring.

        The exact inverse of the sampled filter has its pole close to -1 and would ring at half the sample rate.
        """
        before = np.concatenate((state[:1], values[:-1]))
        state[0] = state[1] = values[-1]
        return values + self.time_constant_s * (values - before) / steps_s

    def response(self, frequency_hz: Array) -> ComplexArray:
        """Return 1 / (1 + i f / f_c) [1] at frequencies [Hz]."""
        return np.asarray(1.0 / (1.0 + 1j * frequency_hz / self.cutoff_hz))

    def kin(self) -> dict[str, dict[str, float]]:
        """Return the sensor of one pole and the delay that lag as much where all is slow."""
        return {
            "sensor_bandwidth": {"cutoff_hz": self.cutoff_hz, "n_poles": 1.0, "in_stages": 0.0},
            "transport_delay": {"delay_s": float(self.time_constant_s)},
        }

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=(("time_constant_s", float(self.time_constant_s)),),
            state=(
                StateField("output", kind=FieldKind.WIDE, comment="of the step before [V]"),
                StateField("before", comment="its input [V]"),
            ),
            coefficients=("gone", "ramp"),
            prepare=_prepare,
            forward=_follow,
            inverse=_lead,
            helpers=(lag_ramp,),
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[AmplifierBandwidth]:
        """Return cutoffs from a thousandth of the sample rate, of a record sampled fast, to the sample rate."""
        rate = 1.0 / evidence.sample_period_s
        return cls.proposed({"cutoff_hz": rate * share} for share in (0.001, 0.01, 0.03, 0.1, 0.3, 1.0))

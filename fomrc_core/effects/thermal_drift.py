"""The stage expands with temperature."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.covariates import Covariate
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.kernels import elapsed_times
from fomrc_core.effects.base.step_form import CLOCK_FIELDS, FieldKind, Fields, Number, StateField, StepForm, clock_after

_TRIAL_SHARE = 1e-3  # of the stroke: small enough that what a trial changes is in proportion to it
# Of a record, between which a walk is told from what stands: shorter than any drift of the form here, longer than most
# correlations.
_NEAR_PART, _FAR_PART = 128, 32
_QUICKEST_WARM_UP = 0.08  # of the longest record


def _drifted(s: Fields, c: Fields, value: float, step_s: float, covariate: float, is_known: int) -> Number:
    s.elapsed = clock_after(s.elapsed, s.started, step_s)
    s.started = 1
    t = s.elapsed
    drift = t * (c.um_per_s + t * (c.um_per_s2 + t * c.um_per_s3))
    if c.warm_up_um != 0.0:
        drift = drift + c.warm_up_um * (1.0 - math.exp(-t / c.warm_up_s))
    if is_known and c.um_per_c != 0.0:
        if s.has_reference == 0:
            s.reference_c = covariate
            s.has_reference = 1
        drift = drift + c.um_per_c * (covariate - s.reference_c)
    return value + drift


def _without_temperature(s: Fields, c: Fields, value: float, covariate: float, is_known: int) -> Number:
    if not is_known or c.um_per_c == 0.0:
        return value
    if s.has_reference == 0:
        s.reference_c = covariate
        s.has_reference = 1
    return value - c.um_per_c * (covariate - s.reference_c)


@dataclass(frozen=True)
class ThermalDrift(Effect):
    """Displacement in proportion to temperature where it is recorded, else a smooth drift or a warm-up in time."""

    name: ClassVar[str] = "thermal_drift"
    stage: ClassVar[Stage] = Stage.SENSED
    order: ClassVar[float] = 30.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("um_per_c", "um/degC", -1e9, 1e9, description="expansion per degree"),
        Parameter("um_per_s", "um/s", -1e12, 1e12, description="drift where no temperature is recorded"),
        Parameter("um_per_s2", "um/s^2", -1e18, 1e18, description="its curvature"),
        Parameter("um_per_s3", "um/s^3", -1e24, 1e24, description="change of its curvature"),
        Parameter("warm_up_um", "um", -1e6, 1e6, description="what a warm-up comes to in the end"),
        Parameter("warm_up_s", "s", 1e-9, 1e9, is_log=True, description="time constant of the warm-up"),
    )
    covariate: ClassVar[Covariate | None] = Covariate.TEMPERATURE
    main_parameter: ClassVar[str] = "um_per_c"
    meaning: ClassVar[str] = "The frame between stage and sensor expands as its temperature changes."
    signature: ClassVar[str] = "residual follows the temperature, or drifts smoothly whatever the drive does"
    experiment: ClassVar[str] = "hold the drive at zero for minutes and record the temperature"
    inverse_note: ClassVar[str] = "inverted where the temperature is known while running; a drift in time is not"
    bends_to_much: ClassVar[bool] = True
    can_invert: ClassVar[bool] = True
    linear_parameters: ClassVar[tuple[str, ...]] = ("um_per_c", "um_per_s", "um_per_s2", "um_per_s3", "warm_up_um")

    um_per_c: float = 0.0
    um_per_s: float = 0.0
    um_per_s2: float = 0.0
    um_per_s3: float = 0.0
    warm_up_um: float = 0.0
    warm_up_s: float = 60.0

    def initial_state(self) -> Array:
        """Return (elapsed [s], started, reference temperature [degC])."""
        return np.array([0.0, 0.0, np.nan])

    def _drift(self, state: Array, steps_s: Array, covariate: Array | None) -> Array:
        t = np.empty(steps_s.size)
        elapsed_times(state, steps_s, t)
        drift: Array = t * (self.um_per_s + t * (self.um_per_s2 + t * self.um_per_s3))
        if self.warm_up_um != 0.0:
            drift = drift - self.warm_up_um * np.expm1(-t / self.warm_up_s)
        if covariate is not None and self.um_per_c != 0.0:
            if np.isnan(state[2]):
                state[2] = covariate[0]
            drift = drift + self.um_per_c * (covariate - state[2])
        return drift

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement [um] with the drift, shape (n_samples,)."""
        return values + self._drift(state, steps_s, covariate)

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement [um] without the part the temperature explains."""
        if covariate is None or self.um_per_c == 0.0:
            return values
        if np.isnan(state[2]):
            state[2] = covariate[0]
        without: Array = values - self.um_per_c * (covariate - state[2])
        return without

    def free_names(self) -> tuple[str, ...]:
        """Return the expansion where temperature is used, else a warm-up or the whole drift in time."""
        if self.um_per_c != 0.0:
            return ("um_per_c",)
        return ("warm_up_um", "warm_up_s") if self.warm_up_um != 0.0 else ("um_per_s", "um_per_s2", "um_per_s3")

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether a warm-up takes its time: one that is soon over is an actuator that creeps."""
        return self.warm_up_um == 0.0 or self.warm_up_s >= _QUICKEST_WARM_UP * duration_s

    def belongs_to_record(self) -> bool:
        """Return whether this is a drift in time, which no other record repeats."""
        return self.um_per_c == 0.0

    def is_confirmed(self, time_s: Array, voltage_v: Array, residual_um: Array) -> bool:
        """Return whether a drift in time is more than a random walk of the sensor would bring.

        The variance of a walk about its mean is dominated by its slowest mode, n d / pi^2 times a squared normal number
        (Karhunen and Loeve) where d is the variance it gains per sample: one in some hundred comes to more than n d.
        """
        if not self.belongs_to_record():
            return True
        steps_s = np.diff(time_s, prepend=2.0 * time_s[0] - time_s[1])
        drift = self._drift(self.initial_state(), steps_s, None)
        rest = residual_um - drift
        near, far = max(rest.size // _NEAR_PART, 1), max(rest.size // _FAR_PART, 2)
        gained = float(np.mean((rest[far:] - rest[:-far]) ** 2) - np.mean((rest[near:] - rest[:-near]) ** 2))
        per_sample = max(gained, 0.0) / (far - near)
        return float(np.var(drift)) > per_sample * rest.size

    def scale_of(self, name: str, value: float) -> float:
        """Return a unit for a term that stands at zero."""
        return abs(value) if value != 0.0 else 1e-6

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=tuple((spec.name, getattr(self, spec.name)) for spec in self.parameters),
            state=(
                *CLOCK_FIELDS,
                StateField("reference_c", comment="first temperature known [degC]"),
                StateField("has_reference", kind=FieldKind.COUNT, comment="whether there has been one"),
            ),
            forward=_drifted,
            inverse=_without_temperature,
            helpers=(clock_after,),
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[ThermalDrift]:
        """Return an expansion where the temperature was recorded, drifts (one there and back) and warm-ups."""
        t, size_um = evidence.duration_s, _TRIAL_SHARE * evidence.stroke_um
        trials = [
            {"um_per_s": size_um / t},
            {"um_per_s": 2.0 * size_um / t, "um_per_s2": -size_um / t**2},
            {"um_per_s2": size_um / t**2, "um_per_s3": -size_um / t**3},
            {"um_per_s": size_um / t, "um_per_s2": -3.0 * size_um / t**2, "um_per_s3": 2.0 * size_um / t**3},
            {"warm_up_um": size_um, "warm_up_s": 0.2 * t},
            {"warm_up_um": size_um, "warm_up_s": 0.6 * t},
        ]
        stroke_per_c = evidence.stroke_per(Covariate.TEMPERATURE)
        if stroke_per_c > 0.0 and all(record.has(Covariate.TEMPERATURE) for record in evidence.records):
            trials.append({"um_per_c": _TRIAL_SHARE * stroke_per_c})
        return cls.proposed(trials)

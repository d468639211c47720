"""The sensor's electronics are a low-pass."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.lag import is_seen
from fomrc_core.effects.base.linear_columns import through_pairs
from fomrc_core.effects.base.linear_modes import pairs_at_rest, run_pairs
from fomrc_core.effects.base.pairs_beside import pairs_form
from fomrc_core.effects.base.step_form import StepForm

_MOST_POLES = 4
_KINDS = [(float(n), stages) for n in range(1, _MOST_POLES + 1) for stages in (0.0, 1.0) if n > 1 or not stages]
_N_NEWTON = 6  # to rounding
# Ratio of neighbouring poles of stages that are all alike: equal ones have no modes of their own, and of two that
# differ so little the response is within half a percent of that of equal ones.
_APART = 1.1


@dataclass(frozen=True)
class SensorBandwidth(Effect):
    """Low-pass of the displacement as it is read, exact for a displacement linear between samples.

    A Butterworth filter, or stages one behind the other, each with one pole and all alike (resistor and capacitor). It
    stands among the mechanics, not with what is done at the samples, for what it filters has moved in between.
    """

    name: ClassVar[str] = "sensor_bandwidth"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 25.0
    is_of_sensor: ClassVar[bool] = True
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("cutoff_hz", "Hz", 1e-7, 1e9, is_log=True, description="-3 dB frequency"),
        Parameter("n_poles", "1", 1.0, float(_MOST_POLES), description="number of poles, a whole number"),
        Parameter("in_stages", "1", 0.0, 1.0, description="1: a stage for each pole, all alike; 0: Butterworth"),
    )
    main_parameter: ClassVar[str] = "cutoff_hz"
    held_parameters: ClassVar[tuple[str, ...]] = ("n_poles", "in_stages")
    meaning: ClassVar[str] = "The sensor's electronics or the recorder's filter smooth the reading, so that it lags."
    signature: ClassVar[str] = (
        "residual follows the rate of the displacement, hysteresis and creep with it, much as behind a slow amplifier"
    )
    experiment: ClassVar[str] = (
        "multisines of two amplitudes beyond the cutoff: what lags behind the sensor lags as much at both, what lags "
        "before the ceramic moves its loops; or a second, faster sensor beside this one"
    )
    inverse_note: ClassVar[str] = "not inverted: the reading lags, not the position"
    needs_substeps: ClassVar[bool] = True
    size_exponent: ClassVar[float] = -1.0

    cutoff_hz: float
    n_poles: float = 1.0
    in_stages: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "n_poles", float(round(self.n_poles)))
        # one pole is one stage, whatever it is called
        object.__setattr__(self, "in_stages", float(round(self.in_stages)) if self.n_poles > 1.0 else 0.0)

    def form(self) -> tuple[str, ...]:
        """Return the parameters a fit moves, and the kind of filter: four poles lag as a delay does, one does not."""
        return (*super().form(), f"{self.n_poles:.0f} poles", f"{self.in_stages:.0f}")

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether it is more than samples so far apart leave open."""
        (delay_s,) = self.kin()["transport_delay"].values()
        return is_seen(delay_s, step_s)

    def initial_state(self) -> Array:
        """Return (input [um] of the step before, then both parts of each pole's mode), at rest."""
        return pairs_at_rest(len(self._modes[0]))

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the filtered displacement [um], shape (n_samples,)."""
        out = np.empty(values.size)
        poles, gains = self._modes
        run_pairs(state, poles, gains, values, steps_s, out)
        return out

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the filtered changes, (n_samples, n_changes)."""
        return through_pairs(*self._modes, 0.0, changes, steps_s)

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return pairs_form(*self._modes)

    def kin(self) -> dict[str, dict[str, float]]:
        """Return the delay and the amplifier that lag as much where all is slow: many poles are a delay (Pade)."""
        poles, gains = (values[:, 0] + 1j * values[:, 1] for values in self._modes)
        delay_s = -float(np.sum((gains / poles).real))
        if not delay_s > 0.0:
            return {"transport_delay": {"delay_s": delay_s}}
        return {
            "transport_delay": {"delay_s": delay_s},
            "amplifier_bandwidth": {"cutoff_hz": 1.0 / (2.0 * np.pi * delay_s)},
        }

    def other_forms(self) -> list[SensorBandwidth]:
        """Return sensors of other poles that lag as much where all is slow."""
        (delay_s,) = self.kin()["transport_delay"].values()
        others = []
        for n_poles, in_stages in _KINDS:
            other = replace(self, n_poles=n_poles, in_stages=in_stages)
            (other_s,) = other.kin()["transport_delay"].values()
            if (n_poles, in_stages) != (self.n_poles, self.in_stages) and delay_s > 0.0:
                others.append({**other.to_mapping(), "cutoff_hz": self.cutoff_hz * other_s / delay_s})
        return self.proposed(others)

    @cached_property
    def _modes(self) -> tuple[Array, Array]:
        modes = stage_modes if self.in_stages else butterworth_modes
        return modes(2.0 * np.pi * self.cutoff_hz, int(self.n_poles))

    @classmethod
    def screening(cls, evidence: Evidence) -> list[SensorBandwidth]:
        """Return cutoffs up to the sample rate, beyond which a filter hardly lags, of every kind."""
        rate = 1.0 / evidence.sample_period_s
        return cls.proposed(
            {"cutoff_hz": rate * share, "n_poles": n_poles, "in_stages": in_stages}
            for n_poles, in_stages in _KINDS
            for share in (0.005, 0.02, 0.08, 0.3, 0.9)
        )


def butterworth_modes(cutoff_per_s: float, n_poles: int) -> tuple[Array, Array]:
    """Return poles [1/s] and gains of a Butterworth low-pass as modes side by side, each of shape (n_pairs, 2).

    Of each conjugate pair of poles one is given, its gain doubled; the columns are real and imaginary parts.

    Args:
        cutoff_per_s: -3 dB angular frequency [rad/s].
        n_poles: number of poles.
    """
    angles = np.pi * (2.0 * np.arange(n_poles) + n_poles + 1.0) / (2.0 * n_poles)
    poles = np.exp(1j * angles)
    # H(s) = prod p_j / (p_j - s) = sum_j g_j p_j / (p_j - s)
    gains = np.array([np.prod([q / (q - p) for k, q in enumerate(poles) if k != j]) for j, p in enumerate(poles)])
    upper = poles.imag > -1e-9  # of a pair the upper one; a pole on the axis stands alone
    gains = gains[upper] * np.where(poles[upper].imag > 1e-9, 2.0, 1.0)
    poles = poles[upper] * cutoff_per_s
    return np.column_stack((poles.real, poles.imag)), np.column_stack((gains.real, gains.imag))


def stage_modes(cutoff_per_s: float, n_poles: int) -> tuple[Array, Array]:
    """Return poles [1/s] and gains of so many first-order stages one behind the other, each of shape (n_poles, 2).

    Args:
        cutoff_per_s: -3 dB angular frequency of them all together [rad/s].
        n_poles: number of stages.
    """
    rates = _APART ** (np.arange(n_poles) - 0.5 * (n_poles - 1.0))
    # Newton's way to the frequency at which they pass half the power
    log_power, cutoff = math.log(2.0), math.sqrt(2.0 ** (1.0 / n_poles) - 1.0)
    for _ in range(_N_NEWTON):
        squares = (cutoff / rates) ** 2
        slope = float(np.sum(2.0 * cutoff / rates**2 / (1.0 + squares)))
        cutoff -= (float(np.sum(np.log1p(squares))) - log_power) / slope
    gains = np.array([np.prod([q / (q - p) for k, q in enumerate(rates) if k != j]) for j, p in enumerate(rates)])
    still = np.zeros(n_poles)
    return np.column_stack((-rates / cutoff * cutoff_per_s, still)), np.column_stack((gains, still))

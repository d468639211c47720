"""Any rival behind a first-order amplifier: the same ``amplifier_bandwidth`` effect for every one of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from fomrc_core.comparison.baselines.creep_cascade import lag
from fomrc_core.comparison.baselines.rival import FittedRival, Rival, TrainingRecord, training_error_um

Array = NDArray[np.float64]


def amplified_voltage(steps_s: Array, voltage_v: Array, time_constant_s: float) -> Array:
    """Return the amplifier's output [V]; before the first sample it stood at the first voltage."""
    first = voltage_v[0]
    lagged: Array = lag(np.ascontiguousarray((voltage_v - first)[:, None]), steps_s, time_constant_s)[:, 0] + first
    return lagged


@dataclass(frozen=True, eq=False)
class FittedAmplified(FittedRival):
    """A fitted rival behind an amplifier.

    Attributes:
        inner: the rival.
        time_constant_s: of the amplifier [s].
    """

    inner: FittedRival
    time_constant_s: float

    @property
    def has_inverse(self) -> bool:  # type: ignore[override]
        """Whether the rival has an inverse; the amplifier has one."""
        return self.inner.has_inverse

    @property
    def cutoff_hz(self) -> float:
        """-3 dB frequency of the amplifier [Hz]."""
        return float(1.0 / (2.0 * np.pi * self.time_constant_s))

    @property
    def n_parameters(self) -> int:
        """Those of the rival, and the cutoff."""
        return self.inner.n_parameters + 1

    def simulate(self, steps_s: Array, voltage_v: Array) -> Array:
        """Return the displacement [um], shape (n_samples,)."""
        return self.inner.simulate(steps_s, amplified_voltage(steps_s, voltage_v, self.time_constant_s))

    def invert(self, steps_s: Array, desired_um: Array) -> Array:
        """Return the drive [V]: the rival's voltage, led by the time constant (backward difference)."""
        voltage = self.inner.invert(steps_s, desired_um)
        rate = np.diff(voltage, prepend=voltage[0]) / steps_s
        lead: Array = voltage + self.time_constant_s * rate
        return lead


@dataclass(frozen=True)
class Amplified(Rival):
    """A rival behind a first-order amplifier, its cutoff found by training error.

    Args:
        inner: the rival.
        n_trials: fits of the rival in the search for the cutoff.
    """

    inner: Rival
    n_trials: int = 12

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the rival."""
        return self.inner.name

    @property
    def publication(self) -> str:  # type: ignore[override]
        """Publication of the rival."""
        return self.inner.publication

    def fit(self, records: Sequence[TrainingRecord]) -> FittedAmplified:
        """Return the rival fitted for the best cutoff."""
        step_s = float(np.median(records[0].steps_s))

        def fitted(log_time: float) -> FittedAmplified:
            tau = float(np.exp(log_time))
            driven = [replace(r, voltage_v=amplified_voltage(r.steps_s, r.voltage_v, tau)) for r in records]
            return FittedAmplified(self.inner.fit(driven), tau)

        found = minimize_scalar(
            lambda log_time: training_error_um(fitted(log_time), records),
            method="bounded",
            bounds=(np.log(0.05 * step_s), np.log(30.0 * step_s)),
            options={"maxiter": self.n_trials, "xatol": 0.01},
        )
        return fitted(float(found.x))

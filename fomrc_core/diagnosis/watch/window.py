"""The recent past under the model in force, as hypotheses on what changed are fitted to it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.state import ModelState
from fomrc_core.records.recording import Recording


@dataclass(frozen=True, eq=False)
class Window:
    """A stretch of the recent past; what fits is measured with a constant offset taken out.

    Args:
        model: the model in force.
        recording: the stretch; its time begins at zero.
        state: state of the model just before it.
        small_um: what the model gets wrong in normal work [um].
        n_fitted: how many of the samples hypotheses are fitted to; those after are for judging.
    """

    model: PiezoModel
    recording: Recording
    state: ModelState
    small_um: float
    n_fitted: int

    @cached_property
    def time_s(self) -> Array:
        """Time of the fitted samples [s]."""
        return self.recording.time_s[: self.n_fitted]

    @cached_property
    def steps_s(self) -> Array:
        """Step that leads to each fitted sample [s]."""
        return self.recording.steps_s[: self.n_fitted]

    @cached_property
    def voltage_v(self) -> Array:
        """Drive of the fitted samples [V]."""
        return self.recording.voltage_v[: self.n_fitted]

    @cached_property
    def predicted_um(self) -> Array:
        """What the model in force says [um]."""
        return self.model.simulate(self.steps_s, self.voltage_v, self.state.copy())

    @cached_property
    def residual_um(self) -> Array:
        """Measured minus predicted [um], as it is."""
        return self.recording.measured_um[: self.n_fitted] - self.predicted_um

    @cached_property
    def period_s(self) -> float:
        """Median step [s]."""
        return float(np.median(self.steps_s))

    @cached_property
    def worst_um2(self) -> float:
        """Sum of squares that no change at all leaves [um^2]."""
        return self.squared_error(np.zeros(self.n_fitted))

    @property
    def duration_s(self) -> float:
        """Length of the fitted part [s]."""
        return float(self.time_s[-1])

    def index(self, time_s: float) -> int:
        """Return the first sample at or after a time."""
        return min(int(np.searchsorted(self.time_s, time_s)), self.time_s.size - 1)

    def state_at(self, index: int) -> ModelState:
        """Return the state of the model just before a sample."""
        state = self.state.copy()
        if index > 0:
            self.model.simulate(self.steps_s[:index], self.voltage_v[:index], state)
        return state

    def amplitude(self, shape_um: Array) -> float:
        """Return by which factor a change fits the residual best, an offset beside it."""
        shape = shape_um - np.mean(shape_um)
        power = float(shape @ shape)
        return float(shape @ self.residual_um) / power if power > 0.0 else 0.0

    def squared_error(self, change_um: Array) -> float:
        """Return the sum of squares that a change leaves, an offset taken out [um^2]."""
        left = self.residual_um - change_um
        left = left - np.mean(left)
        return float(left @ left)

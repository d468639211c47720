"""A larger displacement creeps by a larger share of itself."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.course import Course
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.linear_modes import logarithmic_modes, modes_at_rest, modes_form, run_modes
from fomrc_core.effects.base.step_form import Fields, Number, StepForm


def _creep_by_square(s: Fields, k: Fields, c: Fields, value: float) -> Number:
    # ``run_modes`` of the displacement times its size
    square = value * abs(value)
    total = value
    for j in range(len(c.rates)):
        mode = s.modes[j] + (k.ramp[j] * square + (k.gone[j] - k.ramp[j]) * s.before - k.gone[j] * s.modes[j])
        s.modes[j] = mode
        total = total + c.gains[j] * mode
    s.before = square
    return total


@dataclass(frozen=True)
class AmplitudeDependentCreep(Effect):
    """Creep of the displacement times its own size beside the creep in proportion; exact between samples.

    After a step x it adds per_decade_per_um |x| x log10(1 + t / onset_s).
    """

    name: ClassVar[str] = "amplitude_dependent_creep"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 4.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("per_decade_per_um", "1/um", -1e9, 1e9, description="growth in each decade of time, per um moved"),
        Parameter("onset_s", "s", 1e-12, 1e9, is_log=True, description="time after a step from which it grows so"),
    )
    main_parameter: ClassVar[str] = "per_decade_per_um"
    linear_parameters: ClassVar[tuple[str, ...]] = ("per_decade_per_um",)
    # drive and elements hide when it begins: left to a fit it goes to any time shorter than a sample
    held_parameters: ClassVar[tuple[str, ...]] = ("onset_s",)
    meaning: ClassVar[str] = "Strong fields move domains that weak ones leave: large steps creep by more per cent."
    signature: ClassVar[str] = "after large steps the residual creeps on, after small ones it creeps back"
    experiment: ClassVar[str] = "steps of several sizes from the same level, each held for two decades of time"
    inverse_note: ClassVar[str] = "not inverted: creep in proportion alone is undone"
    slope_depends_on_input: ClassVar[bool] = True

    per_decade_per_um: float
    onset_s: float

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether wider motion creeps more: less is a correction of the creep order, and no cause."""
        return self.per_decade_per_um > 0.0

    def initial_state(self) -> Array:
        """Return (input, then each mode) [um^2] of the step before, at rest."""
        return modes_at_rest(logarithmic_modes(self.onset_s)[0].size)

    def _crept(self, state: Array, squares: Array, steps_s: Array) -> Array:
        rates, gains = logarithmic_modes(self.onset_s)
        out = np.empty(squares.size)
        run_modes(state, rates, gains * (self.per_decade_per_um / math.log(10.0)), 0.0, squares, steps_s, out)
        return out

    def undo_known(self, wanted: Array, course: Course) -> Array:
        """Return what is wanted: what creep adds beyond its proportion is small, and found by asking again."""
        return wanted

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement that has crept [um], shape (n_samples,)."""
        return np.asarray(values + self._crept(state, values * np.abs(values), steps_s))

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes, and the creep of each times twice the displacement's size."""
        if values is None:
            return changes
        passed = changes.copy()
        for column in range(changes.shape[1]):
            squares = np.ascontiguousarray(2.0 * np.abs(values) * changes[:, column])
            passed[:, column] += self._crept(self.initial_state(), squares, steps_s)
        return np.asarray(passed)

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        rates, gains = logarithmic_modes(self.onset_s)
        form = modes_form(rates, gains * (self.per_decade_per_um / math.log(10.0)), 0.0, is_inverted=False)
        return replace(form, forward=_creep_by_square)

    @classmethod
    def screening(cls, evidence: Evidence) -> list[AmplitudeDependentCreep]:
        """Return creep of a thousandth of the stroke at full stroke, from a sample on and from later."""
        step_s, stroke_um = evidence.sample_period_s, evidence.stroke_um
        if not stroke_um > 0.0:
            return []
        return cls.proposed(
            {"per_decade_per_um": 1e-3 / stroke_um, "onset_s": onset}
            for onset in (step_s, 20.0 * step_s, 0.02 * evidence.duration_s)
        )

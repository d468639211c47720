"""What no cause explains and what changes with the time since the start: a few terms, and no name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Parameter
from fomrc_core.effects.base.kernels import elapsed_times
from fomrc_core.effects.base.signal_kernels import add_terms_of_time, late_after, power_of
from fomrc_core.effects.base.signal_terms import SignalTerms, parameters_of
from fomrc_core.effects.base.slopes import slope_by_differences
from fomrc_core.effects.base.step_form import CLOCK_FIELDS, StepForm, clock_after, ramp_in_step
from fomrc_core.effects.base.term_scales import TermScales


@dataclass(frozen=True)
class UnnamedInTime(SignalTerms):
    """Displacement plus terms that grow with the time since the start: by itself, times displacement, times motion."""

    name: ClassVar[str] = "unnamed_in_time"
    order: ClassVar[float] = 1000.0
    parameters: ClassVar[tuple[Parameter, ...]] = parameters_of("s", "the displacement whose motion is meant")
    meaning: ClassVar[str] = (
        "Something changes while the stage works, and no cause in the library does it so; these terms follow it."
    )
    signature: ClassVar[str] = "what is left grows with the time since the start, and no cause follows it"
    experiment: ClassVar[str] = "the same drive again, at once and after a long rest"
    inverse_note: ClassVar[str] = "not inverted: what changes is that of the record and does not go on for ever"
    signal_words: ClassVar[str] = "the time since the start"
    lags_displacement: ClassVar[bool] = True
    slope_depends_on_input: ClassVar[bool] = True

    @property
    def can_invert(self) -> bool:  # type: ignore[override]  # as in the base class
        """Return that it is left as it is."""
        return False

    @classmethod
    def offered(cls, scales: TermScales) -> UnnamedInTime:
        """Return powers of the time by themselves, and times displacement and motion."""
        terms = [(q, p, 0.0) for q in (1.0, 2.0, 3.0) for p in (0.0, 1.0, 2.0)]
        terms += [(1.0, 0.0, lag) for lag in scales.lags_s]
        found: UnnamedInTime = cls.offering(scales, terms, 0.0, scales.duration_s)
        return found

    def _signal(self, state: Array, steps_s: Array, covariate: Array | None) -> Array:
        t = np.empty(steps_s.size)
        elapsed_times(state[:2].copy(), steps_s, t)
        return (t - self.signal_zero) / self.signal_range

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=self._constants(),
            state=(*CLOCK_FIELDS, *self._memory()),
            forward=add_terms_of_time,
            helpers=(clock_after, ramp_in_step, late_after, power_of),
        )

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes with what they change of the terms, by differences about the displacement."""
        return changes if values is None else slope_by_differences(self, changes, steps_s, values, self.span_um)

"""A larger displacement creeps by a larger share of itself, or what switches creeps beside what is elastic."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.course import Course
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.linear_modes import logarithmic_modes, modes_at_rest, modes_form, run_modes
from fomrc_core.effects.base.step_form import Fields, Number, StateField, StepForm

_N_PLAYS = 12  # of the switching part: twice as many change it by less than a hundredth
_REACHES = (1.0, 0.6, 0.35)  # offered, shares of the largest displacement


@compiled
def _run_switching(plays: Array, reach_um: float, values: Array, out: Array) -> None:
    # Rayleigh's picture: as many domains for each threshold up to the reach.
    n_plays = plays.size
    for k in range(values.size):
        total = 0.0
        for j in range(n_plays):
            threshold = reach_um * (j + 1) / n_plays
            plays[j] = min(max(plays[j], values[k] - threshold), values[k] + threshold)
            total += plays[j]
        out[k] = total / n_plays


def _creep_by_source(s: Fields, k: Fields, c: Fields, value: float) -> Number:
    # ``run_modes`` of the displacement times its size, and of what has switched
    total = 0.0
    for j in range(len(c.thresholds_um)):
        s.plays[j] = min(max(s.plays[j], value - c.thresholds_um[j]), value + c.thresholds_um[j])
        total = total + s.plays[j]
    source = c.per_um * value * abs(value) + c.switched * (total / len(c.thresholds_um))
    total = value
    for j in range(len(c.rates)):
        mode = s.modes[j] + (k.ramp[j] * source + (k.gone[j] - k.ramp[j]) * s.before - k.gone[j] * s.modes[j])
        s.modes[j] = mode
        total = total + c.gains[j] * mode
    s.before = source
    return total


@dataclass(frozen=True)
class AmplitudeDependentCreep(Effect):
    """Creep that is more than in proportion beside the creep that is; exact between samples.

    After a step x it adds per_decade_per_um |x| x log10(1 + t / onset_s); or what has switched, the mean of plays of
    the displacement of all thresholds up to a reach (Rayleigh), creeps by switched_per_decade of itself, whatever level
    it begins at.
    """

    name: ClassVar[str] = "amplitude_dependent_creep"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 4.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("per_decade_per_um", "1/um", -1e9, 1e9, description="growth in each decade of time, per um moved"),
        Parameter("onset_s", "s", 1e-12, 1e9, is_log=True, description="time after a step from which it grows so"),
        Parameter("switched_per_decade", "1", -1e3, 1e3, description="growth of what has switched in each decade"),
        Parameter("reach_um", "um", 1e-9, 1e9, is_log=True, description="largest threshold of what switches"),
    )
    main_parameter: ClassVar[str] = "per_decade_per_um"
    linear_parameters: ClassVar[tuple[str, ...]] = ("per_decade_per_um", "switched_per_decade")
    # drive and elements hide when it begins: left to a fit it goes to any time shorter than a sample
    held_parameters: ClassVar[tuple[str, ...]] = ("onset_s",)
    meaning: ClassVar[str] = "Strong fields move domains that weak ones leave: large steps creep by more per cent."
    signature: ClassVar[str] = "after large steps the residual creeps on, after small ones it creeps back"
    experiment: ClassVar[str] = "steps of several sizes from the same level, each held for two decades of time"
    inverse_note: ClassVar[str] = "not inverted: creep in proportion alone is undone"
    slope_depends_on_input: ClassVar[bool] = True

    per_decade_per_um: float
    onset_s: float
    switched_per_decade: float = 0.0
    reach_um: float = 1.0

    def free_names(self) -> tuple[str, ...]:
        """Return the size of what there is, and of what switches its reach."""
        names = super().free_names()
        return names if self.switched_per_decade != 0.0 else tuple(name for name in names if name != "reach_um")

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether wider motion creeps more: less is a correction of the creep order, and no cause."""
        return self.per_decade_per_um > 0.0 or self.switched_per_decade > 0.0

    def initial_state(self) -> Array:
        """Return (source, then each mode) [um] of the step before, and each play [um], at rest."""
        return np.concatenate((modes_at_rest(logarithmic_modes(self.onset_s)[0].size), np.zeros(_N_PLAYS)))

    def _crept(self, state: Array, source: Array, steps_s: Array) -> Array:
        rates, gains = logarithmic_modes(self.onset_s)
        out = np.empty(source.size)
        run_modes(state, rates, gains / math.log(10.0), 0.0, source, steps_s, out)
        return out

    def _source(self, plays: Array, values: Array) -> Array:
        """Return what creeps beyond proportion, times its share in each decade [um]; the plays move on."""
        source = self.per_decade_per_um * values * np.abs(values)
        if self.switched_per_decade != 0.0:
            switched = np.empty(values.size)
            _run_switching(plays, self.reach_um, values, switched)
            source = source + self.switched_per_decade * switched
        return np.asarray(source)

    def undo_known(self, wanted: Array, course: Course) -> Array:
        """Return what is wanted: what creep adds beyond its proportion is small, and found by asking again."""
        return wanted

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement that has crept [um], shape (n_samples,)."""
        n_modes = state.size - _N_PLAYS
        source = self._source(state[n_modes:], values)
        return np.asarray(values + self._crept(state[:n_modes], source, steps_s))

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes, and the creep of each times twice the displacement's size; what switches is left out."""
        if values is None or self.per_decade_per_um == 0.0:
            return changes
        passed = changes.copy()
        for column in range(changes.shape[1]):
            squares = np.ascontiguousarray(2.0 * self.per_decade_per_um * np.abs(values) * changes[:, column])
            passed[:, column] += self._crept(self.initial_state()[:-_N_PLAYS], squares, steps_s)
        return np.asarray(passed)

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        rates, gains = logarithmic_modes(self.onset_s)
        form = modes_form(rates, gains / math.log(10.0), 0.0, is_inverted=False)
        thresholds_um = tuple(self.reach_um * (j + 1) / _N_PLAYS for j in range(_N_PLAYS))
        return replace(
            form,
            constants=(
                *form.constants,
                ("per_um", self.per_decade_per_um),
                ("switched", self.switched_per_decade),
                ("thresholds_um", thresholds_um),
            ),
            state=(*form.state, StateField("plays", (0.0,) * _N_PLAYS, is_array=True, comment="of the displacement")),
            forward=_creep_by_source,
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[AmplitudeDependentCreep]:
        """Return creep of a thousandth of the stroke at full stroke, of either kind, from a sample on and later."""
        step_s, stroke_um = evidence.sample_period_s, evidence.stroke_um
        if not stroke_um > 0.0:
            return []
        largest_um = max(float(np.max(np.abs(record.predicted_um))) for record in evidence.records)
        onsets_s = (step_s, 20.0 * step_s, 0.02 * evidence.duration_s)
        sizes: list[dict[str, float]] = [{"per_decade_per_um": 1e-3 / stroke_um}]
        for share in _REACHES:
            sizes.append({"per_decade_per_um": 0.0, "switched_per_decade": 1e-3, "reach_um": share * largest_um})
        return cls.proposed({**size, "onset_s": onset} for size in sizes for onset in onsets_s)

"""A larger displacement creeps by a larger share of itself, or what switches creeps beside what is elastic."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.course import Course
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.kernels import plain_block, run_knees, with_plays_of
from fomrc_core.effects.base.linear_columns import through_modes
from fomrc_core.effects.base.linear_modes import logarithmic_modes, modes_at_rest, modes_form, run_modes
from fomrc_core.effects.base.step_form import Fields, Number, StateField, StepForm

_N_PLAYS = 12  # of the switching part: twice as many change it by less than a hundredth
_REACHES = (1.0, 0.6, 0.35)  # offered, shares of the largest displacement
_FIRST = 1e-4  # of the onset: the shortest time in which elements creep more


def _creep_by_source(s: Fields, k: Fields, c: Fields, value: float, drive_v: float) -> Number:
    # ``run_modes`` of the displacement times its size, and of what it and the elements have switched
    switched = 0.0
    for j in range(len(c.thresholds_um)):
        s.plays[j] = min(max(s.plays[j], value - c.thresholds_um[j]), value + c.thresholds_um[j])
        switched = switched + s.plays[j]
    source = c.per_um * value * abs(value) + c.switched * (switched / len(c.thresholds_um))
    for j in range(len(c.thresholds_v)):
        s.elements[j] = min(max(s.elements[j], drive_v - c.thresholds_v[j]), drive_v + c.thresholds_v[j])
        source = source + c.weights[j] * s.elements[j]
    total = value + c.through * source
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
    it begins at; or what the model's own elements have switched, each play of threshold r by elements_per_decade
    (r / reach_v)^steepness of itself: the wider, the higher the barrier. Elements creep more by the law by which they
    creep, with its order alpha by ((t / onset_s)^alpha - 1) / (alpha ln 10), which is the logarithm where alpha is
    zero: their weights are what they are at the onset, and less before it.
    """

    name: ClassVar[str] = "amplitude_dependent_creep"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 4.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("per_decade_per_um", "1/um", -1e9, 1e9, description="growth in each decade of time, per um moved"),
        Parameter("onset_s", "s", 1e-12, 1e9, is_log=True, description="time after a step from which it grows so"),
        Parameter("switched_per_decade", "1", -1e3, 1e3, description="growth of what has switched in each decade"),
        Parameter("reach_um", "um", 1e-9, 1e9, is_log=True, description="largest threshold of what switches"),
        Parameter("elements_per_decade", "1", -1e3, 1e3, description="growth of an element as wide as reach_v"),
        Parameter("steepness", "1", 0.0, 4.0, description="power of the threshold by which wider elements grow more"),
        Parameter("reach_v", "V", 1e-9, 1e9, is_log=True, description="threshold of the element that grows so"),
        Parameter("creep_order", "1", 0.0, 0.5, description="order of the law of growth, 0 for the logarithm"),
        Parameter("thresholds_v", "V", 0.0, 1e9, is_list=True, description="half widths of the elements' plays"),
        Parameter("weights_um_per_v", "um/V", -1e9, 1e9, is_list=True, description="their weights"),
    )
    main_parameter: ClassVar[str] = "per_decade_per_um"
    linear_parameters: ClassVar[tuple[str, ...]] = ("per_decade_per_um", "switched_per_decade", "elements_per_decade")
    # drive and elements hide when it begins: left to a fit it goes to any time shorter than a sample
    held_parameters: ClassVar[tuple[str, ...]] = ("onset_s", "reach_v", "creep_order")
    meaning: ClassVar[str] = "Strong fields move domains that weak ones leave: large steps creep by more per cent."
    signature: ClassVar[str] = "after large steps the residual creeps on, after small ones it creeps back"
    experiment: ClassVar[str] = "steps of several sizes from the same level, each held for two decades of time"
    inverse_note: ClassVar[str] = "not inverted: creep in proportion alone is undone"
    bends_to_much: ClassVar[bool] = True
    slope_depends_on_input: ClassVar[bool] = True

    per_decade_per_um: float
    onset_s: float
    switched_per_decade: float = 0.0
    reach_um: float = 1.0
    elements_per_decade: float = 0.0
    steepness: float = 1.0
    reach_v: float = 1.0
    creep_order: float = 0.0
    thresholds_v: tuple[float, ...] = ()
    weights_um_per_v: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_alike("thresholds_v", "weights_um_per_v")

    @property
    def follows_elements(self) -> bool:
        """Whether what the elements have switched creeps."""
        return self.elements_per_decade != 0.0

    def beside_elements(self, thresholds_v: Array, weights_um_per_v: Array, creep_order: float) -> Effect:
        """Return the effect of these elements."""
        return replace(
            self,
            creep_order=min(creep_order, self.parameter("creep_order").upper),
            thresholds_v=tuple(float(threshold) for threshold in thresholds_v),
            weights_um_per_v=tuple(float(weight) for weight in weights_um_per_v),
        )

    def free_names(self) -> tuple[str, ...]:
        """Return the size of what there is, of what switches its reach, and of elements how much more wide ones do."""
        absent = set()
        if self.switched_per_decade == 0.0:
            absent.add("reach_um")
        if self.elements_per_decade == 0.0:
            absent.add("steepness")
        return tuple(name for name in super().free_names() if name not in absent)

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether wider motion creeps more: less is a correction of the creep order, and no cause."""
        return any(getattr(self, name) > 0.0 for name in self.linear_parameters)

    def _modes(self) -> tuple[Array, Array, float]:
        """Return rates [1/s] and gains of the growth in each decade, and what it is at once.

        The power of time is the integral of the logarithm's modes, each with its rate times its beginning to minus the
        order, over Gamma(1 - order): Frullani's integral with another power of the rate.
        """
        if not self.follows_elements:
            rates, gains = logarithmic_modes(self.onset_s)
            return rates, gains / math.log(10.0), 0.0
        first_s, order = _FIRST * self.onset_s, self.creep_order
        rates, gains = logarithmic_modes(first_s)
        slower = _FIRST**order * (rates * first_s) ** -order / math.gamma(1.0 - order)
        until_onset = math.log1p(1.0 / _FIRST)
        at_once = math.expm1(order * until_onset) / order if order > 0.0 else until_onset
        return rates, gains * slower / math.log(10.0), -(_FIRST**order) * at_once / math.log(10.0)

    def initial_state(self) -> Array:
        """Return (source, then each mode) [um] of the step before, then plays of displacement and elements, at rest."""
        return np.concatenate((modes_at_rest(self._modes()[0].size), self._plays_of_displacement(), self._elements()))

    def carried_state(self, old: Array) -> Array:
        """Return modes and plays where those of another left them, with thresholds and weights of its own."""
        own = self.initial_state()
        if old.shape != own.shape:
            return own
        blocks = (self._plays_of_displacement(), self._elements())
        ends = np.cumsum([own.size - sum(block.size for block in blocks), blocks[0].size])
        modes, *plays = np.split(old, ends)
        return np.concatenate((modes, *(with_plays_of(b, of) for b, of in zip(blocks, plays, strict=True))))

    def _plays_of_displacement(self) -> Array:
        """Return the packed plays of the displacement, as many for each threshold up to the reach (Rayleigh)."""
        thresholds_um = self.reach_um * np.arange(1, _N_PLAYS + 1) / _N_PLAYS
        return plain_block(thresholds_um, np.full(_N_PLAYS, self.switched_per_decade / _N_PLAYS))

    def _elements(self) -> Array:
        """Return the packed plays of the drive, each weighted by how much more it creeps."""
        thresholds_v = np.array(self.thresholds_v)
        return plain_block(thresholds_v, np.array(self.weights_um_per_v) * self._growths(thresholds_v))

    def _crept(self, state: Array, source: Array, steps_s: Array) -> Array:
        out = np.empty(source.size)
        run_modes(state, *self._modes(), source, steps_s, out)
        return out

    def _growths(self, thresholds_v: Array) -> Array:
        """Return by what share elements of these thresholds [V] grow in each decade, of their shape."""
        return np.asarray(self.elements_per_decade * (thresholds_v / self.reach_v) ** self.steepness)

    def _source(self, plays: Array, values: Array, drive_v: Array | None) -> Array:
        """Return what creeps beyond proportion, times its share in each decade [um]; the plays move on."""
        source = self.per_decade_per_um * values * np.abs(values)
        switched = np.empty(values.size)
        n_own = self._plays_of_displacement().size
        if self.switched_per_decade != 0.0:
            run_knees(plays[:n_own], values, switched)
            source = source + switched
        if self.elements_per_decade != 0.0 and drive_v is not None:
            run_knees(plays[n_own:], drive_v, switched)
            source = source + switched
        return np.asarray(source)

    def undo_known(self, wanted: Array, course: Course) -> Array:
        """Return what is wanted: what creep adds beyond its proportion is small, and found by asking again."""
        return wanted

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement that has crept [um], shape (n_samples,)."""
        n_modes = modes_at_rest(self._modes()[0].size).size
        source = self._source(state[n_modes:], values, covariate)
        return np.asarray(values + self._crept(state[:n_modes], source, steps_s))

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes, and the creep of each times twice the displacement's size; what switches is left out."""
        if values is None or self.per_decade_per_um == 0.0:
            return changes
        squares = (2.0 * self.per_decade_per_um * np.abs(values))[:, None] * changes
        return changes + through_modes(*self._modes(), squares, steps_s)

    def of_plays(self, thresholds_v: Array, plays_v: Array, steps_s: Array) -> Array:
        """Return the creep of each play, as much as its threshold asks for."""
        return through_modes(*self._modes(), self._growths(thresholds_v) * plays_v, steps_s)

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        form = modes_form(*self._modes(), is_inverted=False)
        thresholds_um = tuple(self.reach_um * (j + 1) / _N_PLAYS for j in range(_N_PLAYS))
        # a list of C is of one entry at least: without elements of one that adds nothing
        thresholds_v = self.thresholds_v or (0.0,)
        weights = np.array(self.weights_um_per_v or (0.0,)) * self._growths(np.array(thresholds_v))
        return replace(
            form,
            constants=(
                *form.constants,
                ("per_um", self.per_decade_per_um),
                ("switched", self.switched_per_decade),
                ("thresholds_um", thresholds_um),
                ("thresholds_v", thresholds_v),
                ("weights", tuple(weights.tolist())),
            ),
            state=(
                *form.state,
                StateField("plays", (0.0,) * _N_PLAYS, is_array=True, comment="of the displacement"),
                StateField("elements", (0.0,) * weights.size, is_array=True, comment="of the drive [V]"),
            ),
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
        trials = [{**size, "onset_s": onset} for size in sizes for onset in onsets_s]
        reach_v = max(evidence.largest_v, -evidence.smallest_v)
        # counted from the middle of the times there are, so that the elements' weights stay where they are
        middle_s = math.sqrt(step_s * evidence.duration_s)
        of_elements = {"per_decade_per_um": 0.0, "elements_per_decade": 1e-2, "reach_v": reach_v}
        trials.append({**of_elements, "onset_s": middle_s})
        return cls.proposed(trials)

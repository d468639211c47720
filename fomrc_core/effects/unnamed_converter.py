"""What no cause explains and what comes back with the voltage: teeth and sines of the command, and no name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compute.compiled import compiled
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.step_form import Fields, Number, StepForm
from fomrc_core.effects.base.term_scales import TermScales

_STEEPEST = 0.5  # slope that the terms may have together, against 1, where the inverse is to be sure
_N_TURNS = 60  # of the inverse, each of which halves the error at least
_N_HARMONICS = 3  # offered of sines
TOOTH, SINE = 0.0, 1.0  # shapes of terms


@dataclass(frozen=True)
class UnnamedConverter(Effect):
    """Drive plus a sum of terms of it at the samples, each a weight times a tooth or a sine of u = v / period + turn.

    A tooth is u less the nearest whole number, a sine sin(2 pi u). What makes a voltage of levels errs by teeth where
    these are even, and whatever else repeats from level to level, or from one group of them to the next, is a sum of
    sines (Fourier). Chosen and sized by ``diagnosis.unnamed_extension``; never a cause.
    """

    name: ClassVar[str] = "unnamed_converter"
    is_named: ClassVar[bool] = False
    stage: ClassVar[Stage] = Stage.SAMPLED_DRIVE
    order: ClassVar[float] = 1000.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("weights_v", "V", -1e9, 1e9, is_list=True, description="of each term"),
        Parameter("periods_v", "V", 1e-12, 1e9, is_list=True, description="of each term"),
        Parameter("turns", "1", 0.0, 1.0, is_list=True, description="phase of each term, in periods"),
        Parameter("shapes", "1", 0.0, 1.0, is_list=True, description="0: a tooth, 1: a sine"),
    )
    main_parameter: ClassVar[str] = "weights_v"
    linear_parameters: ClassVar[tuple[str, ...]] = ("weights_v",)
    meaning: ClassVar[str] = (
        "The command comes out with an error that repeats, and not as any cause in the library does."
    )
    signature: ClassVar[str] = "what is left comes back with a period of the commanded voltage, and no cause follows it"
    experiment: ClassVar[str] = "a triangle so slow that many samples fall on each period"
    inverse_note: ClassVar[str] = "inverted where its terms together are surely less steep than the voltage"

    weights_v: tuple[float, ...]
    periods_v: tuple[float, ...]
    turns: tuple[float, ...]
    shapes: tuple[float, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_terms("periods_v", "turns", "shapes")

    @property
    def can_invert(self) -> bool:  # type: ignore[override]  # of an instance: it depends on the weights
        """Return whether the terms are less steep than the voltage itself, wherever it stands; a tooth jumps."""
        if any(w for w, shape in zip(self.weights_v, self.shapes, strict=True) if shape == TOOTH):
            return False
        steepness = sum(2.0 * math.pi * abs(w) / p for w, p in zip(self.weights_v, self.periods_v, strict=True))
        return steepness <= _STEEPEST

    def words(self) -> str:
        """Return what the terms depend on, in words, the weightiest first."""
        found: dict[str, float] = {}
        for weight, period in zip(self.weights_v, self.periods_v, strict=True):
            text = f"the commanded voltage with a period of {period:.4g} V"
            found[text] = found.get(text, 0.0) + abs(weight)
        return "; on ".join(sorted(found, key=lambda text: -found[text]))

    @classmethod
    def offered(cls, scales: TermScales) -> UnnamedConverter | None:
        """Return teeth and sines of the period that is seen, and sines of parts of it; None where none is."""
        if scales.drive_period_v is None:
            return None
        # levels at whole periods of the voltage, to which it is rounded or down to which it is cut
        terms = [(scales.drive_period_v, turn, TOOTH) for turn in (0.0, 0.5)]
        terms += [(scales.drive_period_v / n, turn, SINE) for n in range(1, _N_HARMONICS + 1) for turn in (0.0, 0.25)]
        periods, turns, shapes = zip(*terms, strict=True)
        return cls(tuple(1.0 for _ in terms), periods, turns, shapes)

    @property
    def n_terms(self) -> int:
        """Number of terms."""
        return len(self.weights_v)

    def weight_of_span(self) -> float:
        """Return the shortest period [V]: no more is known of how far the drive goes."""
        return min(self.periods_v)

    def with_terms(self, chosen: Sequence[int], weights_um: Array) -> UnnamedConverter:
        """Return the effect of some of the terms, with these weights [V]."""
        lists = (self.periods_v, self.turns, self.shapes)
        return type(self)(tuple(float(w) for w in weights_um), *(tuple(own[k] for k in chosen) for own in lists))

    def terms(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return each term without its weight [1], shape (n_samples, n_terms)."""
        turned = values[:, None] / np.array(self.periods_v) + np.array(self.turns)
        tooth = np.array(self.shapes) == TOOTH
        return np.asarray(np.where(tooth, turned - np.rint(turned), np.sin(2.0 * np.pi * turned)))

    def _table(self) -> Array:
        return np.array([self.weights_v, self.periods_v, self.turns, self.shapes])

    def initial_state(self) -> Array:
        """Return an empty state: the terms have no memory."""
        return np.zeros(0)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the drive with the terms [V], shape (n_samples,)."""
        out = np.empty(values.size)
        _run_periodic(self._table(), values, out)
        return out

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the drive [V] before this effect, to rounding where ``can_invert``."""
        out = np.empty(values.size)
        _undo_periodic(self._table(), values, out)
        return out

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=tuple((name, getattr(self, name)) for name in ("weights_v", "periods_v", "turns", "shapes")),
            forward=add_periodic,
            inverse=take_periodic,
            helpers=(periodic,),
            jumps=("forward",) if TOOTH in self.shapes else (),
        )


def periodic(shape: float, u: float) -> float:
    """Return one term: u less the nearest whole number, or the sine of u turns."""
    if shape < 0.5:
        return u - round(u)
    return math.sin(6.283185307179586 * u)


def add_periodic(c: Fields, value: float) -> Number:
    """Return the drive with the terms of it [V]."""
    total = 0.0
    for j in range(len(c.weights_v)):
        total = total + c.weights_v[j] * periodic(c.shapes[j], value / c.periods_v[j] + c.turns[j])
    return value + total


def take_periodic(c: Fields, value: float) -> Number:
    """Return the drive whose terms make it this one [V]."""
    found = value
    # a contraction, for the terms are less steep than the drive
    for _ in range(60):
        total = 0.0
        for j in range(len(c.weights_v)):
            total = total + c.weights_v[j] * periodic(c.shapes[j], found / c.periods_v[j] + c.turns[j])
        found = value - total
    return found


_periodic = compiled(periodic)


@compiled
def _sum_of_terms(table: Array, value: float) -> float:
    total = 0.0
    for j in range(table.shape[1]):
        total += table[0, j] * _periodic(table[3, j], value / table[1, j] + table[2, j])
    return total


@compiled
def _run_periodic(table: Array, values: Array, out: Array) -> None:
    for k in range(values.size):
        out[k] = values[k] + _sum_of_terms(table, values[k])


@compiled
def _undo_periodic(table: Array, values: Array, out: Array) -> None:
    for k in range(values.size):
        found = values[k]
        for _ in range(_N_TURNS):
            found = values[k] - _sum_of_terms(table, found)
        out[k] = found

"""What no cause explains and what the displacement alone says: a few kinks and sines of it, and no name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.static_kernels import (
    STATIC_REACH,
    add_static_terms,
    invert_static,
    static_columns,
    static_term,
    take_static_terms,
)
from fomrc_core.effects.base.step_form import StepForm
from fomrc_core.effects.base.term_scales import TermScales

_STEEPEST = 0.5  # slope that the terms may have together, against 1, where the inverse is to be sure
_N_KNOTS = 31  # offered, evenly over twice the span
# Offered in a span: half a turn over all of it at least, and steps that leave no period between two of them unseen.
_FEWEST_CYCLES, _MOST_CYCLES, _STEP_CYCLES = 0.5, 16.0, 0.25


@dataclass(frozen=True)
class UnnamedStatic(Effect):
    """Displacement plus a sum of terms, each a weight times max(x - knot, 0), or sin(2 pi (cycles x + turn)).

    x is the displacement as a share of the span; with no cycles a term is a kink. Kinks are the terms of multivariate
    adaptive regression splines (Friedman, Ann. Statist. 19 (1991) 1-67). Chosen and sized by
    ``diagnosis.unnamed_extension``; never a cause.
    """

    name: ClassVar[str] = "unnamed_static"
    is_named: ClassVar[bool] = False
    stage: ClassVar[Stage] = Stage.SENSED
    order: ClassVar[float] = 1010.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("weights_um", "um", -1e9, 1e9, is_list=True, description="of each term"),
        Parameter("knots", "1", -10.0, 10.0, is_list=True, description="where each term's kink is, share of the span"),
        Parameter("cycles", "1", 0.0, 1e6, is_list=True, description="of each term in a span; 0 for a kink"),
        Parameter("turns", "1", 0.0, 1.0, is_list=True, description="phase of each term's sine, in turns"),
        Parameter("span_um", "um", 1e-9, 1e9, is_log=True, description="largest displacement learned from"),
    )
    main_parameter: ClassVar[str] = "weights_um"
    linear_parameters: ClassVar[tuple[str, ...]] = ("weights_um",)
    slope_depends_on_input: ClassVar[bool] = True
    meaning: ClassVar[str] = "The reading errs with the place, and not as any cause in the library does."
    signature: ClassVar[str] = "what is left is a curve over the displacement, and no cause follows it"
    experiment: ClassVar[str] = "the same drive about another place of the stroke"
    inverse_note: ClassVar[str] = "inverted where its terms together are surely less steep than the displacement"

    weights_um: tuple[float, ...]
    knots: tuple[float, ...]
    cycles: tuple[float, ...]
    turns: tuple[float, ...]
    span_um: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_terms("knots", "cycles", "turns")

    @property
    def can_invert(self) -> bool:  # type: ignore[override]  # of an instance: it depends on the weights
        """Return whether the terms are less steep than the displacement itself, wherever it stands."""
        return self.steepness() <= _STEEPEST

    def steepness(self) -> float:
        """Return a bound on the slope of all terms together, relative to that of the displacement [1]."""
        total = sum(
            abs(w) * (2.0 * math.pi * c if c else 1.0) for w, c in zip(self.weights_um, self.cycles, strict=True)
        )
        return total / self.span_um

    def weight_of_span(self) -> float:
        """Return the largest displacement learned from [um]."""
        return self.span_um

    def words(self) -> str:
        """Return what the terms depend on, in words, the weightiest first."""
        found: dict[str, float] = {}
        for weight, knot, cycles in zip(self.weights_um, self.knots, self.cycles, strict=True):
            text = f"a kink of the displacement at {knot * self.span_um:.4g} um"
            if cycles:
                text = f"the displacement with a period of {self.span_um / cycles:.4g} um"
            found[text] = found.get(text, 0.0) + abs(weight)
        return "; on ".join(sorted(found, key=lambda text: -found[text]))

    @classmethod
    def offered(cls, scales: TermScales) -> UnnamedStatic:
        """Return kinks over the whole range, and sines of many periods."""
        terms = [(float(k), 0.0, 0.0) for k in np.linspace(-1.0, 1.0, _N_KNOTS + 2)[1:-1]]
        counts = np.arange(_FEWEST_CYCLES, _MOST_CYCLES + 0.5 * _STEP_CYCLES, _STEP_CYCLES)
        terms += [(0.0, float(count), turn) for count in counts for turn in (0.0, 0.25)]
        knots, cycles, turns = zip(*terms, strict=True)
        return cls(tuple(1.0 for _ in terms), knots, cycles, turns, scales.span_um)

    @property
    def n_terms(self) -> int:
        """Number of terms."""
        return len(self.weights_um)

    def with_terms(self, chosen: Sequence[int], weights_um: Array) -> UnnamedStatic:
        """Return the effect of some of the terms, with these weights [um]."""
        knots, cycles, turns = (tuple(own[k] for k in chosen) for own in (self.knots, self.cycles, self.turns))
        return type(self)(tuple(float(w) for w in weights_um), knots, cycles, turns, self.span_um)

    def terms(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return each term without its weight [1], shape (n_samples, n_terms)."""
        columns = np.empty((values.size, self.n_terms))
        static_columns(self._table(), values / self.span_um, columns, np.empty(values.size))
        return columns

    def _table(self) -> Array:
        return np.array([self.weights_um, self.knots, self.cycles, self.turns])

    def initial_state(self) -> Array:
        """Return an empty state: the terms have no memory."""
        return np.zeros(0)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement with the terms [um], shape (n_samples,)."""
        total = np.empty(values.size)
        static_columns(self._table(), values / self.span_um, np.empty((0, self.n_terms)), total)
        return np.asarray(values + total)

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement [um] before this effect, to rounding where ``can_invert``."""
        out = np.empty(values.size)
        invert_static(self._table(), self.span_um, np.ascontiguousarray(values), out)
        return out

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        lists = ("weights_um", "knots", "cycles", "turns", "span_um")
        return StepForm(
            constants=(*((name, getattr(self, name)) for name in lists), ("reach", STATIC_REACH)),
            forward=add_static_terms,
            inverse=take_static_terms,
            helpers=(static_term,),
        )

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes times the slope where the displacement stands."""
        if values is None:
            return changes
        x = values / self.span_um
        slope = np.ones(x.size)
        for weight, knot, cycles, turn in zip(*self._table(), strict=True):
            around = 2.0 * math.pi * cycles
            own = around * np.cos(around * x + 2.0 * math.pi * turn) if cycles else x > knot
            slope += weight / self.span_um * np.where(np.abs(x) < STATIC_REACH, own, 0.0)
        return np.asarray(changes * slope[:, None])

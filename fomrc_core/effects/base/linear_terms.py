"""Sums of linear terms of what a stage carries: what it remembers, with time constants, and what swings in it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compute.arrays import Array, ComplexArray
from fomrc_core.effects.base.effect import Effect, Parameter, Stage
from fomrc_core.effects.base.linear_columns import through_pairs
from fomrc_core.effects.base.linear_modes import pairs_at_rest, run_pairs
from fomrc_core.effects.base.pairs_beside import pairs_form, undo_pairs
from fomrc_core.effects.base.step_form import StepForm

LATE, NOT_YET, SWING = 0.0, 1.0, 2.0  # kinds of terms, see ``LinearTerms``
_N_PARTS_SWINGING = 20  # of each step, as for a resonance that has a name (second_order.py)
_FAR, _N_FREQUENCIES = 100.0, 2000  # beyond the slowest and the fastest mode, and between, where an inverse is asked
_ROUNDING = 1e-9  # of an answer

PARAMETERS = (
    Parameter("weights", "1", -1e9, 1e9, is_list=True, description="of each term"),
    Parameter("decays_per_s", "1/s", 1e-12, 1e12, is_list=True, description="how fast each term's mode decays"),
    Parameter("swings_per_s", "1/s", 0.0, 1e12, is_list=True, description="angular frequency of its swing; 0 for none"),
    Parameter("kinds", "1", 0.0, 2.0, is_list=True, description="0: the mode, 1: mode less input, 2: its quadrature"),
)


@dataclass(frozen=True)
class LinearTerms(Effect):
    """Input plus a sum of terms of it, each a weight times what a mode makes of the input.

    The mode is z, dz/dt = (decay + i swing) (v - z), of the input v: its real part (kind 0, what is held of the past),
    its real part less the input (kind 1, what has not come through yet), its imaginary part (kind 2). Such modes beside
    each other are any linear memory of finite order; exact for an input linear between samples. Their decays and swings
    are fitted beside their weights, as poles are in vector fitting (Gustavsen and Semlyen, IEEE Trans. Power Delivery
    14 (1999) 1052-1061). Chosen and sized by ``diagnosis.unnamed_extension``; never a cause.
    """

    is_named: ClassVar[bool] = False
    order: ClassVar[float] = 1000.0
    parameters: ClassVar[tuple[Parameter, ...]] = PARAMETERS
    main_parameter: ClassVar[str] = "weights"
    linear_parameters: ClassVar[tuple[str, ...]] = ("weights",)
    needs_substeps: ClassVar[bool] = True
    rings: ClassVar[bool] = True
    signal_words: ClassVar[str]  # what the input is called

    weights: tuple[float, ...]
    decays_per_s: tuple[float, ...]
    swings_per_s: tuple[float, ...]
    kinds: tuple[float, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_terms("decays_per_s", "swings_per_s", "kinds")

    # --- the terms

    @property
    def n_terms(self) -> int:
        """Number of terms."""
        return len(self.weights)

    def with_terms(self, chosen: Sequence[int], weights_um: Array) -> LinearTerms:
        """Return the effect of some of the terms, with these weights [1]."""
        lists = (self.decays_per_s, self.swings_per_s, self.kinds)
        return type(self)(tuple(float(w) for w in weights_um), *(tuple(own[k] for k in chosen) for own in lists))

    def and_modes_of(self, other: LinearTerms) -> LinearTerms:
        """Return the effect with terms of the modes of another, of weight one, beside its own."""
        added = [
            (decay, swing, kind)
            for decay, swing in other._distinct()
            for kind in ((NOT_YET, SWING) if swing else (NOT_YET, LATE))
        ]
        decays, swings, kinds = zip(*added, strict=True)
        ones = tuple(1.0 for _ in added)
        return type(self)(
            self.weights + ones, self.decays_per_s + decays, self.swings_per_s + swings, self.kinds + kinds
        )

    def memory(self) -> Array:
        """Return logarithms of decay and, where it has one, swing of each mode of its own, shape (n_numbers,)."""
        return np.log([rate for mode in self._distinct() for rate in mode if rate > 0.0])

    def with_memory(self, logs: Array) -> LinearTerms:
        """Return the effect with modes of these logarithms, in the order of ``memory``."""
        rates = iter(np.exp(logs).tolist())
        new = {mode: tuple(next(rates) if rate > 0.0 else 0.0 for rate in mode) for mode in self._distinct()}
        decays, swings = zip(*(new[mode] for mode in self._of_terms()), strict=True)
        return type(self)(self.weights, decays, swings, self.kinds)

    def _of_terms(self) -> list[tuple[float, float]]:
        return list(zip(self.decays_per_s, self.swings_per_s, strict=True))

    def _distinct(self) -> list[tuple[float, float]]:
        return list(dict.fromkeys(self._of_terms()))

    def words(self) -> str:
        """Return what the terms depend on, in words, the weightiest first."""
        found: dict[str, float] = {}
        for weight, (decay, swing) in zip(self.weights, self._of_terms(), strict=True):
            text = f"{self.signal_words} in the last {1.0 / decay:.3g} s"
            if swing:
                text = f"swings of {self.signal_words} at {swing / (2.0 * math.pi):.4g} Hz"
            found[text] = found.get(text, 0.0) + abs(weight)
        return "; on ".join(sorted(found, key=lambda text: -found[text]))

    def terms(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return each term without its weight, in the unit of the values, shape (n_samples, n_terms)."""
        columns = np.empty((values.size, self.n_terms), order="F")
        poles, _ = self._modes()
        before = state[0]
        for k, kind in enumerate(self.kinds):
            own = np.concatenate(([before], state[1 + 2 * k : 3 + 2 * k]))
            gain = np.array([[0.0, -1.0] if kind == SWING else [1.0, 0.0]])
            column = np.empty(values.size)
            run_pairs(own, poles[k : k + 1], gain, values, steps_s, column)
            columns[:, k] = column - values if kind == NOT_YET else column
            state[0], state[1 + 2 * k : 3 + 2 * k] = own[0], own[1:]
        return columns

    def _modes(self) -> tuple[Array, Array]:
        """Return poles [1/s] and gains of the modes, shape (n_terms, 2) each."""
        weights, kinds = np.array(self.weights), np.array(self.kinds)
        poles = np.column_stack((-np.array(self.decays_per_s), np.array(self.swings_per_s)))
        is_swing = kinds == SWING
        return poles, np.column_stack((np.where(is_swing, 0.0, weights), np.where(is_swing, -weights, 0.0)))

    @property
    def through(self) -> float:
        """Share of the input that comes out at once, beside the modes [1]."""
        return 1.0 - sum(w for w, kind in zip(self.weights, self.kinds, strict=True) if kind == NOT_YET)

    # --- in the chain

    @property
    def can_invert(self) -> bool:  # type: ignore[override]  # of an instance: it depends on the weights
        """Return whether part comes through at once, and nothing is turned by more than a quarter of a turn.

        Between samples the input is a line: what is sampled answers at each frequency with a mean, its weights squares
        of a sinc, of what the effect answers there and at the frequencies that look alike. So a real part that is
        nowhere negative stays so at any sample rate, and the inverse does not grow.
        """
        if not self.through > 0.0:
            return False
        sizes = np.hypot(self.decays_per_s, self.swings_per_s) / (2.0 * np.pi)
        frequency_hz = np.geomspace(np.min(sizes) / _FAR, np.max(sizes) * _FAR, _N_FREQUENCIES)
        return bool(np.min(self.response(frequency_hz).real) >= -_ROUNDING)

    def least_parts(self, effects: tuple[Effect, ...]) -> int:
        """Return many parts where it swings, also while the drive rests: elements follow what it swings by."""
        return _N_PARTS_SWINGING if any(self.swings_per_s) and not self.is_null() else 1

    def parts_of_turn(self, effects: tuple[Effect, ...], step_s: float, turn: float) -> int:
        """Return as many parts as let it turn by little in each."""
        n_parts = math.ceil(max(self.swings_per_s, default=0.0) * step_s / turn)
        return max(1, min(n_parts, self.least_parts(effects)))

    def initial_state(self) -> Array:
        """Return (input of the step before, then both parts of each mode), at rest."""
        return pairs_at_rest(self.n_terms)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the values with the terms, in their unit, shape (n_samples,)."""
        out = np.empty(values.size)
        poles, gains = self._modes()
        acting = np.any(gains != 0.0, axis=1)
        if np.all(acting):
            run_pairs(state, poles, gains, values, steps_s, out)
        else:
            # of many terms offered one has a weight at a time: what the others would hold moves nothing
            own = np.flatnonzero(np.concatenate(([True], np.repeat(acting, 2))))
            moved = state[own]
            run_pairs(moved, poles[acting], gains[acting], values, steps_s, out)
            state[own] = moved
        return out + self.through * values

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes with the terms, where they follow displacement, (n_samples, n_changes)."""
        if self.stage is not Stage.MECHANICAL:
            return changes
        return through_pairs(*self._modes(), self.through, changes, steps_s)

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the values before this effect, to rounding where ``can_invert``."""
        out = np.empty(values.size)
        undo_pairs(state, *self._modes(), self.through, values, steps_s, out)
        return out

    def response(self, frequency_hz: Array) -> ComplexArray:
        """Return the complex gain [1] at frequencies [Hz]."""
        s = 2j * np.pi * np.asarray(frequency_hz)
        total = np.full(s.shape, self.through, dtype=np.complex128)
        for (x, y), (a, b) in zip(*self._modes(), strict=True):
            for sign in (1.0, -1.0):
                pole = x + sign * 1j * y
                total += 0.5 * (a + sign * 1j * b) * pole / (pole - s)
        return total

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return pairs_form(*self._modes(), self.through, is_inverted=True)


def offered_terms(
    memories_s: Sequence[float], periods_s: Sequence[float], damping_ratios: Sequence[float]
) -> tuple[tuple[float, ...], ...]:
    """Return weights of one, decays and swings [1/s] and kinds of the terms of these memories and swings.

    What is remembered for less than the middle of the memories is told by what has not come through yet, else by what
    is held: an ideal low-pass and an ideal high-pass each are a single term of weight one then.

    Args:
        memories_s: time constants [s], in rising order.
        periods_s: of undamped swings [s].
        damping_ratios: of swings, below 1.
    """
    terms = [(1.0 / tau, 0.0, NOT_YET if 2 * k < len(memories_s) else LATE) for k, tau in enumerate(memories_s)]
    for period in periods_s:
        for damping in damping_ratios:
            omega = 2.0 * math.pi / period
            mode = (damping * omega, math.sqrt(1.0 - damping * damping) * omega)
            terms += [(*mode, NOT_YET), (*mode, SWING)]
    decays, swings, kinds = zip(*terms, strict=True)
    return tuple(1.0 for _ in terms), decays, swings, kinds

"""Terms of a signal beside the displacement, for what no cause explains: of the time, or of a recorded column."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.signal_kernels import (
    LINE_REACH,
    N_CLOCK,
    N_SIGNAL_STATE,
    SIGNAL_REACH,
    add_terms_of_column,
    invert_signal_terms,
    late_after,
    power_of,
    run_signal_terms,
    take_terms_of_column,
)
from fomrc_core.effects.base.step_form import FieldKind, StateField, StepForm, ramp_in_step
from fomrc_core.effects.base.term_scales import TermScales

STEEPEST = 0.5  # slope that terms may have together, against 1, where the inverse is to be sure


def parameters_of(unit: str, lagging: str) -> tuple[Parameter, ...]:
    """Return the parameters of such an effect.

    Args:
        unit: of its signal.
        lagging: what its lags are of, in words.
    """
    return (
        Parameter("weights_um", "um", -1e9, 1e9, is_list=True, description="of each term"),
        Parameter("signal_powers", "1", 0.0, 6.0, is_list=True, description="power of the signal in each term"),
        Parameter("powers", "1", 0.0, 6.0, is_list=True, description="power of the displacement in each term"),
        Parameter("lags_s", "s", 0.0, 1e9, is_list=True, description=f"time constant of {lagging}, 0 for none"),
        Parameter("span_um", "um", 1e-9, 1e9, is_log=True, description="largest displacement learned from"),
        Parameter("signal_zero", unit, -1e12, 1e12, description="the signal where its share is nothing"),
        Parameter("signal_range", unit, 1e-12, 1e12, is_log=True, description="the signal's change to a share of one"),
    )


@dataclass(frozen=True)
class SignalTerms(Effect):
    """Displacement plus terms weight u^signal_power x^power (z - late(z)), u the signal's share, x the displacement's.

    late(z) is the first-order lag of what the effect lags; a lag of zero leaves its factor out. Chosen and sized by
    ``diagnosis.unnamed_extension``, as terms of sparse regression are (Brunton, Proctor and Kutz, PNAS 113 (2016)
    3932-3937); never a cause.
    """

    is_named: ClassVar[bool] = False
    stage: ClassVar[Stage] = Stage.SENSED
    main_parameter: ClassVar[str] = "weights_um"
    linear_parameters: ClassVar[tuple[str, ...]] = ("weights_um",)
    signal_words: ClassVar[str]  # what the signal is called
    lags_displacement: ClassVar[bool] = False  # whether the memory is that of the displacement; else of the signal

    weights_um: tuple[float, ...]
    signal_powers: tuple[float, ...]
    powers: tuple[float, ...]
    lags_s: tuple[float, ...]
    span_um: float
    signal_zero: float
    signal_range: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_terms("signal_powers", "powers", "lags_s")

    # --- the terms

    @classmethod
    def offering(cls, scales: TermScales, terms: Sequence[tuple[float, float, float]], zero: float, half: float) -> Any:
        """Return the effect of all these terms (power of the signal, power, lag [s]), each with weight one."""
        signal_powers, powers, lags_s = zip(*terms, strict=True)
        return cls(tuple(1.0 for _ in terms), signal_powers, powers, lags_s, scales.span_um, zero, half)

    @property
    def n_terms(self) -> int:
        """Number of terms."""
        return len(self.weights_um)

    def with_terms(self, chosen: Sequence[int], weights_um: Array) -> SignalTerms:
        """Return the effect of some of the terms, with these weights [um]."""
        signal_powers, powers, lags_s = (
            tuple(own[k] for k in chosen) for own in (self.signal_powers, self.powers, self.lags_s)
        )
        weights = tuple(float(w) for w in weights_um)
        return type(self)(weights, signal_powers, powers, lags_s, self.span_um, self.signal_zero, self.signal_range)

    def weight_of_span(self) -> float:
        """Return the largest displacement learned from [um]."""
        return self.span_um

    def words(self) -> str:
        """Return what the terms depend on, in words, the weightiest first."""
        found: dict[str, float] = {}
        moved = "the motion of" if self.lags_displacement else f"the change of {self.signal_words} in"
        for weight, signal_power, power, lag in zip(*self._table(), strict=True):
            parts = [f"{moved} the last {lag:.3g} s"] if lag else []
            for what, count in ((self.signal_words, signal_power), ("the displacement", power)):
                if count:
                    parts.append(what + ("" if count == 1.0 else f" to the power {count:.0f}"))
            text = " times ".join(parts)
            found[text] = found.get(text, 0.0) + abs(weight)
        return "; on ".join(sorted(found, key=lambda text: -found[text]))

    def terms(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return each term without its weight [1], shape (n_samples, n_terms); the state moves on."""
        columns = np.zeros((values.size, self.n_terms))
        self._run(state, values, steps_s, covariate, columns)
        return columns

    def _table(self) -> Array:
        return np.array([self.weights_um, self.signal_powers, self.powers, self.lags_s])

    def _signal(self, state: Array, steps_s: Array, covariate: Array | None) -> Array | None:
        """Return the share of the signal at each sample; None where it is not known."""
        return None if covariate is None else (covariate - self.signal_zero) / self.signal_range

    # --- in the chain

    @property
    def can_invert(self) -> bool:  # type: ignore[override]  # of an instance: it depends on the weights
        """Return whether the terms are less steep than the displacement itself, wherever it stands."""
        return self.steepness() <= STEEPEST

    def steepness(self) -> float:
        """Return a bound on the slope of all terms together, relative to that of the displacement [1]."""
        total = 0.0
        for weight, signal_power, power, lag in zip(*self._table(), strict=True):
            of_signal = LINE_REACH if signal_power == 1.0 else SIGNAL_REACH**signal_power
            slope = power * SIGNAL_REACH ** max(power - 1.0, 0.0) * of_signal
            total += abs(weight) * slope * (2.0 * LINE_REACH if lag else 1.0)
        return float(total) / self.span_um

    def initial_state(self) -> Array:
        """Return (elapsed [s], started), and for each term (late share, share before) [1]."""
        return np.zeros(N_CLOCK + N_SIGNAL_STATE * self.n_terms)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement with the terms [um], shape (n_samples,)."""
        total = self._run(state, values, steps_s, covariate, np.zeros((0, self.n_terms)))
        return values if total is None else values + total

    def _run(
        self, state: Array, values: Array, steps_s: Array, covariate: Array | None, columns: Array
    ) -> Array | None:
        signal = self._signal(state, steps_s, covariate)
        if signal is None:
            return None
        total = np.empty(values.size)
        run_signal_terms(
            state, self._table(), self.lags_displacement, signal, values / self.span_um, steps_s, columns, total
        )
        return total

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement [um] before this effect, to rounding where ``can_invert``."""
        signal = self._signal(state, steps_s, covariate)
        if signal is None:
            return values
        out = np.empty(values.size)
        invert_signal_terms(state, self._table(), self.span_um, signal, values, steps_s, out)
        return out

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=self._constants(),
            state=(StateField("started", kind=FieldKind.COUNT, comment="whether there was a sample"), *self._memory()),
            forward=add_terms_of_column,
            inverse=take_terms_of_column,
            helpers=(ramp_in_step, late_after, power_of),
        )

    def _constants(self) -> tuple[tuple[str, float | tuple[float, ...]], ...]:
        names = ("weights_um", "signal_powers", "powers", "lags_s", "span_um", "signal_zero", "signal_range")
        return (*((name, getattr(self, name)) for name in names), ("reach", LINE_REACH))

    def _memory(self) -> tuple[StateField, ...]:
        nothing = (0.0,) * self.n_terms
        return (
            StateField("late", nothing, FieldKind.WIDE, is_array=True, comment="of each term, a share"),
            StateField("before", nothing, is_array=True, comment="share at the step before"),
        )


def column_terms(scales: TermScales) -> list[tuple[float, float, float]]:
    """Return the terms offered of a recorded signal: static ones, what it lags, and products with the displacement."""
    found = [(q, p, 0.0) for q in (1.0, 2.0) for p in (0.0, 1.0, 2.0)]
    return found + [(0.0, p, lag) for p in (0.0, 1.0) for lag in scales.lags_s]

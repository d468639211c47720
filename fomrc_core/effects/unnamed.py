"""What no cause explains: a few terms that follow what is left, and no name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.step_form import FieldKind, StateField, StepForm, lag_ramp
from fomrc_core.effects.base.term_scales import TermScales
from fomrc_core.effects.base.term_slopes import slopes_of_sum
from fomrc_core.effects.base.terms import (
    MOST_PATH,
    N_STATE,
    REACH,
    add_terms,
    factor_of,
    invert_terms,
    prepare_terms,
    remembered,
    run_sum,
    run_terms,
    take_terms,
)

_STEEPEST = 0.5  # slope that the terms may have together, against 1, where the inverse is to be sure
# what a memory says, by its power
_MOTIONS = ("the path gone in", "the motion of", "the size of the motion of", "the cube of the motion of")
_THRESHOLDS = (0.05, 0.2, 0.5)  # offered, shares of the largest displacement


@dataclass(frozen=True)
class Unnamed(Effect):
    """Displacement plus a sum of terms of it, each weight x^power (x - late(x))^lag_power (x - play(x)).

    x is the displacement as a share of the span, late(x) its first-order lag, play(x) its play of the threshold; a lag
    or a threshold of zero leaves its factor out. For a lag_power of zero the factor in the middle is the path that x
    has gone lately, which is forgotten with the lag. Chosen and sized by ``diagnosis.unnamed_extension``, as terms of
    sparse regression are (Brunton, Proctor and Kutz, PNAS 113 (2016) 3932-3937); never a cause.
    """

    name: ClassVar[str] = "unnamed"
    is_named: ClassVar[bool] = False
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 1000.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("weights_um", "um", -1e9, 1e9, is_list=True, description="of each term"),
        Parameter("powers", "1", 0.0, 6.0, is_list=True, description="power of the displacement in each term"),
        Parameter("lags_s", "s", 0.0, 1e9, is_list=True, description="time constant of each term, 0 for none"),
        Parameter("lag_powers", "1", 0.0, 3.0, is_list=True, description="power of what is late; 0 for the path"),
        Parameter("thresholds", "1", 0.0, 10.0, is_list=True, description="of each term's play, share of the span"),
        Parameter("span_um", "um", 1e-9, 1e9, is_log=True, description="largest displacement learned from"),
    )
    main_parameter: ClassVar[str] = "weights_um"
    linear_parameters: ClassVar[tuple[str, ...]] = ("weights_um",)
    slope_depends_on_input: ClassVar[bool] = True
    meaning: ClassVar[str] = (
        "Something acts that no cause in the library is; these terms follow it and explain nothing."
    )
    signature: ClassVar[str] = "what is left follows the drive, and no cause follows it"
    experiment: ClassVar[str] = "a drive that takes apart what the terms depend on"
    inverse_note: ClassVar[str] = "inverted where its terms together are surely less steep than the displacement"

    weights_um: tuple[float, ...]
    powers: tuple[float, ...]
    lags_s: tuple[float, ...]
    lag_powers: tuple[float, ...]
    thresholds: tuple[float, ...]
    span_um: float

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_terms("powers", "lags_s", "lag_powers", "thresholds")

    @property
    def can_invert(self) -> bool:  # type: ignore[override]  # of an instance: it depends on the weights
        """Return whether the terms are less steep than the displacement itself, wherever it stands."""
        return self.steepness() <= _STEEPEST

    def steepness(self) -> float:
        """Return a bound on the slope of all terms together, relative to that of the displacement [1]."""
        total = 0.0
        for weight, power, lag, lag_power, threshold in self._terms():
            # largest value of each factor, and its steepest slope
            x, x_slope = REACH**power, power * REACH ** max(power - 1.0, 0.0)
            late, late_slope = 1.0, 0.0
            if lag and lag_power:
                late, late_slope = (2.0 * REACH) ** lag_power, lag_power * (2.0 * REACH) ** (lag_power - 1.0)
            elif lag:
                late, late_slope = MOST_PATH, 1.0
            stop, stop_slope = (threshold, 1.0) if threshold else (1.0, 0.0)
            slope = x_slope * late * stop + x * late_slope * stop + x * late * stop_slope
            total += abs(weight) * slope
        return total / self.span_um

    def weight_of_span(self) -> float:
        """Return the largest displacement learned from [um]."""
        return self.span_um

    def words(self) -> str:
        """Return what the terms depend on, in words, the weightiest first."""
        found: dict[str, float] = {}
        for weight, power, lag, lag_power, threshold in self._terms():
            parts = []
            if threshold:
                parts.append(f"the place in loops of {100.0 * threshold:.3g} % of the stroke")
            if lag:
                what = _MOTIONS[int(lag_power)]
                parts.append(f"{what} the last {lag:.3g} s")
            if power:
                parts.append("the displacement" + ("" if power == 1.0 else f" to the power {power:.0f}"))
            text = " times ".join(parts)
            found[text] = found.get(text, 0.0) + abs(weight)
        ordered = sorted(found, key=lambda text: -found[text])
        return "; on ".join(ordered)

    @classmethod
    def offered(cls, scales: TermScales) -> Unnamed:
        """Return static terms, motion of the last while, place in loops, and products of them."""
        lags = scales.lags_s
        terms = [(p, 0.0, 1.0, 0.0) for p in (2.0, 3.0, 4.0)]
        terms += [(p, lag, q, 0.0) for p in (0.0, 1.0, 2.0) for lag in lags for q in (1.0, 2.0)]
        terms += [(0.0, lag, 3.0, 0.0) for lag in lags]
        terms += [(p, 0.0, 1.0, r) for p in (0.0, 1.0, 2.0) for r in _THRESHOLDS]
        terms += [(p, lag, 0.0, 0.0) for p in (0.0, 1.0, 2.0) for lag in lags]
        terms += [(0.0, lag, q, r) for lag in lags for q in (0.0, 1.0) for r in _THRESHOLDS]
        powers, lags_s, lag_powers, thresholds = zip(*terms, strict=True)
        return cls(tuple(1.0 for _ in terms), powers, lags_s, lag_powers, thresholds, scales.span_um)

    @property
    def n_terms(self) -> int:
        """Number of terms."""
        return len(self.weights_um)

    def with_terms(self, chosen: Sequence[int], weights_um: Array) -> Unnamed:
        """Return the effect of some of the terms, with these weights [um]."""
        lists = (self.powers, self.lags_s, self.lag_powers, self.thresholds)
        powers, lags_s, lag_powers, thresholds = (tuple(own[k] for k in chosen) for own in lists)
        weights = tuple(float(w) for w in weights_um)
        return type(self)(weights, powers, lags_s, lag_powers, thresholds, self.span_um)

    def _terms(self) -> list[tuple[float, float, float, float, float]]:
        return list(zip(self.weights_um, self.powers, self.lags_s, self.lag_powers, self.thresholds, strict=True))

    def _arrays(self) -> tuple[Array, Array, Array, Array, Array]:
        weights, powers, lags, lag_powers, thresholds = (
            np.array(v) for v in (self.weights_um, self.powers, self.lags_s, self.lag_powers, self.thresholds)
        )
        return weights, powers, lags, lag_powers, thresholds

    def initial_state(self) -> Array:
        """Return for each term (late share, share before, play) [1], at rest."""
        return np.zeros(N_STATE * len(self.weights_um))

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement with the terms [um], shape (n_samples,)."""
        out = np.empty(values.size)
        run_sum(state, *self._arrays(), self.span_um, values, steps_s, out)
        return out

    def terms(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return each term without its weight [1], shape (n_samples, n_terms); the state moves on."""
        out = np.empty((values.size, len(self.weights_um)))
        _, powers, lags, lag_powers, thresholds = self._arrays()
        run_terms(state, powers, lags, lag_powers, thresholds, values / self.span_um, steps_s, out)
        return out

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        lists = ("weights_um", "powers", "lags_s", "lag_powers", "thresholds")
        nothing = (0.0,) * self.n_terms
        return StepForm(
            constants=(
                *((name, getattr(self, name)) for name in lists),
                ("span_um", self.span_um),
                ("reach", REACH),
            ),
            state=(
                StateField("late", nothing, FieldKind.WIDE, is_array=True, comment="of each term, share of the span"),
                StateField("before", nothing, is_array=True, comment="share of the span at the step before"),
                StateField("play", nothing, is_array=True, comment="of each term, share of the span"),
            ),
            coefficients=(("gone", self.n_terms), ("ramp", self.n_terms)),
            prepare=prepare_terms,
            forward=add_terms,
            inverse=take_terms,
            helpers=(lag_ramp, remembered, factor_of),
        )

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes with what they change of the terms, about the displacement."""
        if values is None:
            return changes
        return slopes_of_sum(self._arrays(), self.span_um, values, changes, steps_s)

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement [um] before this effect, to rounding where ``can_invert``."""
        out = np.empty(values.size)
        invert_terms(state, *self._arrays(), self.span_um, values, steps_s, out)
        return out

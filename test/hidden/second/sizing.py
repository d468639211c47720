"""Turning each drawn effect to a size that is neither lost in the noise nor blatant."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from test.hidden.second.actuator import Circumstance, Effects
from test.hidden.second.bench import PARTS, Bench
from test.hidden.second.circumstances import draw_circumstance
from test.hidden.second.coarse_model import CoarseModel, coarse_model
from test.hidden.second.hidden_causes import BELONG_TO_ONE_RECORD, DRAWS, MISSING
from test.hidden.second.hysteresis_forms import REPRESENTABLE
from test.hidden.second.plays import PlayStack
from test.hidden.second.scale import chance, log_uniform
from test.hidden.second.surrogate import Surrogate, rms, visible_um

LEAST_OVER_NOISE, MOST_OVER_NOISE = 5.0, 30.0  # visible rms in the test record
_LEAST_IN_TRAINING = 4.0  # what is learnt from must show it too
_MOST_FORM_ERROR = 0.3  # over the noise, of what plays and power-law creep can be
_NOISE_SHARES = (1e-5, 3e-3)  # of the stroke: sensors there are
_N_RESIZES = 7
_N_FORM_PLAYS = 120
_N_BASIS_PLAYS = 40
_TARGETS = (6.0, 24.0)


@dataclass(frozen=True)
class Sized:
    """Effects of a fair size, and the noise they are fair beside."""

    causes: tuple[str, ...]
    parameters: dict[str, dict[str, Any]]
    visible_um: dict[str, tuple[float, float]]
    noise_um: float
    coarse: CoarseModel | None


class Sizing:
    """Turns the size of each drawn effect until it is neither lost in the noise nor blatant.

    Args:
        bench: the actuator without effects, and its drives.
        seed: of what befalls each record.
    """

    def __init__(self, bench: Bench, seed: int) -> None:
        self.bench, self.seed = bench, seed
        self.plain_um = [self.clean_um(which, {}) for which in range(len(PARTS))]
        reach_v, order = bench.scale.reach_v, bench.creep_order
        loops = bench.actuator.loops
        own_v = loops.thresholds_v if isinstance(loops, PlayStack) and loops.thresholds_v.size < 100 else None
        left = Surrogate(list(bench.traces), reach_v, order, _N_FORM_PLAYS, own_v).left_of(self.plain_um)
        self.form_error_um = max(rms(values) for values in left[1:])
        self.basis = Surrogate(list(bench.traces[:2]), reach_v, order, _N_BASIS_PLAYS).absorbing_basis()

    def coarser(self, oversampling: int) -> Sizing:
        """Return the same with fewer steps of the physics in a sample, for questions that need no more."""
        other = copy.copy(self)
        other.bench = replace(self.bench, actuator=replace(self.bench.actuator, oversampling=oversampling))
        other.plain_um = [other.clean_um(which, {}) for which in range(len(PARTS))]
        return other

    def circumstance(self, which: int, effects: Effects) -> Circumstance:
        """Return what befalls a record; always the same for the same effects."""
        trace, bench = self.bench.traces[which], self.bench
        return draw_circumstance(
            effects,
            bench.scale,
            trace.command_v.size,
            trace.step_s,
            befalls=which == 0 or bench.befalls_all,
            rng=chance(self.seed, f"circumstance {PARTS[which]}"),
        )

    def clean_um(self, which: int, effects: Effects) -> np.ndarray:
        """Return the displacement of a record [um] with some effects, noiseless, from the relaxed zero."""
        trace, circumstance = self.bench.traces[which], self.circumstance(which, effects)
        actuator = self.bench.actuator.having(effects)
        return actuator.true_um(trace.command_v, trace.step_s, circumstance) - circumstance.offset_um

    def left_um(self, cause: str, parameters: dict[str, Any]) -> list[np.ndarray]:
        """Return, for train and test, what no base could absorb of an effect [um]."""
        changes = [self.clean_um(which, {cause: parameters}) - self.plain_um[which] for which in range(2)]
        if cause == "backlash":
            # Plays can be a backlash, wholly: its size is what it does, not what they leave of it.
            return [change - change.mean() for change in changes]
        return visible_um(changes, self.basis)

    def visible(self, cause: str, parameters: dict[str, Any]) -> tuple[float, float]:
        """Return the rms of it in train and in test [um]."""
        train, test = self.left_um(cause, parameters)
        return rms(train), rms(test)

    def fit_all(self, causes: tuple[str, ...], rng: np.random.Generator) -> Sized | None:
        """Return all causes at fair sizes, or None where this bench does not show them, or not what is beside them."""
        noise_um, parameters, visible = self.bench.scale.noise_um, {}, {}
        # A cause without a size first: the noise is what is turned for it.
        for cause in sorted((c for c in causes if c != MISSING), key=lambda c: c != "zero_order_hold"):
            found = self._fit(cause, noise_um, rng)
            if found is None:
                return None
            parameters[cause], visible[cause], noise_um = found
        coarse = None
        if MISSING in causes:
            trace, bench, n = self.bench.traces[0], self.bench, int(rng.integers(2, 4))
            reference_s = bench.scale.duration_s
            coarse = coarse_model(self.plain_um[0], trace, bench.scale.reach_v, bench.creep_order, reference_s, n)
            left = [self.plain_um[k] - coarse.displacement_um(bench.traces[k]) for k in range(2)]
            visible[MISSING] = (rms(left[0] - left[0].mean()), rms(left[1] - left[1].mean()))
            if min(visible[MISSING]) < LEAST_OVER_NOISE * noise_um:
                return None
            parameters[MISSING] = {"n_plays_given": n}
        if self.bench.form in REPRESENTABLE and self.form_error_um > _MOST_FORM_ERROR * noise_um:
            return None  # the training drive does not tell the plays well enough for the held-out ones
        return Sized(causes, parameters, visible, noise_um, coarse)

    def _fit(
        self, cause: str, noise_um: float, rng: np.random.Generator
    ) -> tuple[dict[str, Any], tuple[float, float], float] | None:
        """Return parameters, visible rms in train and test and the noise, or None where no size is fair."""
        draft, target = DRAWS[cause](self.bench, rng), log_uniform(rng, *_TARGETS)
        is_in_test = self.bench.befalls_all or cause not in BELONG_TO_ONE_RECORD
        low, high = np.log(draft.smallest), np.log(draft.largest)
        size = float(np.exp(0.5 * (low + high)))
        for _ in range(_N_RESIZES):
            parameters = draft.build(size)
            seen = self.visible(cause, parameters)
            judged = seen[1] if is_in_test else seen[0]
            if draft.smallest == draft.largest:
                noise_um = judged / target
                if not _NOISE_SHARES[0] <= noise_um / self.bench.scale.stroke_um <= _NOISE_SHARES[1]:
                    return None
            is_fair = LEAST_OVER_NOISE <= judged / noise_um <= MOST_OVER_NOISE
            if is_fair and seen[0] >= _LEAST_IN_TRAINING * noise_um:
                return parameters, seen, noise_um
            if judged > MOST_OVER_NOISE * noise_um:
                high = min(high, np.log(size))
            else:
                low = max(low, np.log(size))
            turned = np.log(size) + np.log(target * noise_um / max(judged, 1e-6 * noise_um)) / draft.power
            # Along the power law while that stays between what is too small and too large, else halfway.
            inside = low + 0.02 * (high - low) < turned < high - 0.02 * (high - low)
            size = float(np.exp(turned if inside else 0.5 * (low + high)))
        return None

"""Creep follows another law than the power of time: its logarithm, or a few relaxations."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.linear_columns import through_modes
from fomrc_core.effects.base.linear_modes import logarithmic_modes, modes_at_rest, modes_form, run_modes, undo_modes
from fomrc_core.effects.base.step_form import StepForm

_SHARES = ("first_share", "second_share", "third_share")
_TIMES = ("first_s", "second_s", "third_s")
_SHORTEST_SAMPLES, _LONGEST = 5.0, 0.7  # of a relaxation: samples, and of the record
_CLOSE = 3.0  # from one trial relaxation to the next: half a decade, over which one alone bends
_FAR = 15.0  # from the first relaxation to the last: no trial about one time reaches so far
_N_MIDDLES = 5  # of trial spectra, from the shortest to the longest that can be seen
_N_TIMES = 60  # at which a power law is compared with what takes its place


@dataclass(frozen=True)
class CreepLaw(Effect):
    """Creep in place of the fractional order, which is zero where this acts; exact between samples.

    After a step x: x (1 + per_decade log10(1 + t / onset_s)), the law of Jung and Gweon, and beside it or instead
    up to three relaxations, x share (1 - exp(-t / time)).
    """

    name: ClassVar[str] = "creep_law"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 2.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("per_decade", "1", 0.0, 10.0, description="growth of the displacement in each decade of time"),
        Parameter("onset_s", "s", 1e-12, 1e9, is_log=True, description="time after a step from which it grows so"),
        Parameter("first_share", "1", 0.0, 10.0, description="share of the displacement that arrives late"),
        Parameter("first_s", "s", 1e-12, 1e9, is_log=True, description="its time constant"),
        Parameter("second_share", "1", 0.0, 10.0, description="share that arrives later"),
        Parameter("second_s", "s", 1e-12, 1e9, is_log=True, description="its time constant"),
        Parameter("third_share", "1", 0.0, 10.0, description="share that arrives last"),
        Parameter("third_s", "s", 1e-12, 1e9, is_log=True, description="its time constant"),
    )
    main_parameter: ClassVar[str] = "per_decade"
    linear_parameters: ClassVar[tuple[str, ...]] = ("per_decade", *_SHARES)
    replaces_creep: ClassVar[bool] = True
    meaning: ClassVar[str] = "The ceramic's domains settle with another spread of times than the power law has."
    signature: ClassVar[str] = "after each step the residual bends in log time, at the same times whatever the step"
    experiment: ClassVar[str] = "one large step held for four decades of time, sampled evenly in log time"
    inverse_note: ClassVar[str] = "inverted exactly"
    bends_to_much: ClassVar[bool] = True
    can_invert: ClassVar[bool] = True

    per_decade: float = 0.0
    onset_s: float = 1.0
    first_share: float = 0.0
    first_s: float = 1.0
    second_share: float = 0.0
    second_s: float = 1.0
    third_share: float = 0.0
    third_s: float = 1.0

    def _modes(self) -> tuple[Array, Array]:
        """Return rates [1/s] and gains of the modes that act: those of the logarithm, then the relaxations."""
        pairs = [(getattr(self, share), 1.0 / getattr(self, time)) for share, time in zip(_SHARES, _TIMES, strict=True)]
        rates = [rate for share, rate in pairs if share != 0.0]
        shares = [share for share, _ in pairs if share != 0.0]
        if self.per_decade == 0.0:
            return np.array(rates), np.array(shares)
        logarithmic, gains = logarithmic_modes(self.onset_s)
        gains = gains * (self.per_decade / math.log(10.0))
        return np.concatenate((logarithmic, rates)), np.concatenate((gains, shares))

    def initial_state(self) -> Array:
        """Return (input, then each mode) [um] of the step before, at rest."""
        return modes_at_rest(self._modes()[0].size)

    def carried_state(self, old: Array) -> Array:
        """Return the modes where those of another left them; of another number, settled where the stage stands."""
        own = self.initial_state()
        return old.copy() if old.shape == own.shape else np.full_like(own, old[0])

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement that has crept [um], shape (n_samples,)."""
        out = np.empty(values.size)
        run_modes(state, *self._modes(), 1.0, values, steps_s, out)
        return out

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes that have crept, (n_samples, n_changes)."""
        return through_modes(*self._modes(), 1.0, changes, steps_s)

    def invert(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement before creep [um], exactly."""
        out = np.empty(values.size)
        undo_modes(state, *self._modes(), 1.0, values, steps_s, out)
        return out

    def free_names(self) -> tuple[str, ...]:
        """Return the size and time of what there is."""
        free: list[str] = []
        for pair in (("per_decade", "onset_s"), *zip(_SHARES, _TIMES, strict=True)):
            free += pair if getattr(self, pair[0]) != 0.0 else ()
        return tuple(free)

    def form(self) -> tuple[str, ...]:
        """Return the parameters it moves, and whether its relaxations are close together or far apart."""
        pairs = zip(_SHARES, _TIMES, strict=True)
        times_s = [getattr(self, time) for share, time in pairs if getattr(self, share) != 0.0]
        is_far = len(times_s) > 1 and max(times_s) > _FAR * min(times_s)
        return (*self.free_names(), *(("far",) if is_far else ()))

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether every relaxation bends within the record, over some samples."""
        pairs = zip(_SHARES, _TIMES, strict=True)
        times_s = [getattr(self, time) for share, time in pairs if getattr(self, share) != 0.0]
        return all(_SHORTEST_SAMPLES * step_s <= time <= _LONGEST * duration_s for time in times_s)

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return modes_form(*self._modes(), 1.0, is_inverted=True)

    def kin(self) -> dict[str, dict[str, float]]:
        """Return the one relaxation that is nearest: the largest."""
        share, time_s = max(
            (getattr(self, share), getattr(self, time)) for share, time in zip(_SHARES, _TIMES, strict=True)
        )
        return {"slow_relaxation": {"amplitude": share, "time_constant_s": time_s}} if share > 0.0 else {}

    @classmethod
    def in_place_of_creep(cls, order: float, shortest_s: float, longest_s: float) -> list[Effect]:
        """Return the logarithm, and the two and three relaxations, that creep most nearly as the power law."""
        if not (order > 0.0 and longest_s > shortest_s):
            return []
        times_s = np.geomspace(shortest_s, longest_s, _N_TIMES)
        grown = (times_s / shortest_s) ** order - 1.0
        decades = np.log10(1.0 + times_s / shortest_s)
        nearest: list[dict[str, float]] = [
            {"per_decade": float(decades @ grown / (decades @ decades)), "onset_s": shortest_s}
        ]
        for n in (2, 3):
            constants_s = shortest_s * (longest_s / shortest_s) ** ((np.arange(n) + 0.5) / n)
            late = -np.expm1(-times_s[:, np.newaxis] / constants_s)
            shares, *_ = np.linalg.lstsq(late, grown)
            pairs = zip(_SHARES, _TIMES, np.maximum(shares, 0.0), constants_s, strict=False)
            nearest.append({k: float(v) for s, t, share, time_s in pairs for k, v in ((s, share), (t, time_s))})
        return list(cls.proposed(nearest))

    @classmethod
    def screening(cls, evidence: Evidence) -> list[CreepLaw]:
        """Return logarithms that begin within a sample and later, and two and three relaxations about every time.

        Close together they are told from far apart by their fit, which does not find a valley a decade away.
        """
        step_s, duration_s = evidence.sample_period_s, evidence.duration_s
        trials: list[dict[str, float]] = [
            {"per_decade": 0.01, "onset_s": onset} for onset in (step_s, 20.0 * step_s, 0.02 * duration_s)
        ]
        spectra = [(0.003 * duration_s, 0.05 * duration_s), (0.0005 * duration_s, 0.01 * duration_s, 0.2 * duration_s)]
        shortest_s, longest_s = _SHORTEST_SAMPLES * step_s, _LONGEST * duration_s
        if longest_s > shortest_s:
            for middle_s in np.geomspace(_CLOSE * shortest_s, max(longest_s / _CLOSE, _CLOSE * shortest_s), _N_MIDDLES):
                near = (float(middle_s) / _CLOSE, float(middle_s), float(middle_s) * _CLOSE)
                spectra += [near[::2], near]
        for times_s in spectra:
            names = zip(_SHARES, _TIMES, times_s, strict=False)
            trials.append({key: value for s, t, time_s in names for key, value in ((s, 0.01), (t, time_s))})
        return cls.proposed(trials)

"""Something pushes against the stage for part of the record."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.kernels import elapsed_times
from fomrc_core.effects.base.step_form import CLOCK_FIELDS, Fields, Number, StepForm, clock_after

_NEVER_S = 1e9  # beyond any record: a load that stays
_SURE = 5.0  # standard errors of a level beside an edge
_FIRST_MOVE = 0.1  # of the range of the drive
# Times about an edge as shares of the record, and the fewest samples each must hold, in however short a record: the
# load comes within the first, its levels before and after are measured within the second, it lasts for the third.
_RISE, _BESIDE, _SHORTEST = 1.0 / 2500.0, 1.0 / 300.0, 1.0 / 75.0
_SLOWER = (1.0, 2.0, 4.0, 8.0)  # times the shortest rise: up to a three-hundredth of a record
_RISE_SAMPLES, _BESIDE_SAMPLES, _SHORTEST_SAMPLES = 3, 25, 50
_LEAST_LEVEL_SAMPLES = 10  # a straight line and its error from fewer say nothing


def _load(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    s.elapsed = clock_after(s.elapsed, s.started, step_s)
    s.started = 1
    if s.elapsed < c.onset_s:
        return value
    if c.rise_s <= 0.0:
        return value + c.displacement_um if s.elapsed < c.release_s else value
    loaded = 1.0 - math.exp(-(s.elapsed - c.onset_s) / c.rise_s)
    if s.elapsed >= c.release_s:
        loaded = loaded - (1.0 - math.exp(-(s.elapsed - c.release_s) / c.rise_s))
    return value + c.displacement_um * loaded


@dataclass(frozen=True)
class ExternalLoad(Effect):
    """A constant displacement between onset and release: a force divided by the stage's stiffness.

    A hand or a weight takes its time, of which a model that jumps leaves some samples many times the noise: the load
    comes and goes as 1 - exp(-t / rise_s).
    """

    name: ClassVar[str] = "external_load"
    stage: ClassVar[Stage] = Stage.SENSED
    order: ClassVar[float] = 10.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("displacement_um", "um", -1e6, 1e6, description="force over stiffness"),
        Parameter("onset_s", "s", 0.0, _NEVER_S, description="when it begins, from the record's start"),
        Parameter("release_s", "s", 0.0, _NEVER_S, description="when it ends"),
        Parameter("rise_s", "s", 0.0, _NEVER_S, description="time constant with which it comes and goes, 0 at once"),
    )
    main_parameter: ClassVar[str] = "displacement_um"
    meaning: ClassVar[str] = "A weight, a cable or a hand loads the stage from one moment to another."
    signature: ClassVar[str] = "the residual jumps at one moment that has nothing to do with the drive, and stays"
    experiment: ClassVar[str] = "hold the drive at rest and load and unload the stage on purpose"
    inverse_note: ClassVar[str] = "not inverted: when it comes is not known beforehand"
    is_record_bound: ClassVar[bool] = True
    linear_parameters: ClassVar[tuple[str, ...]] = ("displacement_um",)
    held_parameters: ClassVar[tuple[str, ...]] = ("onset_s", "release_s", "rise_s")
    moved_moments: ClassVar[tuple[str, ...]] = ("onset_s", "release_s")
    moved_durations: ClassVar[tuple[str, ...]] = ("rise_s",)

    displacement_um: float
    onset_s: float
    release_s: float = _NEVER_S
    rise_s: float = 0.0

    def initial_state(self) -> Array:
        """Return (elapsed [s], started)."""
        return np.zeros(2)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement [um] under the load, shape (n_samples,)."""
        t = np.empty(steps_s.size)
        elapsed_times(state, steps_s, t)
        return values + self.displacement_um * (self._since(t, self.onset_s) - self._since(t, self.release_s))

    def _since(self, t: Array, begin_s: float) -> Array:
        """Return how much of what begins then has come [1], shape (n_samples,)."""
        if self.rise_s <= 0.0:
            return np.asarray(t >= begin_s, dtype=np.float64)
        return np.asarray(-np.expm1(-np.maximum(t - begin_s, 0.0) / self.rise_s))

    def is_confirmed(self, time_s: Array, voltage_v: Array, residual_um: Array) -> bool:
        """Return whether the residual jumps where the load comes and goes, and by its size.

        A model that is wrong for some stretch of the drive leaves a residual that grows and fades; a load jumps.
        What jumps where the drive first leaves its starting voltage is memory of what went before.
        """
        duration_s, step_s = float(time_s[-1]), float(np.median(np.diff(time_s)))
        if self.release_s - self.onset_s < max(_SHORTEST * duration_s, _SHORTEST_SAMPLES * step_s):
            return False
        rise_s = max(_RISE * duration_s, _RISE_SAMPLES * step_s)
        beside_s = max(_BESIDE * duration_s, _BESIDE_SAMPLES * step_s)
        edges = [(self.onset_s, self.displacement_um)]
        if self.release_s < time_s[-1]:
            edges.append((self.release_s, -self.displacement_um))
        # a hand or a weight put down takes its time; the levels beside it are as short as ever, or what grows and fades
        # would look like one
        return all(
            any(_jumps(time_s, residual_um, edge_s, size, (n * rise_s, (n - 1.0) * rise_s + beside_s)) for n in _SLOWER)
            and not _is_first_move(time_s, voltage_v, edge_s, rise_s)
            for edge_s, size in edges
        )

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether it comes within the record: what begins with it cannot be told from where it stands."""
        return self.onset_s > max(_BESIDE * duration_s, _BESIDE_SAMPLES * step_s)

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=(
                ("displacement_um", self.displacement_um),
                ("onset_s", self.onset_s),
                ("release_s", self.release_s),
                ("rise_s", self.rise_s),
            ),
            state=CLOCK_FIELDS,
            forward=_load,
            helpers=(clock_after,),
        )

    @classmethod
    def screening(cls, evidence: Evidence) -> list[ExternalLoad]:
        """Return the best single step and pulse of each record's residual, by cumulated sums, and the pulse's edges.

        A base that has bent to a load that stayed leaves a short pulse of it; one too short to be told for a load is
        something else's.
        """
        trials: list[dict[str, float]] = []
        for record in evidence.records:
            r = record.residual_um - np.mean(record.residual_um)
            total = np.concatenate(([0.0], np.cumsum(r)))
            n = r.size
            k = np.arange(1, n)
            onset = int(k[np.argmax(total[k] ** 2 / (k * (n - k)))])
            step = -total[onset] * n / (onset * (n - onset))
            trials.append({"displacement_um": float(step), "onset_s": float(record.time_s[onset])})
            start, stop, size = _best_pulse(total, max(math.ceil(_SHORTEST * n), _SHORTEST_SAMPLES))
            if 0 < start < stop < n:
                start_s, stop_s = float(record.time_s[start]), float(record.time_s[stop])
                trials += [
                    {"displacement_um": size, "onset_s": start_s, "release_s": stop_s},
                    {"displacement_um": size, "onset_s": start_s},
                    {"displacement_um": -size, "onset_s": stop_s},
                ]
        return cls.proposed(trials)


def _is_first_move(time_s: Array, voltage_v: Array, edge_s: float, rise_s: float) -> bool:
    """Return whether the drive moves at this moment and has not been far from where it began."""
    beside = np.abs(time_s - edge_s) <= 2.0 * rise_s
    reach_v = float(np.max(np.abs(voltage_v[time_s <= edge_s] - voltage_v[0]), initial=0.0))
    span_v = float(np.ptp(voltage_v))
    return reach_v < _FIRST_MOVE * span_v and float(np.ptp(voltage_v[beside])) > 1e-3 * span_v


def _jumps(time_s: Array, residual_um: Array, edge_s: float, size_um: float, about_s: tuple[float, float]) -> bool:
    """Return whether the residual jumps by this size at an edge, within the first of two times about it [s].

    Its levels before and after are those up to the second.
    """
    rise_s, beside_s = about_s
    before = (time_s >= edge_s - beside_s) & (time_s < edge_s - rise_s)
    after = (time_s > edge_s + rise_s) & (time_s <= edge_s + beside_s)
    if min(np.count_nonzero(before), np.count_nonzero(after)) < _LEAST_LEVEL_SAMPLES:
        return False
    (level_before, error_before), (level_after, error_after) = (
        _level_at(time_s[side] - edge_s, residual_um[side]) for side in (before, after)
    )
    jump = level_after - level_before
    # neighbouring samples are not independent: a quarter of them counted
    error = 2.0 * float(np.hypot(error_before, error_after))
    return abs(jump) > _SURE * error and 0.6 < jump / size_um < 1.6


def _level_at(time_s: Array, values_um: Array) -> tuple[float, float]:
    """Return where a straight line through the values is at time zero, and its standard error [um].

    What creeps fast changes as much beside an edge as a load does; a line follows it up to the edge.
    """
    (_, level_um), covariance = np.polyfit(time_s, values_um, 1, cov=True)
    return float(level_um), float(np.sqrt(covariance[1, 1]))


def _best_pulse(total: Array, least: int) -> tuple[int, int, float]:
    """Return begin, end and size of the pulse of at least so many samples that takes most of cumulated sums."""
    n = total.size - 1
    coarse = np.unique(np.linspace(0, n, 400).astype(int))
    best = (0.0, 0, n)
    for _ in range(2):
        c = total[coarse]
        length = (coarse[None, :] - coarse[:, None]).astype(float)
        inside = c[None, :] - c[:, None]
        valid = (length >= least) & (length < n)
        score = np.where(valid, inside**2 / np.where(valid, length * (n - length), 1.0), 0.0)
        i, j = np.unravel_index(int(np.argmax(score)), score.shape)
        best = (float(score[i, j]), int(coarse[i]), int(coarse[j]))
        reach = max(n // 400, 1)
        around = [np.arange(max(p - reach, 0), min(p + reach, n) + 1, max(reach // 100, 1)) for p in best[1:]]
        coarse = np.unique(np.concatenate(around))
    start, stop = best[1], best[2]
    length_ = max(stop - start, 1)
    size = (total[stop] - total[start]) / length_ * n / max(n - length_, 1)
    return start, stop, float(size)

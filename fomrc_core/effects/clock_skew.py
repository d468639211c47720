"""Drive and sensor are timed by two clocks that do not agree."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.kernels import DELAY_CAPACITY, delay_state
from fomrc_core.effects.base.linear_columns import read_between
from fomrc_core.effects.base.step_form import Fields, Number, StepForm, delay_line


def _read_skewed(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    # As ``run`` for one sample: beyond the newest one the last slope goes on, before the oldest one that stays.
    if s.stored > 0:
        s.elapsed = s.elapsed + step_s
    s.newest = (s.newest + 1) % len(s.times)
    s.times[s.newest] = s.elapsed
    s.values[s.newest] = value
    if s.stored < len(s.times):
        s.stored = s.stored + 1
    if s.behind < s.stored:
        s.behind = s.behind + 1
    wanted = s.elapsed * c.rate
    later = s.newest
    for _ in range(len(s.times)):
        later = (s.newest + len(s.times) + 1 - s.behind) % len(s.times)
        if s.behind == 0 or s.times[later] > wanted:
            break
        s.behind = s.behind - 1
    if s.behind == 0:
        later = s.newest
    if s.stored < 2 or s.behind == s.stored:
        return s.values[later]
    earlier = (later + len(s.times) - 1) % len(s.times)
    if s.times[later] <= s.times[earlier]:
        return s.values[later]
    slope = (s.values[later] - s.values[earlier]) / (s.times[later] - s.times[earlier])
    if s.behind == 0:
        return value + slope * (wanted - s.elapsed)
    return s.values[earlier] + slope * (wanted - s.times[earlier])


@dataclass(frozen=True)
class ClockSkew(Effect):
    """The sensor's sample at nominal time t was taken at t (1 + ppm 1e-6) of the drive's clock.

    In a batch the displacement is read at the sensor's true times, linear between samples. Stepwise its future is
    not known: a positive skew then continues the last slope.
    """

    name: ClassVar[str] = "clock_skew"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 40.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("ppm", "ppm", -1e5, 1e5, description="how much faster the drive's clock runs"),
    )
    main_parameter: ClassVar[str] = "ppm"
    meaning: ClassVar[str] = "The recorder's clock and the drive's clock differ, so the record shears in time."
    signature: ClassVar[str] = (
        "residual follows the rate of the drive and grows from the start of the record to its end"
    )
    experiment: ClassVar[str] = "the same fast triangle at the start and at the end of a long record"
    inverse_note: ClassVar[str] = "nothing to invert: it belongs to the recording, not to the actuator"
    linear_parameters: ClassVar[tuple[str, ...]] = ("ppm",)
    is_of_clock: ClassVar[bool] = True
    needs_substeps: ClassVar[bool] = True

    ppm: float

    def initial_state(self) -> Array:
        """Return an empty buffer: count, elapsed time [s], then times and displacements."""
        return delay_state()

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the displacement [um] at the sensor's true times, shape (n_samples,)."""
        kept = min(int(state[0]), _KEPT)
        old_times, old_values = state[3 : 3 + kept], state[3 + _KEPT : 3 + _KEPT + kept]
        start = np.concatenate((state[1:2], steps_s))
        if state[0] == 0.0:
            start[1] = 0.0  # the first sample is the common zero of both clocks
        start = np.cumsum(start)[1:]
        times = np.concatenate((old_times, start))
        drive = np.concatenate((old_values, values))
        wanted = start * (1.0 + 1e-6 * self.ppm)
        out = np.interp(wanted, times, drive)
        beyond = wanted > times[-1]
        if times.size > 1 and np.any(beyond):
            slope = (drive[-1] - drive[-2]) / (times[-1] - times[-2])
            out[beyond] = drive[-1] + slope * (wanted[beyond] - times[-1])
        kept = min(times.size, _KEPT)
        state[0], state[1] = kept, start[-1]
        state[3 : 3 + kept], state[3 + _KEPT : 3 + _KEPT + kept] = times[-kept:], drive[-kept:]
        return out

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the changes at the sensor's true times, (n_samples, n_changes)."""
        times_s = np.concatenate(([0.0], np.cumsum(steps_s[1:])))
        wanted_s = times_s * (1.0 + 1e-6 * self.ppm)
        later = np.clip(np.searchsorted(times_s, wanted_s, side="right"), 1, times_s.size - 1)
        share = (wanted_s - times_s[later - 1]) / (times_s[later] - times_s[later - 1])
        return read_between(changes, later, share)

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        return StepForm(
            constants=(("rate", 1.0 + 1e-6 * self.ppm),), state=delay_line(DELAY_CAPACITY), forward=_read_skewed
        )

    @classmethod
    def acts_before_record(cls) -> bool:
        """Return that it does not: the record's first sample is the common zero of both clocks."""
        return False

    @classmethod
    def screening(cls, evidence: Evidence) -> list[ClockSkew]:
        """Return skews of either sign that shift the end of the record by a fraction of a sample and more."""
        unit = 1e6 * evidence.sample_period_s / evidence.duration_s
        return cls.proposed({"ppm": unit * shift} for shift in (0.5, -0.5, 3.0, -3.0, 15.0, -15.0))


_KEPT = DELAY_CAPACITY

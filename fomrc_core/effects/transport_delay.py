"""The displacement arrives late by a constant time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fomrc_core.compute.arrays import ComplexArray
from fomrc_core.effects.base.effect import Array, Effect, Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence
from fomrc_core.effects.base.kernels import DELAY_CAPACITY, delay_state, run_delay
from fomrc_core.effects.base.lag import is_seen
from fomrc_core.effects.base.linear_columns import read_between
from fomrc_core.effects.base.step_form import Fields, Number, StepForm, delay_line
from fomrc_core.errors import ParameterError

_ROOM = 24  # samples beside those of the delay: the parts of one step, and one on either side


def _delay(s: Fields, c: Fields, value: float, step_s: float) -> Number:
    # The loop of run_delay, once; ``behind`` samples are younger than what is read.
    s.elapsed = s.elapsed + step_s
    s.newest = (s.newest + 1) % len(s.times)
    s.times[s.newest] = s.elapsed
    s.values[s.newest] = value
    if s.stored < len(s.times):
        s.stored = s.stored + 1
    if s.behind < s.stored:
        s.behind = s.behind + 1
    wanted = s.elapsed - c.delay_s
    later = s.newest
    for _ in range(len(s.times)):
        later = (s.newest + len(s.times) + 1 - s.behind) % len(s.times)
        if s.behind == 0 or s.times[later] > wanted:
            break
        s.behind = s.behind - 1
    if s.behind == 0:
        return value
    if wanted <= 0.0:
        return 0.0
    if s.behind == len(s.times):
        # what is to be read has been overwritten, until longer steps have come
        return math.nan
    earlier_time = 0.0
    earlier_value = 0.0
    if s.behind < s.stored:
        earlier = (later + len(s.times) - 1) % len(s.times)
        earlier_time = s.times[earlier]
        earlier_value = s.values[earlier]
    if s.times[later] <= earlier_time:
        return s.values[later]
    share = (wanted - earlier_time) / (s.times[later] - earlier_time)
    return earlier_value + share * (s.values[later] - earlier_value)


@dataclass(frozen=True)
class TransportDelay(Effect):
    """Pure delay of the displacement."""

    name: ClassVar[str] = "transport_delay"
    stage: ClassVar[Stage] = Stage.MECHANICAL
    order: ClassVar[float] = 30.0
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("delay_s", "s", 0.0, 1e5, description="delay"),)
    main_parameter: ClassVar[str] = "delay_s"
    meaning: ClassVar[str] = "Conversion, filtering or transmission takes a fixed time between command and reading."
    signature: ClassVar[str] = "residual follows the rate of the displacement at every frequency, sharp after steps"
    experiment: ClassVar[str] = "a multisine: phase falls in proportion to frequency while gain stays"
    inverse_note: ClassVar[str] = "no inverse without looking ahead: shift the target in time where it is known"
    needs_substeps: ClassVar[bool] = True

    delay_s: float

    def is_plausible(self, duration_s: float, step_s: float) -> bool:
        """Return whether it is more than samples so far apart leave open."""
        return is_seen(self.delay_s, step_s)

    def initial_state(self) -> Array:
        """Return an empty delay line."""
        return delay_state()

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the delayed displacement [um], shape (n_samples,).

        Raises:
            ParameterError: the delay is longer than the delay line at these steps.
        """
        out = np.empty(values.size)
        if not run_delay(state, self.delay_s, values, steps_s, out):
            raise ParameterError(
                "delay holds too many steps",
                where=f"{self.name}.delay_s",
                value=self.delay_s,
                allowed=f"up to {DELAY_CAPACITY - 1} steps, substeps counted",
            )
        return out

    def linearized(self, changes: Array, steps_s: Array, values: Array | None = None) -> Array:
        """Return the delayed changes, (n_samples, n_changes)."""
        times_s = np.cumsum(steps_s)
        wanted_s = times_s - self.delay_s
        # nothing is younger than the sample itself, where a delay is lost in the rounding of its time
        later = np.minimum(np.searchsorted(times_s, wanted_s, side="right"), np.arange(times_s.size))
        earlier_s = np.where(later > 0, times_s[later - 1], 0.0)
        share = np.maximum(wanted_s - earlier_s, 0.0) / (times_s[later] - earlier_s)
        return read_between(changes, later, share)

    def response(self, frequency_hz: Array) -> ComplexArray:
        """Return exp(-2 pi i f T) [1] at frequencies [Hz]."""
        return np.asarray(np.exp(-2j * np.pi * frequency_hz * self.delay_s))

    def is_null(self) -> bool:
        """Return whether nothing is delayed."""
        return self.delay_s == 0.0

    def kin(self) -> dict[str, dict[str, float]]:
        """Return the hold, the sensor of four poles and the amplifier that lag as much where all is slow.

        A hold lags by half of its time. A Butterworth sensor's denominator begins 1 + b s + b^2 s^2 / 2 as a delay's
        does, b twice the sum of the sines of its poles' angles over the cutoff.
        """
        if not self.delay_s > 0.0:
            return {}
        lag = 2.0 * (math.sin(math.pi / 8.0) + math.sin(3.0 * math.pi / 8.0))
        cutoff_hz = lag / (2.0 * math.pi * self.delay_s)
        return {
            "zero_order_hold": {"hold_s": 2.0 * self.delay_s},
            "sensor_bandwidth": {"cutoff_hz": cutoff_hz, "n_poles": 4.0, "in_stages": 0.0},
            "amplifier_bandwidth": {"cutoff_hz": 1.0 / (2.0 * math.pi * self.delay_s)},
        }

    def step_form(self, shortest_part_s: float) -> StepForm:
        """Return the step for a controller."""
        n_parts = min(math.ceil(self.delay_s / shortest_part_s) + _ROOM, DELAY_CAPACITY)
        return StepForm(constants=(("delay_s", self.delay_s),), state=delay_line(n_parts), forward=_delay)

    @classmethod
    def screening(cls, evidence: Evidence) -> list[TransportDelay]:
        """Return delays from a fraction of a sample to ten samples."""
        return cls.proposed({"delay_s": evidence.sample_period_s * samples} for samples in (0.3, 1.0, 3.0, 10.0))

"""What an input was during a step: period by period, as it was sent, whatever the jitter of messages and of ticks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

# A step that is longer than so many periods is a pause; nobody needs its inputs one by one.
_MOST_PERIODS = 2000


@dataclass
class HeldInputs:
    """Inputs that come about once a period, each held for one.

    Where sender and stage tick at nearly the same moment, jitter makes no input of one period and two of the next. Held
    as they come, the first input would last two periods and the next half of one, and a resonance of the stage would
    ring by what neither sender nor stage does. So of two in a period the second waits for the next, as in a converter
    with a second buffer: from then on a period without one has one. It never waits longer, and an input that comes
    alone is held at once.

    Attributes:
        held: the input of the last period.
        waiting: at most one, for the next period.
    """

    held: float = 0.0
    waiting: list[float] = field(default_factory=list)

    def during(
        self, sent: Sequence[tuple[float, float]], now_s: float, step_s: float, period_s: float
    ) -> list[tuple[float, float]]:
        """Return (input, duration [s]) of the parts of a step.

        Where more than two came in a period all but the last share it, for a stage with hysteresis remembers the
        furthest of them however short it was. A step that makes up for periods missed is cut into whole periods, for
        the stage moved on while nobody looked.

        Args:
            sent: (time [s], input) of what was sent since the last step, in the order of sending.
            now_s: time at the end of the step [s].
            step_s: its duration [s].
            period_s: nominal period [s].
        """
        n_periods = round(step_s / period_s)
        if n_periods > _MOST_PERIODS:
            played = [*self.waiting, *(value for _, value in sent)] or [self.held]
            self.waiting, self.held = [], played[-1]
            return [(value, step_s / len(played)) for value in played]
        parts: list[tuple[float, float]] = []
        duration_s, at = step_s / max(n_periods, 1), 0
        for left in reversed(range(max(n_periods, 1))):
            first = at
            while at < len(sent) and (not left or sent[at][0] <= now_s - left * period_s):
                at += 1
            played = self._of_a_period([value for _, value in sent[first:at]])
            if len(played) == 1 and parts and parts[-1][0] == played[0]:
                parts[-1] = (played[0], parts[-1][1] + duration_s)
            else:
                parts += [(value, duration_s / len(played)) for value in played]
        return parts

    def _of_a_period(self, came: list[float]) -> list[float]:
        known = [*self.waiting, *came]
        played = known[:-1] if len(known) > 1 else known or [self.held]
        self.waiting = known[-1:] if len(known) > 1 else []
        self.held = played[-1]
        return played

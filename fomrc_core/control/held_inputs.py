"""What an input was during a step: period by period, as it was sent, whatever the jitter of messages and of ticks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

# A step that is longer than so many periods is a pause; nobody needs its inputs one by one.
_MOST_PERIODS = 2000
# The sender's grid is the mean of so many times of sending.
_REMEMBERS = 64
# An input this near to where the next belongs is the next: a regular sender sends neither two in one place nor none.
_NEXT_WITHIN_PERIODS = 0.75
# Late more often than this within so many periods is no accident: sender and stage tick at the same moment.
_ACCIDENTS = 2.0
_ACCIDENT_PERIODS = 100.0
# After a silence this long, or so far from when it was due, the next input is of a sender that begins.
_ANEW_PERIODS = 100


@dataclass
class HeldInputs:
    """Inputs that come about once a period, each held for one.

    Where sender and stage tick at nearly the same moment, jitter makes no input of one period and two of the next. Held
    as they come, the first input would last two periods and the next half of one, and a resonance of the stage would
    ring by what neither sender nor stage does; and a delay that comes and goes with every late message is that of no
    stage. So each input has its place in the sender's own grid, found from the times of sending, and is played as many
    periods after that as the others: at once where inputs come in time, one period later, as in a converter with a
    second buffer, where they are often late. One that comes too late for its period shares the next.

    Attributes:
        held: the input of the last period.
        waiting: (period, input), in order; none waits for more than the next period.
    """

    held: float = 0.0
    waiting: list[tuple[int, float]] = field(default_factory=list)
    _period: int = 0
    _n_sent: int = 0
    _last_s: float = 0.0
    _grid_s: float = 0.0
    _slot: int = 0
    _n_late: float = 0.0

    def during(
        self, sent: Sequence[tuple[float, float]], now_s: float, step_s: float, period_s: float
    ) -> list[tuple[float, float]]:
        """Return (input, duration [s]) of the parts of a step.

        Where more are due in a period than one they share it, for a stage with hysteresis remembers the furthest of
        them however short it was. A step that makes up for periods missed is cut into whole periods, for the stage
        moved on while nobody looked.

        Args:
            sent: (time [s], input) of what was sent since the last step, in the order of sending.
            now_s: time at the end of the step [s].
            step_s: its duration [s].
            period_s: nominal period [s].
        """
        n_periods = round(step_s / period_s)
        if n_periods > _MOST_PERIODS:
            played = [value for _, value in (*self.waiting, *sent)] or [self.held]
            self.waiting, self.held, self._n_sent = [], played[-1], 0
            return [(value, step_s / len(played)) for value in played]
        parts: list[tuple[float, float]] = []
        duration_s, at = step_s / max(n_periods, 1), 0
        for left in reversed(range(max(n_periods, 1))):
            self._period += 1
            self._n_late *= 1.0 - 1.0 / _ACCIDENT_PERIODS
            while at < len(sent) and (not left or sent[at][0] <= now_s - left * period_s):
                self.waiting.append((self._due(sent[at][0], period_s), sent[at][1]))
                at += 1
            played = self._of_this_period()
            if len(played) == 1 and parts and parts[-1][0] == played[0]:
                parts[-1] = (played[0], parts[-1][1] + duration_s)
            else:
                parts += [(value, duration_s / len(played)) for value in played]
        return parts

    def _of_this_period(self) -> list[float]:
        n_due = 0
        while n_due < len(self.waiting) and self.waiting[n_due][0] <= self._period:
            n_due += 1
        played = [value for _, value in self.waiting[:n_due]] or [self.held]
        self.waiting, self.held = self.waiting[n_due:], played[-1]
        return played

    def _due(self, sent_s: float, period_s: float) -> int:
        """Return the period in which an input that has come now is to be played."""
        silent_s, self._last_s = sent_s - self._last_s, sent_s
        passed = (sent_s - self._grid_s) / period_s
        n_slots = 1 if abs(passed - 1.0) < _NEXT_WITHIN_PERIODS else round(passed)
        due = self._slot + n_slots
        is_anew = not 0.0 <= silent_s <= _ANEW_PERIODS * period_s or due < self._period - _ANEW_PERIODS
        if not self._n_sent or is_anew:
            self._n_sent, self._grid_s, self._slot, self._n_late = 1, sent_s, self._period, 0.0
            return self._period
        self._n_sent = min(self._n_sent + 1, _REMEMBERS)
        late_s = sent_s - self._grid_s - n_slots * period_s
        self._grid_s += n_slots * period_s + late_s / self._n_sent
        self._n_late += float(due < self._period)
        if self._n_late > _ACCIDENTS:
            self._n_late = 0.0
            due += 1
        self._slot = min(due, self._period + 1)
        return self._slot

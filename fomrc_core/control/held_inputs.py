"""What an input was during a step that came late: period by period, as it was sent."""

from __future__ import annotations

from collections.abc import Sequence

# A step that is longer than so many periods is a pause; nobody needs its inputs one by one.
_MOST_PERIODS = 2000


def held_inputs(
    before: float, sent: Sequence[tuple[float, float]], now_s: float, step_s: float, period_s: float
) -> list[tuple[float, float]]:
    """Return (input, duration [s]) of the parts of a step, each held until the next was sent.

    A step of one period ends with the input sent last: the jitter of messages is none of the stage's. Where more than
    one came they share it, for a stage with hysteresis remembers the furthest of them however short it was. A step that
    made up for periods missed is cut into whole periods, for the stage moved on while nobody looked.

    Args:
        before: input held before the step.
        sent: (time [s], input) of what was sent since then, in the order of sending.
        now_s: time at the end of the step [s].
        step_s: its duration [s].
        period_s: nominal period [s].
    """
    n_periods = round(step_s / period_s)
    if n_periods <= 1 or not sent or n_periods > _MOST_PERIODS:
        values = [value for _, value in sent] or [before]
        return [(value, step_s / len(values)) for value in values]
    parts: list[tuple[float, float]] = []
    held, at, n_sent = before, 0, len(sent)
    for k in range(1, n_periods + 1):
        end_s = now_s - (n_periods - k) * period_s
        first = at
        while at < n_sent and (sent[at][0] <= end_s or k == n_periods):
            at += 1
        values = [value for _, value in sent[first:at]] or [held]
        held = values[-1]
        if len(values) == 1 and parts and parts[-1][0] == held:
            parts[-1] = (held, parts[-1][1] + period_s)
        else:
            parts += [(value, period_s / len(values)) for value in values]
    return parts

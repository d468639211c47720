"""The grid keeps up with the clock; what it says of the clock is free of jitter."""

from __future__ import annotations

import numpy as np

from fomrc_core.control.tick_grid import TickGrid

PERIOD_S = 1e-3


def test_the_clock_is_told_without_jitter_and_followed_where_the_grid_ran_ahead():
    grid, generator = TickGrid(PERIOD_S), np.random.default_rng(2)
    # Every tick up to 0.4 periods late; ten of them held up, the next one on time again, so that the grid runs ahead.
    times_s = PERIOD_S * np.arange(4000) + generator.uniform(0.0, 0.4 * PERIOD_S, 4000)
    times_s[1000:1200:20] += 0.5 * PERIOD_S
    steps_s = [grid.step_s(float(time_s)) for time_s in times_s[:1]]
    off_s, ahead_s = [], []
    for time_s in times_s[1:]:
        steps_s.append(grid.step_s(float(time_s)))
        off_s.append(grid.clock_s - time_s)
        ahead_s.append(grid.time_s - time_s)
    assert max(ahead_s) > 0.5 * PERIOD_S, "the grid did run ahead"
    jitter_s = np.std(times_s - PERIOD_S * np.arange(4000))
    steady_s = np.diff(np.array(off_s[3000:]) + times_s[3001:])
    print(np.std(steady_s), jitter_s, np.mean(off_s[3000:]))
    assert np.std(steady_s) < jitter_s / 20.0
    assert abs(np.mean(off_s[3000:])) < 0.02 * PERIOD_S

"""Inputs that come about once a period are held for one, whatever the jitter; late steps are cut where they changed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fomrc_core.control.held_inputs import HeldInputs


def test_an_input_alone_is_held_at_once() -> None:
    inputs = HeldInputs(1.0)
    assert inputs.during([(9.9996, 3.0)], 10.0, 1e-3, 1e-3) == [(3.0, 1e-3)]
    assert inputs.during([], 10.001, 1e-3, 1e-3) == [(3.0, 1e-3)]
    ((held, duration_s),) = inputs.during([], 10.5, 0.5, 1e-3)
    assert (held, duration_s) == (3.0, pytest.approx(0.5))


def test_of_two_the_second_waits_a_period() -> None:
    inputs = HeldInputs()
    assert inputs.during([(9.9991, 2.0), (9.9996, 3.0)], 10.0, 1e-3, 1e-3) == [(2.0, 1e-3)]
    assert inputs.during([], 10.001, 1e-3, 1e-3) == [(3.0, 1e-3)]
    assert inputs.waiting == []


def test_a_faster_sender_shares_the_period_and_falls_no_further_behind() -> None:
    inputs = HeldInputs()
    for k in range(50):
        sent = [(0.5e-3 * i, float(i)) for i in (2 * k, 2 * k + 1)]
        parts = inputs.during(sent, 1e-3 * (k + 1), 1e-3, 1e-3)
        assert inputs.waiting == [2.0 * k + 1.0]
    assert parts == [(97.0, 5e-4), (98.0, 5e-4)]


def test_late_each_input_holds_until_the_next_was_sent() -> None:
    parts = HeldInputs(0.0).during([(9.9965, 1.0), (9.9985, 2.0)], 10.0, 5e-3, 1e-3)
    assert [value for value, _ in parts] == [0.0, 1.0, 2.0]
    assert [duration for _, duration in parts] == pytest.approx([1e-3, 2e-3, 2e-3])


def test_jitter_of_a_regular_sender_leaves_no_gap_and_no_double() -> None:
    # Sender and stage tick at the same moments but for 0.2 ms rms; the stage's n-th step ends near n periods.
    random = np.random.default_rng(3)
    sent_s = 1e-3 * np.arange(2000) + random.normal(0.0, 2e-4, 2000).clip(-4.5e-4, 4.5e-4)
    ticks_s = 1e-3 * np.arange(2000) + random.normal(0.0, 2e-4, 2000).clip(-4.5e-4, 4.5e-4)
    inputs, at, played = HeldInputs(-1.0), 0, []
    for now_s in ticks_s:
        first = at
        while at < sent_s.size and sent_s[at] <= now_s:
            at += 1
        parts = inputs.during([(sent_s[i], float(i)) for i in range(first, at)], float(now_s), 1e-3, 1e-3)
        assert len(parts) == 1
        played.append(parts[0][0])
    # Once the first pair has come every period has the input after that of the period before.
    assert set(np.diff(played[20:])) == {1.0}


@given(
    st.lists(st.tuples(st.floats(9.0, 11.0), st.floats(-5.0, 5.0)), max_size=30).map(sorted),
    st.integers(1, 40),
)
def test_no_time_and_no_input_is_lost(sent: list[tuple[float, float]], n_periods: int) -> None:
    inputs = HeldInputs(7.0)
    parts = inputs.during(sent, 10.0, n_periods * 1e-2, 1e-2)
    parts += inputs.during([], 10.01, 1e-2, 1e-2)
    assert sum(duration for _, duration in parts) == pytest.approx((n_periods + 1) * 1e-2)
    assert parts[-1][0] == (sent[-1][1] if sent else 7.0)
    # Hysteresis remembers every extreme, however short it was.
    assert {value for _, value in sent} <= {value for value, _ in parts}

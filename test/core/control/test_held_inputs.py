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


def test_two_share_a_period_where_that_is_an_accident() -> None:
    inputs = HeldInputs()
    assert inputs.during([(9.9981, 1.0)], 9.999, 1e-3, 1e-3) == [(1.0, 1e-3)]
    assert inputs.during([], 10.0, 1e-3, 1e-3) == [(1.0, 1e-3)]
    assert inputs.during([(9.9991, 2.0), (10.0001, 3.0)], 10.001, 1e-3, 1e-3) == [(2.0, 5e-4), (3.0, 5e-4)]
    assert inputs.during([(10.0011, 4.0)], 10.002, 1e-3, 1e-3) == [(4.0, 1e-3)]


def played_of(arrivals: list[list[int]], first_s: float = 10.0) -> list[list[int]]:
    """Return which inputs each period plays; input k is sent in the middle of period k and comes where it is listed."""
    inputs, played = HeldInputs(-1.0), []
    for tick, numbers in enumerate(arrivals):
        sent = [(first_s + 1e-3 * (k - 0.5), float(k)) for k in numbers]
        parts = inputs.during(sent, first_s + 1e-3 * tick, 1e-3, 1e-3)
        played.append([int(value) for value, _ in parts])
    return played


def test_where_many_come_late_each_waits_a_period_and_goes_on_waiting() -> None:
    # 3, 6 and 9 come a period late; after that every input is played one period after it was sent, ...
    late = [[0], [1], [2], [], [3, 4], [5], [], [6, 7], [8], [], [9, 10], [11], [12]]
    # ... also where one comes late, two do, and none was sent at all
    later = [[13], [], [14, 15], [], [16], [17, 18], [19], [], [21], [22], [23]]
    played = played_of(late + later)
    assert [numbers[-1] for numbers in played[11:]] == [10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 19, 21, 22]
    assert all(len(numbers) == 1 for numbers in played[11:])


def test_a_sender_that_begins_anew_is_heard_at_once() -> None:
    inputs = HeldInputs()
    for k in range(30):
        inputs.during([(1e-3 * k, 2.0)] if k % 2 else [], 1e-3 * k, 1e-3, 1e-3)
    for k in range(30, 300):
        inputs.during([], 1e-3 * k, 1e-3, 1e-3)
    assert inputs.during([(0.2996, 4.0)], 0.3, 1e-3, 1e-3) == [(4.0, 1e-3)]
    # the clock of the sender is set back
    assert inputs.during([(0.1, 5.0)], 0.301, 1e-3, 1e-3) == [(5.0, 1e-3)]


def test_a_faster_sender_shares_the_period_and_falls_no_further_behind() -> None:
    inputs = HeldInputs()
    for k in range(50):
        sent = [(0.5e-3 * i, float(i)) for i in (2 * k, 2 * k + 1)]
        parts = inputs.during(sent, 1e-3 * (k + 1), 1e-3, 1e-3)
        assert len(inputs.waiting) <= 2
    assert 97.0 <= parts[-1][0] <= 99.0


@pytest.mark.parametrize("ratio", [0.999, 1.001])
def test_a_sender_of_nearly_the_same_rate_slips_a_period_now_and_then(ratio: float) -> None:
    inputs, n_shared, n_held, at = HeldInputs(-1.0), 0, 0, 0
    for k in range(5000):
        sent = []
        while ratio * (at - 0.3) <= k:
            sent.append((1e-3 * ratio * (at - 0.3), float(at)))
            at += 1
        before = inputs.held
        parts = inputs.during(sent, 1e-3 * k, 1e-3, 1e-3)
        n_shared += len(parts) > 1
        n_held += inputs.held == before
        assert at - 1 - inputs.held <= 2
    assert n_shared + n_held <= 25


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
        played.append([value for value, _ in parts])
    # Once a few have come late every period has the input after that of the period before.
    assert {len(values) for values in played[50:]} == {1}
    assert set(np.diff([values[0] for values in played[50:]])) == {1.0}


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

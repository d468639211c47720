"""A step that came late is cut where the inputs changed."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fomrc_core.control.held_inputs import held_inputs


def test_in_time_the_inputs_sent_share_the_step() -> None:
    assert held_inputs(1.0, [(9.9996, 3.0)], 10.0, 1e-3, 1e-3) == [(3.0, 1e-3)]
    assert held_inputs(1.0, [(9.9991, 2.0), (9.9996, 3.0)], 10.0, 1e-3, 1e-3) == [(2.0, 5e-4), (3.0, 5e-4)]
    assert held_inputs(1.0, [], 10.0, 1e-3, 1e-3) == [(1.0, 1e-3)]
    assert held_inputs(1.0, [], 10.0, 0.5, 1e-3) == [(1.0, 0.5)]


def test_late_each_input_holds_until_the_next_was_sent() -> None:
    parts = held_inputs(0.0, [(9.9965, 1.0), (9.9985, 2.0)], 10.0, 5e-3, 1e-3)
    assert [value for value, _ in parts] == [0.0, 1.0, 2.0]
    assert [duration for _, duration in parts] == pytest.approx([1e-3, 2e-3, 2e-3])


@given(
    st.lists(st.tuples(st.floats(9.0, 11.0), st.floats(-5.0, 5.0)), max_size=30).map(sorted),
    st.integers(1, 40),
)
def test_no_time_and_no_last_input_is_lost(sent: list[tuple[float, float]], n_periods: int) -> None:
    parts = held_inputs(7.0, sent, 10.0, n_periods * 1e-2, 1e-2)
    assert sum(duration for _, duration in parts) == pytest.approx(n_periods * 1e-2)
    assert parts[-1][0] == (sent[-1][1] if sent else 7.0)
    # Hysteresis remembers every extreme, however short it was.
    assert {value for _, value in sent} <= {value for value, _ in parts}

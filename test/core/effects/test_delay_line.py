"""A delay reads what was, in whatever pieces a record comes, and says where that is kept no more."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.errors import ParameterError

_KEPT = 4096  # samples of former calls that a delay line holds


@given(
    seed=st.integers(0, 2**32 - 1),
    pieces=st.lists(st.sampled_from((1, 2, 7, 60, 900, 5000)), min_size=1, max_size=6),
    is_even=st.booleans(),
)
def test_it_reads_what_was_for_delays_that_change_from_piece_to_piece(
    seed: int, pieces: list[int], is_even: bool
) -> None:
    rng = np.random.default_rng(seed)
    steps_s = np.full(sum(pieces), 0.01) if is_even else rng.uniform(0.001, 0.02, sum(pieces))
    values = rng.normal(size=steps_s.size)
    times_s = np.cumsum(steps_s)
    state = TransportDelay(0.0).initial_state()
    start = 0
    for n in pieces:
        delay_s = float(rng.choice([0.0, 0.003, 0.3, 20.0]))
        piece = slice(start, start + n)
        wanted_s = times_s[piece] - delay_s
        oldest_s = times_s[start - _KEPT] if start > _KEPT else 0.0
        is_kept = start <= _KEPT or not np.any((wanted_s > 0.0) & (wanted_s < oldest_s))
        if not is_kept:
            with pytest.raises(ParameterError, match="holds too many steps"):
                TransportDelay(delay_s).run(state, values[piece], steps_s[piece])
            return
        told = TransportDelay(delay_s).run(state, values[piece], steps_s[piece])
        expected = np.interp(wanted_s, np.append(0.0, times_s), np.append(0.0, values))
        np.testing.assert_allclose(told, np.where(wanted_s > 0.0, expected, 0.0), atol=1e-7)
        start += n


def test_a_shorter_delay_is_read_though_a_longer_one_would_need_what_is_kept_no_more() -> None:
    steps_s, values = np.full(9000, 0.01), np.arange(9000.0)
    state = TransportDelay(0.0).initial_state()
    TransportDelay(85.0).run(state, values, steps_s)  # reads the 500th: of these 4096 are kept
    told = TransportDelay(0.5).run(state, np.array([9000.0]), np.array([0.01]))
    np.testing.assert_allclose(told, [8950.0])


def test_what_is_kept_no_more_is_refused() -> None:
    steps_s, values = np.full(9000, 0.01), np.arange(9000.0)
    state = TransportDelay(0.0).initial_state()
    TransportDelay(85.0).run(state, values, steps_s)
    with pytest.raises(ParameterError, match="holds too many steps"):
        TransportDelay(85.0).run(state, np.array([9000.0]), np.array([0.01]))

"""What was sent and what was measured, each at its own times, become a record of what the stage did."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fomrc_core.control.heard_stage import heard_recording, held_lag_s
from fomrc_core.errors import FomrcError

PERIOD_S = 1e-2


def sent_and_seen(lag_s: float, seen_phase: float, n: int = 400, seed: int = 1):
    """Return voltages of a loop, displacements of a stage that has each of them so much later, and what it had."""
    random = np.random.default_rng(seed)
    steps = random.uniform(-1.0, 1.0, n)
    sent = np.column_stack((50.0 + PERIOD_S * np.arange(n), np.cumsum(steps)))
    at_s = sent[0, 0] + PERIOD_S * (np.arange(n - 10) + seen_phase) + lag_s
    had_v = np.array([sent[sent[:, 0] <= t - lag_s + 1e-9, 1][-1] for t in at_s])
    return sent, np.column_stack((at_s, 1.5 * had_v)), had_v


@given(st.floats(0.0, 5.0), st.floats(0.05, 0.95))
def test_each_reading_has_the_voltage_the_stage_had(lag_periods: float, phase: float) -> None:
    sent, seen, had_v = sent_and_seen(lag_periods * PERIOD_S, phase)
    record = heard_recording(sent, seen, PERIOD_S, "heard")
    assert record.is_valid is None
    n = record.n_samples
    assert n >= seen.shape[0] - 1
    assert np.array_equal(record.measured_um, seen[-n:, 1])
    assert np.array_equal(record.voltage_v, had_v[-n:])


def test_jitter_of_a_third_of_a_period_changes_no_voltage() -> None:
    sent, seen, had_v = sent_and_seen(1.5 * PERIOD_S, 0.5)
    random = np.random.default_rng(2)
    sent[:, 0] += PERIOD_S * random.uniform(-0.17, 0.17, sent.shape[0])
    seen[:, 0] += PERIOD_S * random.uniform(-0.17, 0.17, seen.shape[0])
    record = heard_recording(sent, seen, PERIOD_S, "heard")
    assert np.array_equal(record.voltage_v, had_v[-record.n_samples :])


def test_the_lag_found_is_the_middle_of_those_that_change_nothing() -> None:
    sent, seen, _ = sent_and_seen(3.0 * PERIOD_S, 0.25)
    # The reading comes a quarter of a period after its voltage: a lag up to that much more, or three quarters less.
    assert held_lag_s(sent, seen, PERIOD_S) == pytest.approx((3.0 - 0.25) * PERIOD_S, abs=0.04 * PERIOD_S)


def test_where_a_reading_or_two_are_lost_the_turns_between_are_samples_that_do_not_count() -> None:
    sent, seen, had_v = sent_and_seen(0.5 * PERIOD_S, 0.5)
    kept = np.ones(seen.shape[0], dtype=bool)
    kept[10:390:7] = False
    record = heard_recording(sent, seen[kept], PERIOD_S, "heard")
    counts = record.valid_samples
    assert np.array_equal(record.measured_um[counts], seen[kept, 1][-np.sum(counts) :])
    lost = np.flatnonzero(~kept)
    is_turn = np.sign(had_v[lost] - had_v[lost - 1]) != np.sign(had_v[lost + 1] - had_v[lost])
    assert np.array_equal(record.voltage_v[~counts], had_v[lost[is_turn]])
    assert np.count_nonzero(is_turn) > 20


def test_where_many_readings_are_lost_the_drive_is_told_in_between() -> None:
    # A ramp: no turn says what the drive did while nobody looked, or the loop stood still and held its last voltage.
    n = 400
    sent = np.column_stack((50.0 + PERIOD_S * np.arange(n), 0.01 * np.arange(n)))
    seen = np.column_stack((sent[:-1, 0] + 0.5 * PERIOD_S, 1.5 * sent[:-1, 1]))
    kept = np.ones(n - 1, dtype=bool)
    kept[100:145] = False
    record = heard_recording(sent, seen[kept], PERIOD_S, "heard")
    assert np.max(np.diff(record.time_s)) < 10.5 * PERIOD_S
    assert np.count_nonzero(~record.valid_samples) == 4
    assert record.voltage_v == pytest.approx(0.01 * np.floor(record.time_s / PERIOD_S + 0.51), abs=0.0101)
    stood = np.ones(n, dtype=bool)
    stood[110:141] = False
    record = heard_recording(sent[stood], seen[kept], PERIOD_S, "heard")
    assert np.count_nonzero(record.voltage_v == sent[109, 1]) == 4


def test_two_voltages_of_one_time_make_no_step_without_time() -> None:
    sent, seen, _ = sent_and_seen(0.5 * PERIOD_S, 0.5)
    sent[51::50, 0] = sent[50::50, 0][: sent[51::50].shape[0]] + 1e-9
    record = heard_recording(sent, seen, PERIOD_S, "heard")
    assert np.min(np.diff(record.time_s)) > 1e-6


def test_what_was_not_measured_at_the_same_time_is_no_record() -> None:
    sent, seen, _ = sent_and_seen(0.5 * PERIOD_S, 0.5)
    seen[:, 0] += 100.0
    with pytest.raises(FomrcError, match="are both clocks set"):
        heard_recording(sent, seen, PERIOD_S, "heard")

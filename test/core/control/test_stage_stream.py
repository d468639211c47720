"""Voltages and displacements heard at their own times become one stream, however they come in."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fomrc_core.control.stage_stream import StageStream

TIME_S = np.arange(200) * 1e-2
SENT = np.column_stack((TIME_S, np.sin(TIME_S)))
SEEN = np.column_stack((TIME_S + 4e-3, 2.0 * np.sin(TIME_S)))


def joined(samples):
    return [np.concatenate([getattr(s, name) for s in samples]) for name in ("time_s", "voltage_v", "displacement_um")]


def test_voltage_is_brought_to_the_time_of_the_displacement():
    time_s, voltage_v, moved_um = joined(StageStream(4e-3, 1e-2, 1e-2).add(SENT, SEEN, 2.0))
    np.testing.assert_allclose(moved_um, 2.0 * voltage_v, atol=1e-12)
    assert time_s.size >= 199


@given(cuts=st.lists(st.tuples(st.integers(0, 200), st.integers(0, 200)), max_size=8))
def test_it_does_not_matter_in_what_parts_they_come(cuts):
    whole = joined(StageStream(4e-3, 1e-2, 1e-2).add(SENT, SEEN, 2.0))
    stream, found = StageStream(4e-3, 1e-2, 1e-2), []
    edges = [(0, 0), *zip(sorted(c[0] for c in cuts), sorted(c[1] for c in cuts), strict=True), (200, 200)]
    for (a, b), (c, d) in pairwise(edges):
        # Not so late that anything is given up waiting for.
        found += stream.add(SENT[a:c], SEEN[b:d], 0.0)
    for one, other in zip(joined(found), whole, strict=True):
        np.testing.assert_allclose(one, other[-one.size :])
    assert joined(found)[0].size == whole[0].size


def test_a_voltage_that_comes_no_more_holds():
    samples = StageStream(0.0, 1e-2, 1e-2).add(SENT[:50], SEEN, 10.0)
    _, voltage_v, _ = joined(samples)
    assert voltage_v.size == 200
    assert np.all(voltage_v[60:] == SENT[49, 1])


def test_a_silent_sensor_begins_a_new_record():
    stream = StageStream(0.0, 1e-2, 1e-2)
    first = stream.add(SENT[:100], SEEN[:100], 1.0)
    late = np.array([5.0, 0.0])
    later = stream.add(SENT[100:] + late, SEEN[100:] + late, 7.0)
    assert first[0].begins_anew
    assert any(s.begins_anew for s in later)
    assert all(np.all(s.steps_s > 0.0) and np.all(s.steps_s < 1.0) for s in first + later)


def test_between_voltages_that_are_far_apart_the_first_was_held():
    is_sent = (np.arange(200) < 50) | (np.arange(200) >= 80)
    parts = ((SENT[:50], SEEN[:40]), (SENT[80:], SEEN[40:]))
    stream = StageStream(0.0, 1e-2, 1e-2)
    _, voltage_v, _ = joined([s for sent, seen in parts for s in stream.add(sent, seen, 0.0)])
    whole = joined(StageStream(0.0, 1e-2, 1e-2).add(SENT[is_sent], SEEN, 0.0))[1]
    np.testing.assert_allclose(voltage_v, whole)
    assert np.all(voltage_v[50:78] == SENT[49, 1])
    np.testing.assert_allclose(voltage_v[81:], np.interp(SEEN[81 : voltage_v.size, 0], *SENT.T))


def test_where_displacements_were_lost_the_voltage_goes_on():
    is_heard = (np.arange(200) < 50) | (np.arange(200) >= 80)
    parts = ((SENT[:60], SEEN[:50]), (SENT[60:], SEEN[80:]))
    stream = StageStream(4e-3, 1e-2, 1e-2)
    time_s, voltage_v, moved_um = joined([s for sent, seen in parts for s in stream.add(sent, seen, 0.0)])
    assert time_s.size >= 199
    assert np.count_nonzero(np.isnan(moved_um)) == 30
    np.testing.assert_allclose(time_s, SEEN[: time_s.size, 0])
    np.testing.assert_allclose(voltage_v, np.sin(time_s - 4e-3), atol=1e-12)
    assert np.all(np.isnan(moved_um) == ~is_heard[: time_s.size])

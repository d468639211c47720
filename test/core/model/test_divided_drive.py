"""A drive that was divided before is divided alike when it is asked for again, whatever was asked for in between."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fomrc_core.model.divided_drive import ElementDrive, KeptDivisions, divided_drive
from fomrc_core.model.simulation import relaxed_state
from fomrc_core.model.state import ModelState
from fomrc_core.model.substeps import Substeps
from fomrc_core.operators.creep import creep_modes
from fomrc_core.operators.hysteresis import OperatorSum

_N = 300
_TIMES_S = np.cumsum(np.random.default_rng(3).uniform(0.5e-3, 2e-3, _N))


def _drive(seed: int) -> ElementDrive:
    rng = np.random.default_rng(seed)
    jumps_v = np.repeat(rng.uniform(-1.0, 1.0, _N // 30), 30)
    drive_v = np.where(np.arange(_N) < _N // 2, jumps_v, np.sin(40.0 * _TIMES_S))
    return ElementDrive(np.diff(_TIMES_S, prepend=0.0), drive_v, None)


def _state(largest_v: float, last_v: float, bend_v: float) -> ModelState:
    operator = OperatorSum(1.0, np.array([0.5 * largest_v, largest_v]), np.array([0.2, 0.1]))
    state, _ = relaxed_state(operator, creep_modes(0.02, 1e-4), ())
    state.last_input, state.bend = last_v, bend_v
    return state


_ASKED = st.tuples(
    st.integers(0, 1),
    st.sampled_from([Substeps.NONE, Substeps.FEW, Substeps.JUMPS, Substeps.BENDS, Substeps.FIT, Substeps.DIRECTIONS]),
    st.sampled_from([1, 3]),
    st.sampled_from([0.8, 2.0]),
    st.sampled_from([0.0, 0.3]),
    st.sampled_from([0.0, 0.05]),
)


@given(st.lists(_ASKED, min_size=2, max_size=12))
def test_kept_divisions_change_no_answer(asked: list[tuple[int, Substeps, int, float, float, float]]) -> None:
    drives, kept = (_drive(0), _drive(1)), KeptDivisions()
    for at, substeps, n_least, largest_v, last_v, bend_v in asked:
        state, other = (_state(largest_v, last_v, bend_v) for _ in range(2))
        given_back = kept.of(state, drives[at], substeps, n_least)
        wanted = divided_drive(other, drives[at], substeps, n_least)
        assert np.array_equal(given_back.steps_s, wanted.steps_s)
        assert np.array_equal(given_back.voltage_v, wanted.voltage_v)
        assert (given_back.ends is None) == (wanted.ends is None)
        assert given_back.ends is None or np.array_equal(given_back.ends, wanted.ends)
        assert (state.last_input, state.bend) == (other.last_input, other.bend)


def test_what_is_asked_for_again_is_not_divided_again() -> None:
    drive, kept = _drive(0), KeptDivisions()
    first = kept.of(_state(1.0, 0.0, 0.0), drive, Substeps.BENDS, 1)
    coarser = kept.of(_state(1.0, 0.0, 0.0), drive, Substeps.DIRECTIONS, 1)
    assert kept.of(_state(1.0, 0.0, 0.0), drive, Substeps.BENDS, 1) is first
    assert coarser.voltage_v.size < first.voltage_v.size
    same_values = ElementDrive(drive.steps_s, drive.voltage_v.copy(), None)
    assert kept.of(_state(1.0, 0.0, 0.0), same_values, Substeps.BENDS, 1) is not first


def test_a_long_drive_is_not_kept() -> None:
    n = 150_000
    drive, kept = ElementDrive(np.full(n, 1e-3), np.resize([0.0, 0.5], n), None), KeptDivisions()
    first = kept.of(_state(1.0, 0.0, 0.0), drive, Substeps.BENDS, 1)
    assert first.voltage_v.size > 1_000_000
    assert kept.of(_state(1.0, 0.0, 0.0), drive, Substeps.BENDS, 1) is not first


@pytest.mark.parametrize("substeps", [Substeps.BENDS, Substeps.FIT])
def test_a_held_drive_is_read_as_the_mean_over_its_parts(substeps: Substeps) -> None:
    drive = _drive(0)
    held = divided_drive(_state(1.0, float(drive.voltage_v[0]), 0.0), drive, substeps, 4, is_held=True)
    before_v = np.concatenate((drive.voltage_v[:1], drive.voltage_v[:-1]))
    assert np.allclose(held.at_samples(held.voltage_v), 0.5 * (before_v + drive.voltage_v), rtol=0.0, atol=1e-12)

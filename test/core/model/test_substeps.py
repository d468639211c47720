"""Steps are divided where hysteresis and creep bend the response, and after a jump as long as creep still bends."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from fomrc_core.effects import effect_classes
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.substeps import N_PARTS_LARGE, N_SUBSTEPS, parts_of_steps, subdivide

_KAPPA, _SATURATION, _ORDER = [10.0, 25.0, 50.0, 1.3], [0.05, 0.1, 0.04], 0.03
_RINGING = effect_classes()["mechanical_resonance"](314.0, 0.0157)  # type: ignore[call-arg]


def test_the_steps_after_a_jump_are_divided_until_creep_is_straight() -> None:
    parts, bend = parts_of_steps(np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), 1.0, (_RINGING,), False)
    assert parts[0] == parts[1] == N_PARTS_LARGE
    assert parts[4] == N_SUBSTEPS
    assert parts[-1] == 1
    assert 0.0 < bend < 1e-3
    at_rest, bend = parts_of_steps(np.zeros(3), 1.0, (_RINGING,), False)
    assert at_rest.tolist() == [1, 1, 1]
    assert bend == 0.0


@given(st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=30), st.integers(1, 29))
def test_what_is_divided_does_not_depend_on_where_a_record_is_cut(changes: list[float], cut: int) -> None:
    change = np.array(changes)
    whole, end = parts_of_steps(change, 1.0, (_RINGING,), False)
    first, bend = parts_of_steps(change[:cut], 1.0, (_RINGING,), False)
    if cut >= change.size:
        np.testing.assert_array_equal(first, whole)
        return
    second, bend = parts_of_steps(change[cut:], 1.0, (_RINGING,), False, bend)
    np.testing.assert_array_equal(np.concatenate((first, second)), whole)
    assert bend == end


@given(st.lists(st.tuples(st.floats(1e-4, 1.0), st.floats(-2.0, 2.0), st.integers(1, 9)), min_size=1, max_size=20))
def test_parts_add_up_to_the_steps_they_were_made_from(rows: list[tuple[float, float, int]]) -> None:
    steps, drive, parts = (np.array(column) for column in zip(*rows, strict=True))
    fine_steps, fine_drive, ends = subdivide(steps, drive, 0.25, parts)
    np.testing.assert_array_equal(fine_drive[ends], drive)
    np.testing.assert_allclose(np.add.reduceat(fine_steps, ends - parts + 1), steps, rtol=1e-12)


@pytest.mark.parametrize("jump_v", [0.1, 0.5])
def test_a_ringing_mass_follows_a_jump_as_one_worked_fifty_times_finer(jump_v: float) -> None:
    bare = PiezoModel(_KAPPA, _SATURATION, _ORDER)  # type: ignore[arg-type]
    n_parts, step_s = 50, 1e-3
    drive = np.concatenate((np.zeros(5), np.full(200, jump_v)))
    fine = np.interp(np.arange(n_parts * drive.size + 1) / n_parts, np.arange(drive.size + 1), np.append(0.0, drive))
    creeping = bare.simulate(np.full(fine.size - 1, step_s / n_parts), fine[1:])
    # z'' + 2 d w z' + w^2 z = w^2 f by the bilinear rule at 20 us; its warping of 314 Hz is 3e-5 of the frequency
    w, h, damping = 2.0 * np.pi * _RINGING.frequency_hz, step_s / n_parts, _RINGING.damping_ratio  # type: ignore[attr-defined]
    c = 2.0 / h
    a = np.array([c * c + 2 * damping * w * c + w * w, 2 * (w * w - c * c), c * c - 2 * damping * w * c + w * w])
    expected = lfilter(w * w * np.array([1.0, 2.0, 1.0]) / a[0], a / a[0], creeping)[n_parts - 1 :: n_parts]
    moved = bare.with_effects(_RINGING).simulate(np.full(drive.size, step_s), drive)
    swing = float(np.ptp(expected))
    assert np.max(np.abs(moved - expected)) < 2e-3 * swing

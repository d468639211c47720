"""What a first fit leaves: a late reading is an excursion, a stage that stands while its drive moves is none."""

from __future__ import annotations

import numpy as np

from fomrc_core.records.quality import FaultKind, examine_residual
from fomrc_core.records.recording import Recording

N, STEP_S = 3000, 1e-3


def _found(moved_um: np.ndarray, readings_um: np.ndarray) -> np.ndarray:
    """Return the samples left out of a record whose model says where the stage would have been."""
    noise_um = np.random.default_rng(3).normal(0.0, 1e-3, N)
    record = Recording(np.arange(N) * STEP_S, 10.0 * moved_um, readings_um + noise_um, name="stage")
    faults = examine_residual(record, record.measured_um - moved_um).quality.faults
    spikes = [fault.samples for fault in faults if fault.kind is FaultKind.SPIKES]
    return np.concatenate(spikes) if spikes else np.zeros(0, dtype=np.int64)


def _moved_um() -> np.ndarray:
    """Return sines between rests, which begin and end at speed [um], shape (N,)."""
    time_s = np.arange(N) * STEP_S
    return 3.0 * np.sin(2.0 * np.pi * 1.3 * np.clip(np.abs(time_s - 1.5) - 0.2, 0.0, None))


def test_readings_that_were_late_are_left_out() -> None:
    moved_um = _moved_um()
    readings_um = moved_um.copy()
    late = np.array([200, 640, 1290, 1750, 2200])
    readings_um[late] = moved_um[late - 1]
    assert set(_found(moved_um, readings_um)) == set(late)


def test_a_stage_that_stands_while_its_drive_moves_is_not_left_out() -> None:
    moved_um = _moved_um()
    readings_um = moved_um.copy()
    readings_um[300:340] = moved_um[300]
    assert not set(_found(moved_um, readings_um)) & set(range(295, 345))


def test_a_stage_that_stands_for_few_samples_and_creeps_is_not_left_out() -> None:
    moved_um = _moved_um()
    readings_um = moved_um.copy()
    for first in (300, 700, 2100):
        stands = slice(first, first + 8)
        readings_um[stands] = moved_um[first] + 0.05 * (moved_um[stands] - moved_um[first])
    assert _found(moved_um, readings_um).size == 0

"""Readings that were moved for samples that seemed doubled go back where what was found explains them as they were."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fomrc_core.diagnosis.looked_over import LookedOver
from fomrc_core.diagnosis.prepared import Prepared
from fomrc_core.effects.clock_skew import ClockSkew
from fomrc_core.plants.electromechanical import table1_plant
from fomrc_core.records.quality import Slip
from fomrc_core.records.recording import Recording

_N, _STEP_S, _PPM = 2000, 0.01, 600.0  # 1.2 samples at the end


def _recording(seed: int, ppm: float, is_doubled: bool) -> Recording:
    time_s = _STEP_S * np.arange(_N)
    drive_v = 1.2 * np.sin(0.9 * time_s) + 0.8 * np.sin(2.3 * time_s + seed) + 0.4 * np.sin(7.1 * time_s)
    moved_um = table1_plant(20, substep_s=5e-3).simulate(_STEP_S, drive_v)
    moved_um = np.interp(time_s * (1.0 - 1e-6 * ppm), time_s, moved_um)
    if is_doubled:
        moved_um = np.concatenate((moved_um[:800], moved_um[799:-1]))
    noise_um = 1e-3 * np.random.default_rng(seed).normal(size=_N)
    return Recording(time_s, drive_v, moved_um + noise_um, name=f"record {seed}")


def _explained(ppm: float, is_doubled: bool, clock_ppm: float) -> frozenset[int]:
    looked = LookedOver.of((_recording(1, ppm, False),), _recording(2, ppm, is_doubled), None)
    given = Prepared.of(looked)
    slips: tuple[tuple[Slip, ...], ...] = ((), (Slip(800, -1),))
    moved = replace(Prepared.of(looked.without_slips(slips)), slips=slips)
    drifting = moved.base.with_cause(ClockSkew(ppm=clock_ppm))
    return moved.explained_moves(given, drifting, drifting)


def test_a_clock_that_drifts_explains_what_seemed_a_doubled_sample() -> None:
    learned = [_explained(_PPM, False, sign * _PPM) for sign in (1.0, -1.0)]
    assert frozenset({1}) in learned


def test_a_doubled_sample_is_explained_by_no_clock_that_does_not_drift() -> None:
    assert _explained(0.0, True, 1e-3) == frozenset()


def test_a_record_that_is_to_stay_as_it_was_read_is_not_moved() -> None:
    looked = LookedOver.of((_recording(1, 0.0, False),), _recording(2, 0.0, True), None)
    assert Prepared.of(looked).looked_again().moved == {1}
    assert Prepared.of(looked).looked_again(as_read=frozenset({1})).moved == frozenset()

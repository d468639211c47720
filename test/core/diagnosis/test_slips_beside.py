"""Samples that were lost beside a load are found with it, and told as no lag; two clocks are no lost samples."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core import diagnose
from fomrc_core.diagnosis.clock_or_slips import moved_by_clock
from fomrc_core.diagnosis.looked_over import LookedOver
from fomrc_core.diagnosis.prepared import Prepared
from fomrc_core.plants.electromechanical import table1_plant
from fomrc_core.records.quality import FaultKind, Slip
from fomrc_core.records.recording import Recording

_N, _STEP_S, _NOISE_UM = 3000, 0.01, 4e-3


def _drive_v(seed: int) -> np.ndarray:
    phases, t = np.random.default_rng(seed).uniform(size=4), _STEP_S * np.arange(_N)
    lines = zip((1.2, 0.8, 0.4, 0.2), (0.15, 0.37, 1.1, 2.3), phases, strict=True)
    return np.asarray(sum(size * np.sin(2.0 * np.pi * (hz * t + phase)) for size, hz, phase in lines))


def _record(seed: int, lost: list[int], *, load_um: float = 0.0, ppm: float = 0.0) -> Recording:
    time_s, drive_v = _STEP_S * np.arange(_N), _drive_v(seed)
    moved_um = table1_plant(20, substep_s=5e-3).simulate(_STEP_S, drive_v)
    moved_um = np.interp(time_s * (1.0 + 1e-6 * ppm), time_s, moved_um)
    read_um = moved_um + load_um * (np.arange(_N) >= 1400) + _NOISE_UM * np.random.default_rng(seed).normal(size=_N)
    read_um = np.pad(np.delete(read_um, lost), (0, len(lost)), mode="edge")
    return Recording(time_s, drive_v, read_um, name=f"record {seed}")


def test_a_load_and_samples_lost_beside_it_are_told_apart() -> None:
    lost = {"record 11": [1044, 2564], "record 12": [623, 1162, 1971]}
    found = diagnose(_record(11, lost["record 11"], load_um=0.4), test=_record(12, lost["record 12"]))
    assert [f.cause for f in found.findings] == ["external_load"]
    assert found.findings[0].parameters["displacement_um"] == pytest.approx(0.4, rel=0.02)
    told = {q.name: f.samples.tolist() for q in found.data_quality for f in q.faults if f.kind is FaultKind.LOST}
    assert told == {name: pytest.approx(places, abs=20) for name, places in lost.items()}


def test_readings_moved_for_two_clocks_are_left_as_they_were_read() -> None:
    given = Prepared.of(LookedOver.of([_record(1, [], ppm=-1500.0)], _record(2, [], ppm=-1500.0), None))
    moved = given.with_slips([(), (Slip(700, -1), Slip(1400, -1), Slip(2100, -1), Slip(2700, -1))])
    assert moved_by_clock(moved, given, given.base, moved.base, None) == {1}


def test_readings_moved_for_samples_that_were_lost_are_no_matter_of_clocks() -> None:
    given = Prepared.of(LookedOver.of([_record(1, [])], _record(2, [500, 900, 2600]), None))
    moved = given.with_slips([(), (Slip(500, 1), Slip(899, 1), Slip(2598, 1))])
    assert moved_by_clock(moved, given, given.base, moved.base, None) == frozenset()


def test_a_record_without_noise_of_which_samples_were_lost_is_told() -> None:
    time_s, drives_v = _STEP_S * np.arange(_N), [_drive_v(1), _drive_v(2)]
    reads_um = [np.pad(np.delete(0.5 * drives_v[0], [700, 1900]), (0, 2), mode="edge"), 0.5 * drives_v[1]]
    records = [
        Recording(time_s, v, x, name=n) for v, x, n in zip(drives_v, reads_um, ("slipped", "sound"), strict=True)
    ]
    found = diagnose(records)
    assert {(q.name, f.kind) for q in found.data_quality for f in q.faults} == {("slipped", FaultKind.LOST)}
    assert found.findings == ()

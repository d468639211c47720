"""What the effects are shown of the records: readings left out, and what stands in for them, tell nothing."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.fitting.base_fit import fit_base, threshold_grid
from fomrc_core.fitting.evidence import evidence_of
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.records.excitation import triangle
from fomrc_core.records.noise_estimate import estimate_noise
from fomrc_core.records.quality import examine
from fomrc_core.records.recording import Recording

_STEP_UM = 0.02


def coarse_record_with_spikes() -> Recording:
    drive = triangle(2.0, slope_v_per_s=2.0, n_cycles=3, rate_hz=300.0)
    rng = np.random.default_rng(5)
    moved_um = 1.4 * drive.voltage_v + 0.005 * rng.standard_normal(drive.n_samples)
    read_um = _STEP_UM * np.round(moved_um / _STEP_UM)
    read_um[[301, 702, 1203]] += [0.913, -1.217, 0.731]
    return Recording(drive.time_s, drive.voltage_v, read_um)


def test_the_step_of_a_sensor_is_seen_beside_readings_that_are_left_out() -> None:
    record = examine(coarse_record_with_spikes()).recording
    assert not np.all(record.valid_samples)
    records = (FitRecord.of(record),)
    base, _, _ = fit_base(records, ColumnKinds.plays(threshold_grid(records, 8)))
    (seen,) = evidence_of(base, records, [np.zeros(record.n_samples)], 0.01).records
    assert seen.sensor_step_um == pytest.approx(_STEP_UM, rel=1e-6)
    assert estimate_noise([record]).step_um == pytest.approx(_STEP_UM, rel=1e-6)


def test_a_few_readings_that_nothing_told_for_wrong_hide_no_step() -> None:
    coarse = coarse_record_with_spikes()
    read_um = coarse.measured_um.copy()
    read_um[[301, 702, 1203]] = _STEP_UM * np.round(1.4 * coarse.voltage_v[[301, 702, 1203]] / _STEP_UM)
    # as dropouts to a level within the range, seen where they are far off, and not where the stage comes by
    read_um[[250, 811, 1340]] = np.round(read_um[[250, 811, 1340]] / _STEP_UM) * _STEP_UM + 0.4 * _STEP_UM
    records = (FitRecord.of(Recording(coarse.time_s, coarse.voltage_v, read_um)),)
    base, _, _ = fit_base(records, ColumnKinds.plays(threshold_grid(records, 8)))
    (seen,) = evidence_of(base, records, [np.zeros(read_um.size)], 0.01).records
    assert seen.sensor_step_um == pytest.approx(_STEP_UM, rel=1e-6)
    fine_um = 1.4 * coarse.voltage_v + np.random.default_rng(6).normal(0.0, 0.005, read_um.size)
    fine = (FitRecord.of(Recording(coarse.time_s, coarse.voltage_v, fine_um)),)
    (seen,) = evidence_of(base, fine, [np.zeros(read_um.size)], 0.01).records
    assert np.isnan(seen.sensor_step_um)

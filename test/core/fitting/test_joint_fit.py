"""The joint refit: from wherever it starts it ends with a model, not with an arithmetic error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fomrc_core.effects.dead_zone import DeadZone
from fomrc_core.fitting.base_fit import fit_base, threshold_grid
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording


def test_a_start_under_which_nothing_moves_is_gone_on_from() -> None:
    model = PiezoModel([10.0, 4.0, 7.0, 1.5], [0.02, 0.1, 0.3], 0.02)  # type: ignore[arg-type]
    drive = triangle(1.0, slope_v_per_s=2.0, n_cycles=2, rate_hz=200.0)
    moved_um = model.simulate(np.full(drive.n_samples, 1.0 / 200.0), drive.voltage_v)
    # binary fractions, and as many: their mean is exact, and what is predicted is one value to the last bit
    time_s, voltage_v, moved_um = drive.time_s[:512], drive.voltage_v[:512], np.round(moved_um[:512] * 256.0) / 256.0
    records = (FitRecord.of(Recording(time_s, voltage_v, moved_um)),)
    base, _, _ = fit_base(records, ColumnKinds.plays(threshold_grid(records, 12)))
    # a dead zone wider than the drive: every direction is flat, and the prediction is one value
    still = replace(base, effects=(DeadZone(half_width_v=1e3),))
    found = refit(still, records, n_iterations=3)
    assert np.isfinite(found.squared_error)
    assert found.squared_error <= float(np.sum((moved_um - np.mean(moved_um)) ** 2)) * (1.0 + 1e-9)

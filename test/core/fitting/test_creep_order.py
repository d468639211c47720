"""A fit finds any creep order a model may have: none is clipped on the way."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.identification.convex import identify
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording


@pytest.mark.parametrize("order", [0.05, 0.5, 0.9])
def test_an_order_far_from_the_usual_one_is_found(order: float) -> None:
    model = PiezoModel([10.0, 4.0, 7.0, 1.5], [0.02, 0.1, 0.3], order)  # type: ignore[arg-type]
    drive = triangle(1.0, slope_v_per_s=2.0, n_cycles=5, rate_hz=200.0)
    moved_um = model.simulate(np.full(drive.n_samples, 1.0 / 200.0), drive.voltage_v)
    noise_um = np.random.default_rng(1).normal(0.0, 1e-4 * float(np.ptp(moved_um)), moved_um.size)
    found = identify(Recording(drive.time_s, drive.voltage_v, moved_um + noise_um), n_elements=3)
    assert found.model.creep_order == pytest.approx(order, rel=0.01)

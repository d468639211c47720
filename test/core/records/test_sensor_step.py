"""The step of a coarse sensor, whose readings may have been moved and rounded since."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.records.quality.examination import reading_faults
from fomrc_core.records.recording import Recording
from fomrc_core.records.sensor_step import recurring_step_um, sensor_step_um

STEP_UM, N = 4.3e-4, 6000


def _record(is_rounded: bool) -> Recording:
    """Return swings that grow quicker, behind an amplifier that overshoots, read by a coarse sensor."""
    time_s = np.arange(N) / 2.6e4
    phase = 2.0 * np.pi * (5.0 * time_s + 60.0 * time_s**2)
    drive_v = 150.0 * np.sin(phase)
    moved_um = 0.021 * np.sin(phase - 0.7) + 0.004 * np.sin(2.0 * phase)
    readings_um = STEP_UM * np.round(moved_um / STEP_UM)
    if is_rounded:
        readings_um = np.where(np.random.default_rng(2).random(N) < 0.5, np.nextafter(readings_um, 1.0), readings_um)
    return Recording(time_s, drive_v, readings_um, name="coarse")


@pytest.mark.parametrize("is_rounded", [False, True])
def test_a_level_that_is_the_same_to_rounding_is_one_level(is_rounded: bool) -> None:
    record = _record(is_rounded)
    assert recurring_step_um(record.measured_um) == pytest.approx(STEP_UM, rel=1e-9)
    assert sensor_step_um(record.measured_um) == pytest.approx(STEP_UM, rel=1e-9)
    assert reading_faults(record) == []

"""A converter's steps are proposed by what they leave over the drive, a handful over the range or thousands."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.effects.base.evidence import Evidence, RecordEvidence
from fomrc_core.effects.dac_quantization import DacQuantization


@pytest.mark.parametrize("cut_share", [0.0, 0.5])
@pytest.mark.parametrize("n_steps", [6.4, 16.6, 43.7, 611.3])
def test_a_step_is_proposed_however_coarse_the_converter_is(n_steps: float, cut_share: float) -> None:
    n, range_v, um_per_v = 9000, 198.0, 0.05
    turn = np.abs((np.arange(n) / 1500.0 + 1.0) % 2.0 - 1.0)
    drive_v = range_v * (turn * (0.4 + 0.6 * np.arange(n) / n) - 0.3)
    step_v = float(np.ptp(drive_v)) / n_steps
    rounded_v = step_v * np.round(drive_v / step_v - cut_share)
    rng = np.random.default_rng(round(n_steps))
    # a base has taken the mean of it
    left_um = um_per_v * (rounded_v - drive_v + cut_share * step_v) + rng.normal(0.0, 0.1 * um_per_v * step_v, n)
    record = RecordEvidence(1e-2 * np.arange(n), np.full(n, 1e-2), drive_v, um_per_v * drive_v, left_um)
    proposed = DacQuantization.screening(Evidence((record,), 0.1 * um_per_v * step_v))
    off = [abs(float(np.ptp(drive_v)) / trial.step_v - n_steps) for trial in proposed if trial.cut_share == cut_share]
    assert min(off) < 0.5, "in steps over the range, as far as a scan goes about a trial"

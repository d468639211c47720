"""A converter's step is found from as far away as a spectrum over the drive leaves it, few steps or thousands."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.effects.dac_quantization import DacQuantization
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.free_parameters import FreeParameter
from fomrc_core.fitting.joint_fit import scan
from fomrc_core.fitting.linear_part import tangent
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.recording import Recording

PLAIN = TrialModel(ColumnKinds.plays(np.array([0.0, 10.0])), np.array([1.5, 0.3]), 0.02, (), ((),))


@pytest.mark.parametrize("n_steps", [25.3, 43.7, 611.4, 6007.6])
@pytest.mark.parametrize("off", [-0.4, 0.3])
def test_a_step_is_scanned_as_far_as_its_period_is_uncertain(n_steps: float, off: float) -> None:
    n, range_v = 9000, 80.0
    drive_v = 0.5 * range_v * (1.0 - np.cos(np.arange(n) / n * 3.0 * np.pi)) + 1e-3 * np.sin(np.arange(n) * 0.7)
    step_v = range_v / n_steps
    rng = np.random.default_rng(round(n_steps))
    time_s, rounded_v = 1e-3 * np.arange(n), step_v * np.rint(drive_v / step_v)
    moved_um = predict(PLAIN, FitRecord.of(Recording(time_s, rounded_v, rounded_v)), 0)
    record = FitRecord.of(Recording(time_s, drive_v, moved_um + rng.normal(0.0, 0.05 * step_v, n)))
    begun = PLAIN.with_cause(DacQuantization(range_v / (n_steps + off)))
    parameter = FreeParameter("dac_quantization", None, DacQuantization.parameter("step_v"), 1.0)
    found = parameter.get(scan(begun, (record,), tangent(PLAIN, (record,)), parameter))
    assert abs(range_v / found - n_steps) < 0.02, "in steps over the range of the drive"


@pytest.mark.parametrize("seed", range(6))
def test_of_steps_that_round_every_sample_alike_the_middle_is_told(seed: int) -> None:
    """The ends of that stretch leave the same, and other records of the same converter are rounded wrongly there."""
    n, range_v, n_steps = 300, 80.0, 43.7
    rng = np.random.default_rng(seed)
    drive_v = 0.5 * range_v * (1.0 - np.cos(np.arange(n) / n * 3.0 * np.pi + rng.uniform(0.0, 6.0)))
    step_v = range_v / n_steps
    levels = np.rint(drive_v / step_v)
    time_s, rounded_v = 1e-2 * np.arange(n), step_v * levels
    moved_um = predict(PLAIN, FitRecord.of(Recording(time_s, rounded_v, rounded_v)), 0)
    record = FitRecord.of(Recording(time_s, drive_v, moved_um + rng.normal(0.0, 0.01 * step_v, n)))
    begun = PLAIN.with_cause(DacQuantization(range_v / (n_steps + 0.2)))
    parameter = FreeParameter("dac_quantization", None, DacQuantization.parameter("step_v"), 1.0)
    found = range_v / parameter.get(scan(begun, (record,), tangent(PLAIN, (record,)), parameter))
    offs = np.linspace(-0.1, 0.1, 20001)
    alike = [off for off in offs if np.array_equal(np.rint(drive_v * (n_steps + off) / range_v), levels)]
    low, high = n_steps + min(alike), n_steps + max(alike)
    assert low + 0.15 * (high - low) < found < high - 0.15 * (high - low), (low, high, found)

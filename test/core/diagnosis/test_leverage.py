"""A held-out stretch says something about a model only where what was learned determines the model there."""

from __future__ import annotations

import numpy as np

from fomrc_core.diagnosis.leverage import determined
from fomrc_core.fitting.fit_record import FitRecord
from fomrc_core.fitting.joint_fit import refit
from fomrc_core.fitting.linear_part import squared_error
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel, predict
from fomrc_core.records.excitation import triangle
from fomrc_core.records.recording import Recording

RATE_HZ = 200.0
PLAIN = TrialModel(ColumnKinds.plays(np.linspace(0.0, 1.9, 20)), np.linspace(1.0, 0.1, 20), 0.02, (), ((),))


def _record() -> tuple[FitRecord, np.ndarray]:
    """Return one rise to the highest voltage and then small triangles, and which samples are of its top."""
    once = triangle(2.0, slope_v_per_s=2.0, n_cycles=1, rate_hz=RATE_HZ).voltage_v
    small = triangle(0.8, slope_v_per_s=2.0, n_cycles=12, rate_hz=RATE_HZ).voltage_v
    voltage_v = np.concatenate((once, small[1:]))
    time_s = np.arange(voltage_v.size) / RATE_HZ
    moved_um = predict(PLAIN, FitRecord.of(Recording(time_s, voltage_v, voltage_v)), 0)
    noise_um = np.random.default_rng(1).normal(0.0, 1e-3, time_s.size)
    first_fall = int(np.argmax(voltage_v)) + 1
    is_top = (np.arange(time_s.size) < first_fall) & (voltage_v > 1.6)
    return FitRecord.of(Recording(time_s, voltage_v, moved_um + noise_um)), is_top


def test_the_only_visit_of_a_part_of_the_curve_is_not_determined_by_the_rest():
    record, is_top = _record()
    near = np.abs(record.voltage_v) > 1.0  # the fall and the return move the same plays by twice their thresholds
    learned = record.using(~near)
    (found,) = determined(PLAIN, (learned,), (near,))
    assert not np.any(found & ~near)
    assert not np.any(found & is_top)
    # and what is not determined is indeed not foreseen, though the model is the true one
    fitted = refit(PLAIN, (learned,), n_iterations=4)
    left = record.measured_um - predict(fitted.model, record, 0)
    assert np.std(left[is_top]) > 3e-3
    assert squared_error((learned,), (left,)) < 1.1e-6 * np.count_nonzero(~near)


def test_a_repeat_is_determined_by_the_others():
    record, _ = _record()
    n = record.time_s.size
    last = np.arange(n) > int(0.85 * n)
    (found,) = determined(PLAIN, (record.using(~last),), (last,))
    assert np.array_equal(found, last)

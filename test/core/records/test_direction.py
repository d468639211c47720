"""A record whose sign is reversed is refused, a stage beyond its resonance is not."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core import diagnose, identify
from fomrc_core.compute.arrays import Array
from fomrc_core.errors import RecordingError
from fomrc_core.records.direction import falls_with_voltage
from fomrc_core.records.recording import Recording


def _ring(voltage_v: Array, step_s: float, resonance_hz: float) -> Array:
    # An oscillator of unit gain, damped by 2 %, by leapfrog at a thousandth of its period.
    n_fine = max(round(step_s * resonance_hz * 1000), 1)
    fine_s, omega = step_s / n_fine, 2.0 * np.pi * resonance_hz
    x = rate = 0.0
    moved = np.zeros(voltage_v.size)
    for k, v in enumerate(voltage_v):
        for _ in range(n_fine):
            rate += fine_s * (omega**2 * (v - x) - 0.04 * omega * rate)
            x += fine_s * rate
        moved[k] = x
    return moved


def test_a_reversed_record_is_refused_by_fit_and_diagnosis() -> None:
    time_s = 1e-3 * np.arange(3000)
    voltage_v = 2.0 * np.sin(2.0 * np.pi * time_s)
    moved_um = -1.3 * voltage_v + 1e-3 * np.random.default_rng(1).normal(size=time_s.size)
    record = Recording(time_s, voltage_v, moved_um, name="backwards")
    for answer in (identify, diagnose):
        with pytest.raises(RecordingError, match=r"backwards: displacement_um.*falls where the voltage rises"):
            answer(record)


def test_beyond_a_resonance_the_slow_part_says_the_sign() -> None:
    step_s = 1e-3
    time_s = step_s * np.arange(1500)
    slow, fast = np.sin(2.0 * np.pi * 2.0 * time_s), np.sin(2.0 * np.pi * 65.0 * time_s)
    voltage_v = 0.5 * slow + fast
    moved_um = _ring(voltage_v, step_s, 50.0)
    assert float(np.corrcoef(voltage_v, moved_um)[0, 1]) < -0.5
    assert not falls_with_voltage(voltage_v, moved_um)
    assert falls_with_voltage(slow, -_ring(slow, step_s, 50.0))

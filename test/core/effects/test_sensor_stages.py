"""A sensor whose stages are all alike, beside one with a Butterworth filter and the delay that is like either."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import bilinear, lfilter

from fomrc_core.effects.sensor_bandwidth import SensorBandwidth


@pytest.mark.parametrize("n_stages", [2, 3, 4])
def test_the_sensor_may_be_stages_alike_one_behind_the_other(n_stages) -> None:
    n_fine, step_s = 50, 1e-3
    turns = np.interp(np.arange(600), [0, 40, 200, 210, 450, 600], [0.0, 1.0, 0.2, -0.5, 0.7, 0.0])
    rate_per_s = 2.0 * np.pi * 80.0 / np.sqrt(2.0 ** (1.0 / n_stages) - 1.0)  # together -3 dB at 80 Hz
    stages = np.interp(np.arange(600 * n_fine) / n_fine, np.arange(600), turns)
    for _ in range(n_stages):
        b, a = bilinear([rate_per_s], [1.0, rate_per_s], n_fine / step_s)
        stages = lfilter(b, a, stages)
    effect = SensorBandwidth(80.0, float(n_stages), in_stages=1.0)
    found = effect.run(effect.initial_state(), turns, np.full(600, step_s))
    # poles a tenth apart stand for equal ones: a thousandth of the range, where a Butterworth filter is a tenth off
    assert np.max(np.abs(found - stages[::n_fine])) < 3e-3
    sharp = SensorBandwidth(80.0, float(n_stages))
    assert np.max(np.abs(sharp.run(sharp.initial_state(), turns, np.full(600, step_s)) - stages[::n_fine])) > 2e-2


def test_one_stage_is_one_pole() -> None:
    assert SensorBandwidth(80.0, 1.0, in_stages=1.0) == SensorBandwidth(80.0, 1.0)
    assert (
        SensorBandwidth(80.0, 2.0, 1.0).form() != SensorBandwidth(80.0, 2.0).form() == SensorBandwidth(9.0, 2.0).form()
    )


@pytest.mark.parametrize("in_stages", [0.0, 1.0])
@pytest.mark.parametrize("n_poles", [1.0, 2.0, 4.0])
def test_a_slow_ramp_is_read_as_late_as_behind_the_delay(n_poles: float, in_stages: float) -> None:
    sensor = SensorBandwidth(5.0, n_poles, in_stages)
    delay_s = sensor.kin()["transport_delay"]["delay_s"]
    step_s = 1e-3
    ramp_um = np.arange(5000) * step_s
    read_um = sensor.run(sensor.initial_state(), ramp_um, np.full(ramp_um.size, step_s))
    print(n_poles, in_stages, delay_s, ramp_um[-1] - read_um[-1])
    assert ramp_um[-1] - read_um[-1] == pytest.approx(delay_s, abs=step_s)


def test_the_other_forms_of_a_sensor_are_read_as_late() -> None:
    sensor = SensorBandwidth(40.0, 2.0, in_stages=1.0)
    others = sensor.other_forms()
    assert len({each.form() for each in (sensor, *others)}) == len(others) + 1 == 7
    late_s = sensor.kin()["transport_delay"]["delay_s"]
    assert [o.kin()["transport_delay"]["delay_s"] for o in others] == pytest.approx([late_s] * len(others))

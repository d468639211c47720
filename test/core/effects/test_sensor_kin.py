"""A sensor of many poles is compared with the delay it is like."""

from __future__ import annotations

import numpy as np
import pytest

from fomrc_core.effects.sensor_bandwidth import SensorBandwidth


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

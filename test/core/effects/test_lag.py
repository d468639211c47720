"""A lag of a hundredth of a sample is no cause: what the drive does between two samples nobody has read."""

from __future__ import annotations

import math

import pytest

from fomrc_core.effects import Effect
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.sensor_bandwidth import SensorBandwidth
from fomrc_core.effects.transport_delay import TransportDelay
from fomrc_core.effects.unequal_lag import UnequalLag
from fomrc_core.effects.voltage_dependent_capacitance import VoltageDependentCapacitance


def _lagging(lag_s: float) -> list[Effect]:
    cutoff_hz = 1.0 / (2.0 * math.pi * lag_s)
    return [
        AmplifierBandwidth(cutoff_hz),
        SensorBandwidth(cutoff_hz),
        SensorBandwidth(cutoff_hz, n_poles=4.0, in_stages=1.0),
        TransportDelay(lag_s),
        UnequalLag(lag_s, 0.5 * lag_s),
        VoltageDependentCapacitance(lag_s, 1e-3),
    ]


@pytest.mark.parametrize("step_s", [1e-5, 1e-2, 10.0], ids=lambda step_s: f"{step_s:g} s")
def test_a_lag_is_seen_from_a_twentieth_of_a_sample_on(step_s):
    for short, seen in zip(_lagging(0.01 * step_s), _lagging(0.1 * step_s), strict=True):
        assert not short.is_plausible(1e3 * step_s, step_s), short
        assert seen.is_plausible(1e3 * step_s, step_s), seen

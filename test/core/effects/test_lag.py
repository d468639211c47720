"""A lag of a hundredth of a sample is no cause: what the drive does between two samples nobody has read."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fomrc_core.effects import Effect
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.drive_resonance import DriveResonance
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
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


@pytest.mark.parametrize("resonance", [DriveResonance, MechanicalResonance])
def test_what_hardly_peaks_is_a_lag_and_no_resonance(resonance):
    # what is fitted to a sensor of two poles lies on either side of where peaks end
    for damping_ratio in (0.1, 0.4, 0.6, 0.69, math.sqrt(0.5) - 1e-4, 0.75):
        effect = resonance(100.0, damping_ratio)
        peak = float(np.max(np.abs(effect.response(np.linspace(1.0, 200.0, 20_000)))))
        assert effect.is_plausible(10.0, 1e-3) == (peak > 1.01), damping_ratio

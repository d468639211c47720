"""One instance of each cause that came after the first eighteen, strong enough to see in a short record."""

from __future__ import annotations

from fomrc_core.effects import Effect
from fomrc_core.effects.amplitude_dependent_creep import AmplitudeDependentCreep
from fomrc_core.effects.backlash import Backlash
from fomrc_core.effects.charge_leak import ChargeLeak
from fomrc_core.effects.creep_law import CreepLaw
from fomrc_core.effects.cyclic_sensor_error import CyclicSensorError
from fomrc_core.effects.drive_resonance import DriveResonance
from fomrc_core.effects.intermittent_contact import IntermittentContact
from fomrc_core.effects.lost_preload import LostPreload
from fomrc_core.effects.rate_dependent_hysteresis import RateDependentHysteresis
from fomrc_core.effects.second_mode import SecondMode
from fomrc_core.effects.sensor_bandwidth import SensorBandwidth
from fomrc_core.effects.unequal_lag import UnequalLag
from fomrc_core.effects.unnamed import Unnamed
from fomrc_core.effects.unnamed_converter import UnnamedConverter
from fomrc_core.effects.unnamed_drive import UnnamedDrive
from fomrc_core.effects.unnamed_in_time import UnnamedInTime
from fomrc_core.effects.unnamed_ringing import UnnamedRinging
from fomrc_core.effects.unnamed_second_axis import UnnamedSecondAxis
from fomrc_core.effects.unnamed_static import UnnamedStatic
from fomrc_core.effects.unnamed_temperature import UnnamedTemperature
from fomrc_core.effects.voltage_dependent_capacitance import VoltageDependentCapacitance
from fomrc_core.effects.zero_order_hold import ZeroOrderHold

NEW_EFFECTS: list[Effect] = [
    ZeroOrderHold(hold_s=0.003),
    DriveResonance(frequency_hz=90.0, damping_ratio=0.3),
    UnequalLag(rising_s=2e-3, falling_s=6e-3),
    VoltageDependentCapacitance(time_constant_s=3e-3, per_v=0.4),
    ChargeLeak(time_constant_s=0.2),
    RateDependentHysteresis(per_v_per_s=0.02),
    CreepLaw(per_decade=0.02, onset_s=0.003, first_share=0.01, first_s=0.02, second_share=0.02, second_s=0.1),
    AmplitudeDependentCreep(per_decade_per_um=0.01, onset_s=0.002),
    LostPreload(kink_um=0.4, slope_change=-0.2),
    Backlash(gap_um=0.1),
    IntermittentContact(contact_um=0.5, stiffness_share=0.2, adhesion_um=0.1),
    SecondMode(frequency_hz=70.0, damping_ratio=0.03, participation=0.2),
    SensorBandwidth(cutoff_hz=60.0, n_poles=3.0),
    CyclicSensorError(period_um=0.3, sine_um=0.01, cosine_um=-0.005, second_sine_um=0.003),
    Unnamed(
        weights_um=(0.02, -0.03, 0.01, 0.005),
        powers=(2.0, 0.0, 1.0, 1.0),
        lags_s=(0.0, 0.02, 0.05, 0.1),
        lag_powers=(1.0, 1.0, 2.0, 0.0),
        thresholds=(0.0, 0.1, 0.0, 0.0),
        span_um=3.0,
    ),
    UnnamedInTime(
        (0.01, -0.02, 0.01, 0.02), (1.0, 2.0, 1.0, 1.0), (0.0, 1.0, 2.0, 0.0), (0.0, 0.0, 0.0, 0.03), 3.0, 0.0, 0.4
    ),
    UnnamedSecondAxis(
        (0.02, 0.01, -0.02, 0.01), (1.0, 2.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0), (0.0, 0.0, 0.02, 0.04), 3.0, 0.1, 0.8
    ),
    UnnamedTemperature((0.02, -0.01, 0.03), (1.0, 0.0, 2.0), (1.0, 0.0, 0.0), (0.0, 0.05, 0.0), 3.0, 21.0, 2.0),
    UnnamedStatic((0.02, -0.03, 0.005), (-0.2, 0.3, 0.0), (0.0, 0.0, 2.5), (0.0, 0.0, 0.25), 3.0),
    UnnamedDrive((-0.1, 0.2, -0.1, 0.05), (5.0, 200.0, 60.0, 60.0), (0.0, 0.0, 200.0, 200.0), (0.0, 1.0, 1.0, 2.0)),
    UnnamedConverter((-0.02, 0.01), (0.03, 0.1), (0.0, 0.25), (0.0, 1.0)),
    UnnamedRinging((0.2, 0.1, 0.1), (30.0, 30.0, 400.0), (300.0, 300.0, 0.0), (1.0, 2.0, 1.0)),
]

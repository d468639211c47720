"""Rasters on the electromechanical plant, with a model diagnosed from recordings of it.

The plant rings at 300 Hz (damping 0.02) behind an amplifier of 500 Hz; 1 nm of noise. The voltage is made from its
recordings alone. What limits the figures is the model: by the model itself the error is below 1e-3 % of the range.
It is as good as what it is diagnosed from is like what it is for (raster_recordings.py): the multisine swings as far as
the rasters, up to a third of the resonance. One to 400 Hz rings the mass. Hysteresis feels that motion in the plant
and not in any model here, in which the mass comes behind it; the creep order then makes up for it.

    python -m benchmarks.diagnosed_raster        minutes
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.fast_scans import STEP_S, raster_um, target_of
from fomrc_core.diagnosis.diagnosis import diagnose
from fomrc_core.model.compensator import Compensator
from fomrc_core.model.dynamic_inverse import DynamicInverse
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.plants.electromechanical import table1_plant
from fomrc_core.plants.simulated_rig import SimulatedRig
from fomrc_core.records.excitation import multisine, staircase, triangle
from fomrc_core.records.residual import nrmse_percent

RATE_HZ = 2000.0
_SWING_V = 1.5  # of the multisine: about as far as the rasters go, 4 um at 1.25 um/V
_HIGHEST_HZ = 100.0  # of it: a third of the resonance, beyond which the mass moves other than what drives it
_N_FADED, _N_PERIODS = 4, 6


def rig() -> SimulatedRig:
    """The plant with an amplifier, converters and 1 nm of noise."""
    return SimulatedRig(table1_plant(40, resonance_hz=300.0, damping_ratio=0.02, substep_s=1.0), 500.0)


def diagnosed_model(stage: SimulatedRig, first_seed: int = 0) -> PiezoModel:
    """The model diagnosed from a triangle and a multisine, accepted on a staircase; the sensor is known as fast.

    Noise and phases are of ``first_seed`` and those behind it.
    """
    drives = (
        triangle(slope_v_per_s=10.0, rate_hz=RATE_HZ),
        multisine(_SWING_V, lowest_hz=2.0, highest_hz=_HIGHEST_HZ, period_s=0.5, seed=first_seed, rate_hz=RATE_HZ),
    )
    test = stage.measure(staircase(dwell_s=0.05, step_v=0.5, rate_hz=RATE_HZ), seed=first_seed + 9)
    records = [stage.measure(drive, seed=first_seed + k) for k, drive in enumerate(drives)]
    return diagnose(records, test=test, excluded_causes=("sensor_bandwidth", "mains_hum")).extended_model


def raster_percent(stage: SimulatedRig, voltage_v: np.ndarray, desired_um: np.ndarray) -> float:
    """NRMSE [%] of the sixth period after four in which the voltage is faded in."""
    played_v = np.tile(voltage_v, _N_FADED + _N_PERIODS)
    fade = np.minimum(np.arange(played_v.size) / (_N_FADED * voltage_v.size), 1.0)
    moved_um = stage.displacement_um(np.full(played_v.size, STEP_S), played_v * (0.5 - 0.5 * np.cos(np.pi * fade)))
    return nrmse_percent(desired_um, moved_um[-desired_um.size :])


def static_voltage_v(model: PiezoModel, desired_um: np.ndarray) -> np.ndarray:
    """The fourth period of the inverse without a future."""
    n_samples = desired_um.size
    return Compensator(model).run(np.full(4 * n_samples, STEP_S), np.tile(desired_um, 4))[-n_samples:]


def main() -> None:
    """Print the model and the error of each raster, by two sets of seeds."""
    stage = rig()
    for first_seed in (0, 20):
        model = diagnosed_model(stage, first_seed)
        print(model)
        for frequency_hz in (10.0, 30.0):
            desired_um = raster_um(frequency_hz, 4.0)
            voltage_v = DynamicInverse(model).run(target_of(desired_um, is_periodic=True)).voltage_v
            dynamic = raster_percent(stage, voltage_v, desired_um)
            static = raster_percent(stage, static_voltage_v(model, desired_um), desired_um)
            plain = raster_percent(stage, static_voltage_v(replace(model, effects=()), desired_um), desired_um)
            print(
                f"{frequency_hz:g} Hz: NRMSE {dynamic:.3g} %; without a future {static:.3g} %, {static / dynamic:.1f}"
            )
            print(f"  times as much; of hysteresis and creep alone {plain:.3g} %, {plain / dynamic:.1f} times")


if __name__ == "__main__":
    main()

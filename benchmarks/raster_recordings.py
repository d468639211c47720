"""What to record for fast scans: rasters by models of one form, each fitted to another recording of one plant.

The form is given (hysteresis, creep, amplifier, resonance), so that nothing hangs on which causes are found; what
differs is what the electromechanical plant was driven with beside a slow triangle. 1 nm of noise.

    python -m benchmarks.raster_recordings        half a minute
"""

from __future__ import annotations

import numpy as np

from benchmarks.diagnosed_raster import RATE_HZ, raster_percent, rig
from benchmarks.fast_scans import STEP_S, raster_um, target_of
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.effects.mechanical_resonance import MechanicalResonance
from fomrc_core.fitting.base_fit import threshold_grid
from fomrc_core.fitting.fit_record import FitRecord, shortest_time
from fomrc_core.fitting.joint_fit import fit_until_still
from fomrc_core.fitting.play_columns import ColumnKinds
from fomrc_core.fitting.trial_model import TrialModel
from fomrc_core.model.dynamic_inverse import DynamicInverse
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.model.substeps import Substeps
from fomrc_core.operators.hysteresis import OperatorSum, elements_from_play_form
from fomrc_core.plants.simulated_rig import SimulatedRig
from fomrc_core.records.excitation import Excitation, multisine, triangle
from fomrc_core.records.recording import Recording

_N_PERIODS, _N_FADED = 8, 2
_GAIN_UM_PER_V = 1.25
_NAMED_HZ = (500.0, 305.0, 0.02)  # where the fit begins: amplifier, resonance, damping


def raster_drive(frequency_hz: float) -> Excitation:
    """A raster of 4 um by a constant gain: rounded to 150 Hz, faded in over two periods."""
    one = raster_um(frequency_hz, 4.0) / _GAIN_UM_PER_V
    fade = np.minimum(np.arange(_N_PERIODS * one.size) / (_N_FADED * one.size), 1.0)
    every = round(1.0 / (STEP_S * RATE_HZ))
    voltage_v = (np.tile(one, _N_PERIODS) * (0.5 - 0.5 * np.cos(np.pi * fade)))[::every]
    return Excitation(np.arange(voltage_v.size) / RATE_HZ, voltage_v, "raster")


def drives() -> dict[str, Excitation]:
    """What is recorded beside a triangle of 10 V/s, by name."""
    bands = ((1.5, 400.0), (0.3, 400.0), (1.5, 150.0), (1.0, 150.0), (1.5, 100.0))
    beside = {
        f"multisine of {amplitude_v:g} V to {highest_hz:g} Hz": multisine(
            amplitude_v, lowest_hz=2.0, highest_hz=highest_hz, period_s=0.5, rate_hz=RATE_HZ
        )
        for amplitude_v, highest_hz in bands
    }
    return beside | {"raster of 20 Hz": raster_drive(20.0)}


def fitted(recordings: list[Recording]) -> tuple[PiezoModel, list[float]]:
    """The model of the given form, elements of either weight left as positive, and what each record leaves [nm rms]."""
    records = tuple(FitRecord.of(recording, substeps=Substeps.BENDS) for recording in recordings)
    grid_v = threshold_grid(records, 60)
    amplifier_hz, resonance_hz, damping = _NAMED_HZ
    trial = TrialModel(
        ColumnKinds.plays(grid_v),
        np.where(np.arange(grid_v.size) == 0, 1.0, 0.0),
        0.015,
        (AmplifierBandwidth(amplifier_hz), MechanicalResonance(resonance_hz, damping)),
        tuple(() for _ in records),
        grid_v=grid_v,
        starts=tuple(None for _ in records),
        shortest_time_s=shortest_time(records),
    )
    found = fit_until_still(trial, records)
    left_nm = [1e3 * float(np.std(v[r.is_used])) for v, r in zip(found.residual, records, strict=True)]
    form = found.model.operator()
    has_weight = form.weights > 0.0
    kappa, saturation = elements_from_play_form(
        OperatorSum(form.slope, form.thresholds[has_weight], form.weights[has_weight])
    )
    return PiezoModel(kappa, saturation, found.model.creep_order, effects=found.model.effects), left_nm


def scan_percent(stage: SimulatedRig, model: PiezoModel, frequency_hz: float) -> float:
    """NRMSE [%] of a raster with the model's dynamic inverse."""
    desired_um = raster_um(frequency_hz, 4.0)
    return raster_percent(
        stage, DynamicInverse(model).run(target_of(desired_um, is_periodic=True)).voltage_v, desired_um
    )


def main() -> None:
    """Print how each recording's model follows rasters."""
    stage = rig()
    slow = stage.measure(triangle(slope_v_per_s=10.0, rate_hz=RATE_HZ), seed=0)
    for name, drive in drives().items():
        model, left_nm = fitted([slow, stage.measure(drive, seed=1)])
        rate = float(np.std(np.diff(drive.voltage_v))) * RATE_HZ
        scans = ", ".join(f"{scan_percent(stage, model, hz):.3f} % at {hz:g} Hz" for hz in (10.0, 30.0))
        print(f"{name} ({rate:.0f} V/s rms): leaves {left_nm[1]:.2f} nm, creep order {model.creep_order:.4f};")
        print(f"  rasters {scans}")


if __name__ == "__main__":
    main()

"""Where a simulation is wrong, and why: a slow amplifier is hidden in recordings, and found.

python examples/diagnose.py
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from fomrc_core import Recording, diagnose, read_model
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.model.substeps import Substeps
from fomrc_core.records.excitation import multisine, triangle

model = read_model(Path(__file__).parents[1] / "config" / "pi_p753_table1.yaml")
# A stage knows nothing of samples: its hysteresis bends the response within a step as well.
stage = replace(model.with_effects(AmplifierBandwidth(cutoff_hz=40.0)), substeps=Substeps.BENDS)
noise = np.random.default_rng(2)


def measured(drive: Recording) -> Recording:
    """Return the drive with what a sensor of 2 nm noise sees of the stage."""
    moved_um = stage.simulate(drive.steps_s, drive.voltage_v) + noise.normal(0.0, 2e-3, drive.n_samples)
    return Recording(drive.time_s, drive.voltage_v, moved_um, name=drive.name)


slow = measured(triangle(slope_v_per_s=5.0, rate_hz=500.0).to_recording())
fast = measured(multisine(highest_hz=50.0, period_s=2.0, n_periods=3, rate_hz=500.0).to_recording())
other = measured(multisine(highest_hz=50.0, period_s=2.0, n_periods=2, seed=1, rate_hz=500.0).to_recording())

found = diagnose([slow, fast], test=other)
print(found)
print(found.extended_model)

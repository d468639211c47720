"""What a voltage does: the paper's actuator under a triangle, forwards and with what an amplifier adds.

python examples/simulate.py
"""

from pathlib import Path

import numpy as np

from fomrc_core import read_model
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.records.excitation import triangle

model = read_model(Path(__file__).parents[1] / "config" / "pi_p753_table1.yaml")
print(model)

drive = triangle(slope_v_per_s=20.0, n_cycles=3, rate_hz=1000.0).to_recording()
displacement_um = model.simulate(drive.steps_s, drive.voltage_v)
print(f"moves from {displacement_um.min():.3f} to {displacement_um.max():.3f} um")

# An effect makes another model; the first one is as it was.
slower = model.with_effects(AmplifierBandwidth(cutoff_hz=50.0))
lag_um = displacement_um - slower.simulate(drive.steps_s, drive.voltage_v)
print(f"an amplifier of 50 Hz changes that by up to {1e3 * np.max(np.abs(lag_um)):.1f} nm")

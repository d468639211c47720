"""The voltage that makes an actuator follow a target, beside the voltage a plain gain gives.

The actuator here is the model itself, so the compensated error is that of rounding. On a stage it is what the
model leaves over.

    python examples/compensate.py
"""

from pathlib import Path

import numpy as np

from fomrc_core import Compensator, read_model

model = read_model(Path(__file__).parents[1] / "config" / "pi_p753_table1.yaml")

time_s = np.arange(4000) * 1e-3
steps_s = np.full(time_s.size, 1e-3)
desired_um = 2.0 * np.sin(2.0 * np.pi * time_s)

voltage_v = Compensator(model).run(steps_s, desired_um)
reached_um = model.simulate(steps_s, voltage_v)

plain_v = desired_um * np.ptp(voltage_v) / np.ptp(desired_um)
plain_um = model.simulate(steps_s, plain_v)

for name, moved_um in (("plain gain", plain_um), ("compensated", reached_um)):
    error_percent = 100.0 * np.max(np.abs(moved_um - desired_um)) / np.ptp(desired_um)
    print(f"{name}: largest error {error_percent:.2g} % of the stroke")

"""From a recording to a model: fit it, judge it on a second recording, write it as a file that ROS reads too.

python examples/identify.py
"""

import tempfile
from pathlib import Path

import numpy as np

from fomrc_core import Recording, identify, read_model, write_model
from fomrc_core.records.excitation import staircase, triangle

# In place of a measurement: the paper's actuator, 1 nm of noise, an offset nobody knows.
actuator = read_model(Path(__file__).parents[1] / "config" / "pi_p753_table1.yaml")
noise = np.random.default_rng(1)


def measured(drive: Recording) -> Recording:
    """Return the drive with the displacement a sensor would have seen."""
    moved_um = actuator.simulate(drive.steps_s, drive.voltage_v) + noise.normal(40.0, 1e-3, drive.n_samples)
    return Recording(drive.time_s, drive.voltage_v, moved_um, name=drive.name)


# The staircase shows creep; between two of its steps it leaves open where an element gives way, the slope does not.
train = [measured(drive.to_recording()) for drive in (staircase(dwell_s=0.5, rate_hz=200.0), triangle(rate_hz=200.0))]
test = measured(triangle(amplitude_v=2.0, slope_v_per_s=2.0, rate_hz=200.0).to_recording())
print(train[0])

fit = identify(train, n_elements=8, test=test)
print(fit)

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "model.yaml"
    write_model(fit.model, path, fit.rms_um)
    print(read_model(path))

"""A model for each recording of a folder: resumable, side by side, a bad recording told and passed over.

python examples/fleet.py
"""

import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from fomrc_core import PiezoModel, Recording, read_model, write_recording
from fomrc_core.identification.fleet import FleetOptions, identify_fleet, records_in
from fomrc_core.records.excitation import triangle

# In place of measurements: three actuators that differ by a few percent, and a file that is no recording.
first = read_model(Path(__file__).parents[1] / "config" / "pi_p753_table1.yaml")
noise = np.random.default_rng(3)
drive = triangle(slope_v_per_s=5.0, rate_hz=200.0).to_recording()

with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    for number, factor in enumerate((0.97, 1.0, 1.04), start=1):
        actuator = PiezoModel(factor * first.kappa_um_per_v, first.saturation_v, first.creep_order)
        moved_um = actuator.simulate(drive.steps_s, drive.voltage_v) + noise.normal(0.0, 1e-3, drive.n_samples)
        write_recording(Recording(drive.time_s, drive.voltage_v, moved_um), folder / f"actuator_{number}.csv")
    (folder / "broken.csv").write_text("not a recording\n")

    # An executor of any kind takes the work; without one, a process for each processor does.
    with ThreadPoolExecutor(2) as executor:
        records = identify_fleet(
            records_in(folder), folder / "models", options=FleetOptions(n_elements=6), executor=executor
        )
    for record in records:
        print(record)

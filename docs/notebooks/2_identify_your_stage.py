# ---
# jupyter:
#   jupytext:
#     text_representation:
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     name: python3
# ---

# %% [markdown]
# # Identify your stage
#
# From a recording to a model. In place of a measurement stands the paper's actuator with 1 nm of noise; with a stage
# of your own, `read_recording("stage.csv")` or `Recording.from_table(frame)` is all that changes.

# %%
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from fomrc_core import Recording, identify, read_model, read_recording, write_model, write_recording
from fomrc_core.records.excitation import staircase, triangle
from fomrc_core.records.quality import examine

stage, noise = read_model("config/pi_p753_table1.yaml"), np.random.default_rng(0)


def measured(drive: Recording) -> pd.DataFrame:
    """Return what a laboratory's program would have written."""
    moved_um = stage.simulate(drive.steps_s, drive.voltage_v) + noise.normal(40.0, 1e-3, drive.n_samples)
    return pd.DataFrame({"time_s": drive.time_s, "voltage_v": drive.voltage_v, "displacement_um": moved_um})


drives = staircase(dwell_s=0.5, rate_hz=200.0), triangle(rate_hz=200.0)
tables = [measured(drive.to_recording()) for drive in drives]
tables[0].head()

# %% [markdown]
# ## Look at it first
#
# Spikes, dropouts, a stuck sensor and gaps are found before anything is fitted. Here one reading is spoilt on
# purpose.

# %%
tables[1].loc[1234, "displacement_um"] += 5.0
records = [
    Recording.from_table(table, name=name) for table, name in zip(tables, ("staircase", "triangle"), strict=True)
]
for record in records:
    print(str(examine(record).quality) or f"{record.name}: nothing wrong")

# %%
figure, axes = plt.subplots(figsize=(5.5, 3.5), layout="constrained")
axes.plot(records[1].voltage_v, records[1].measured_um, lw=0.6)
axes.set(xlabel="voltage [V]", ylabel="displacement [µm]", title="the triangle, with a spike")

# %% [markdown]
# ## Fit
#
# The first word says how good it is: `good` where nothing but noise is left. The spike is left out.

# %%
held_out = Recording.from_table(measured(triangle(amplitude_v=2.0, slope_v_per_s=2.0, rate_hz=200.0).to_recording()))
fit = identify(records, n_elements=8, test=held_out)
print(fit)

# %%
fit.plot()

# %%
fit.to_dataframe().round(4)

# %% [markdown]
# ## Keep it
#
# A model file is a ROS parameter file: the same file runs the compensator node.

# %%
import tempfile
from pathlib import Path

with tempfile.TemporaryDirectory() as folder:
    write_model(fit.model, Path(folder) / "model.yaml", fit.rms_um)
    write_recording(records[0], Path(folder) / "staircase.csv")
    print(read_model(Path(folder) / "model.yaml"))
    print(read_recording(Path(folder) / "staircase.csv"))

# %% [markdown]
# Next: [what does my model get wrong?](3_what_does_my_model_get_wrong.py)

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
# # Simulate, and see the hysteresis
#
# A piezo actuator does not go where its voltage says: on the way down it lies above the way up, and where the voltage
# rests it goes on moving. Both are in one model, and both are seen here. The actuator is that of the paper, a PI
# P-753.

# %%
import matplotlib.pyplot as plt
import numpy as np

from fomrc_core import Recording, read_model
from fomrc_core.records.excitation import staircase, triangle

stage = read_model("config/pi_p753_table1.yaml")
stage

# %% [markdown]
# ## The loop
#
# A triangle whose amplitude falls runs through loops inside of loops: where it turns, it leaves the outer loop, and
# where it comes back to the turning point, it forgets that it was away.

# %%
drive = triangle(slope_v_per_s=5.0, rate_hz=200.0).to_recording()
moved_um = stage.simulate(drive.steps_s, drive.voltage_v)

figure, axes = plt.subplots(figsize=(5.5, 4.0), layout="constrained")
axes.plot(drive.voltage_v, moved_um, lw=0.8)
axes.set(xlabel="voltage [V]", ylabel="displacement [µm]", title="loops of a falling triangle")

# %%
gap_um = np.ptp(moved_um[np.abs(drive.voltage_v) < 0.02])
print(f"at 0 V it stands anywhere within {gap_um:.1f} of {np.ptp(moved_um):.1f} um")

# %% [markdown]
# ## The creep
#
# A staircase rests on each step. What goes on there is slow, and it is the same for each decade of time: between 0.1
# and 1 s as much as between 1 and 10 s.

# %%
steps = staircase(dwell_s=10.0, rate_hz=100.0).to_recording()
crept_um = stage.simulate(steps.steps_s, steps.voltage_v)
longest = np.flatnonzero(np.diff(steps.voltage_v) != 0.0)
start, stop = longest[np.argmax(np.diff(longest))] + 1, longest[np.argmax(np.diff(longest)) + 1]
rest_s = steps.time_s[start:stop] - steps.time_s[start - 1]

figure, axes = plt.subplots(figsize=(5.5, 3.5), layout="constrained")
axes.semilogx(rest_s, 1e3 * (crept_um[start:stop] - crept_um[start]))
axes.set(xlabel="time on the step [s]", ylabel="creep [nm]", title="creep is even in the logarithm of time")

# %% [markdown]
# ## As a table
#
# A recording is columns of numbers; where pandas is there, it is a DataFrame both ways.

# %%
frame = Recording(drive.time_s, drive.voltage_v, moved_um).to_dataframe()
frame.describe()

# %% [markdown]
# Next: [identify a stage of your own](2_identify_your_stage.py).

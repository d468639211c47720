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
# # Scanning with the compensator
#
# A raster scan: one axis goes to and fro, the image is taken on both ways. Where hysteresis is not undone, the lines
# there and back do not meet, and the field shrinks and shifts as creep goes on.

# %%
import matplotlib.pyplot as plt
import numpy as np

from fomrc_core import Compensator, identify, read_model
from fomrc_core.records.excitation import staircase, triangle
from fomrc_core.records.recording import Recording

stage, noise = read_model("config/pi_p753_table1.yaml"), np.random.default_rng(0)
records = []
for drive in (staircase(dwell_s=0.5, rate_hz=200.0).to_recording(), triangle(rate_hz=200.0).to_recording()):
    moved_um = stage.simulate(drive.steps_s, drive.voltage_v) + noise.normal(0.0, 1e-3, drive.n_samples)
    records.append(Recording(drive.time_s, drive.voltage_v, moved_um))
fit = identify(records, n_elements=8)
print(fit)

# %% [markdown]
# ## Twelve lines of 4 um at 5 Hz

# %%
rate_hz, n_lines, size_um = 2000.0, 12, 4.0
time_s = np.arange(int(n_lines * rate_hz / 5.0)) / rate_hz
steps_s = np.full(time_s.size, 1.0 / rate_hz)
desired_um = size_um * np.abs((2.0 * 5.0 * time_s + 1.0) % 2.0 - 1.0)

voltage_v = Compensator(fit.model).run(steps_s, desired_um)
plain_v = desired_um * np.ptp(voltage_v) / size_um

# %%
reached = {
    "plain gain": stage.simulate(steps_s, plain_v),
    "compensated": stage.simulate(steps_s, voltage_v),
}
figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
for name, moved_um in reached.items():
    error_um = moved_um - desired_um
    axes[0].plot(desired_um, error_um, lw=0.6, label=f"{name}: {100.0 * np.max(np.abs(error_um)) / size_um:.2f} %")
    axes[1].plot(time_s, error_um, lw=0.6)
axes[0].set(xlabel="target [µm]", ylabel="error [µm]", title="lines there and back")
axes[1].set(xlabel="time [s]", title="over the scan")
axes[0].legend(title="largest error")

# %% [markdown]
# ## What the image sees
#
# A pattern of stripes, seen on the way there and on the way back, line by line.

# %%
n_pixels = 200


def image(moved_um: np.ndarray) -> np.ndarray:
    """Return the stripes under the probe, a row for each half line, shape (2 n_lines, n_pixels)."""
    stripes = np.sin(2.0 * np.pi * moved_um / 1.0)
    halves = stripes.reshape(2 * n_lines, -1)
    rows = [half if k % 2 == 0 else half[::-1] for k, half in enumerate(halves)]
    pixels = np.linspace(0, halves.shape[1] - 1, n_pixels).astype(int)
    return np.array([row[pixels] for row in rows])


figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.2), layout="constrained")
for panel, (name, moved_um) in zip(axes, reached.items(), strict=True):
    panel.imshow(image(moved_um), aspect="auto", cmap="gray", extent=(0.0, size_um, n_lines, 0.0))
    panel.set(xlabel="target [µm]", ylabel="line", title=name)

# %%
mismatch_nm = {name: 1e3 * np.max(np.abs(moved_um - desired_um)) for name, moved_um in reached.items()}
assert mismatch_nm["compensated"] < 0.05 * mismatch_nm["plain gain"]
mismatch_nm

# %% [markdown]
# In service the compensator steps at the rate of the loop (`advance`), in ROS as a node; where the whole scan is
# known beforehand, resonances and delays are undone as well: [scan fast](../how-to/fast-scans.md).

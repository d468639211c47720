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
# # What does my model get wrong?
#
# A model of hysteresis and creep leaves something of a recording. A diagnosis asks which physical cause explains it,
# puts that cause into the model, and says on a recording it has not learnt from what that gains. Here an amplifier of
# 40 Hz is hidden in the recordings of the paper's actuator.

# %%
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from fomrc_core import Recording, diagnose, read_model
from fomrc_core.effects.amplifier_bandwidth import AmplifierBandwidth
from fomrc_core.model.substeps import Substeps
from fomrc_core.records.excitation import multisine, triangle

model, noise = read_model("config/pi_p753_table1.yaml"), np.random.default_rng(2)
# A stage knows nothing of samples: its hysteresis bends the response within a step as well.
stage = replace(model.with_effects(AmplifierBandwidth(cutoff_hz=40.0)), substeps=Substeps.BENDS)


def measured(drive: Recording) -> Recording:
    """Return the drive with what a sensor of 2 nm noise sees of the stage."""
    moved_um = stage.simulate(drive.steps_s, drive.voltage_v) + noise.normal(0.0, 2e-3, drive.n_samples)
    return Recording(drive.time_s, drive.voltage_v, moved_um, name=drive.name)


# %% [markdown]
# ## Recordings that can tell
#
# A cause can only be told from another if the drive tells them apart: slow loops for the hysteresis, fast ones for
# whatever depends on the rate, and a third recording to be judged by.

# %%
slow = measured(triangle(slope_v_per_s=5.0, rate_hz=500.0).to_recording())
fast = measured(multisine(highest_hz=50.0, period_s=2.0, n_periods=3, rate_hz=500.0).to_recording())
other = measured(multisine(highest_hz=50.0, period_s=2.0, n_periods=2, seed=1, rate_hz=500.0).to_recording())

# %% [markdown]
# ## The diagnosis

# %%
found = diagnose([slow, fast], test=other)
print(found)

# %% [markdown]
# ## Before and after
#
# The extended model is again a model: the same files, the same simulator, the same compensator.


# %%
def left_nm(predicted: np.ndarray) -> np.ndarray:
    """Return what is left of the third recording, its mean taken out [nm], shape (n_samples,)."""
    left = other.measured_um - predicted
    return 1e3 * (left - np.mean(left))


before = left_nm(model.simulate(other.steps_s, other.voltage_v))
after = left_nm(found.extended_model.simulate(other.steps_s, other.voltage_v))

figure, axes = plt.subplots(figsize=(7.0, 3.5), layout="constrained")
axes.plot(other.time_s, before, lw=0.6, label=f"hysteresis and creep alone: {np.std(before):.0f} nm rms")
axes.plot(other.time_s, after, lw=0.6, label=f"with the amplifier: {np.std(after):.1f} nm rms")
axes.set(xlabel="time [s]", ylabel="residual [nm]", title="held out")
axes.legend(loc="upper right")

# %%
for finding in found.findings:
    print(finding.cause, finding.parameters)

# %% [markdown]
# Next: [scanning with the compensator](4_scanning_with_the_compensator.py).

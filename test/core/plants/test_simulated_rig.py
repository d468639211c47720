"""The rig stepped one by one is the rig run as a whole."""

from __future__ import annotations

import numpy as np

from fomrc_core.plants.electromechanical import table1_plant
from fomrc_core.plants.simulated_rig import SimulatedRig


def test_steps_are_the_run():
    rig = SimulatedRig(table1_plant(12, resonance_hz=300.0, damping_ratio=0.02, substep_s=1.0), 500.0)
    time_s = np.arange(1.0, 301.0) / 2000.0
    voltage_v = 1.5 * np.sin(2.0 * np.pi * 30.0 * time_s)
    whole_um = rig.displacement_um(np.full(time_s.size, 5e-4), voltage_v)
    state = rig.initial_state()
    stepped_um = [rig.advance(state, float(value), 5e-4) for value in voltage_v]
    # A drive that stands still for a while is cut into fewer parts by the run; this one moves fast but at its turns.
    np.testing.assert_allclose(stepped_um, whole_um, rtol=0.0, atol=1e-9)

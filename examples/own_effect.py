"""An effect of one's own: the periodic error of an interferometer, simulated, written to a file's form and undone.

A class is all it takes. To have it found in model files, by ``fomrc diagnose`` and by the ROS nodes as well, name it
in your own package's pyproject.toml, with nothing of this package edited:

    [project.entry-points."fomrc.effects"]
    interferometer_error = "your_package.interferometer_error:InterferometerError"

    python examples/own_effect.py
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from fomrc_core import Compensator, Effect, read_model
from fomrc_core.compute.arrays import Array
from fomrc_core.effects import Parameter, Stage
from fomrc_core.effects.base.evidence import Evidence

_HALF_WAVELENGTH_UM = 0.3164  # of a helium-neon laser: one fringe of a plane mirror interferometer


@dataclass(frozen=True)
class InterferometerError(Effect):
    """The reading of an interferometer, which mixes its two beams and so errs with the period of a fringe."""

    name: ClassVar[str] = "interferometer_error"
    stage: ClassVar[Stage] = Stage.SENSED
    order: ClassVar[float] = 55.0
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("amplitude_um", "um", 0.0, 0.1, description="amplitude of the periodic error"),
        Parameter("phase_rad", "rad", -10.0, 10.0, description="where in a fringe the record begins"),
    )
    main_parameter: ClassVar[str] = "amplitude_um"
    meaning: ClassVar[str] = "The two beams of the interferometer mix, so its reading errs with the period of a fringe."
    signature: ClassVar[str] = "residual is a sine of the displacement, half a wavelength long"
    experiment: ClassVar[str] = "a ramp over many fringes, slow enough for many samples on each"
    inverse_note: ClassVar[str] = "none needed: the stage moves as commanded, the reading errs"
    linear_parameters: ClassVar[tuple[str, ...]] = ("amplitude_um",)

    amplitude_um: float
    phase_rad: float = 0.0

    def initial_state(self) -> Array:
        """Return no memory: the error depends on where the stage is, not on where it was."""
        return np.zeros(0)

    def run(self, state: Array, values: Array, steps_s: Array, covariate: Array | None = None) -> Array:
        """Return the reading [um] for each displacement [um], shape (n_samples,)."""
        return values + self.amplitude_um * np.sin(2.0 * np.pi * values / _HALF_WAVELENGTH_UM + self.phase_rad)

    @classmethod
    def screening(cls, evidence: Evidence) -> list[Effect]:
        """Return the two phases of which every other is a mixture; a diagnosis finds how large they are."""
        return [cls(1e-4, phase_rad) for phase_rad in (0.0, 0.5 * np.pi)]


model = read_model(Path(__file__).parents[1] / "config" / "pi_p753_table1.yaml")
read = model.with_effects(InterferometerError(amplitude_um=0.005))
print(read)

steps_s, voltage_v = np.full(3000, 1e-3), np.linspace(0.0, 2.5, 3000)
error_um = read.simulate(steps_s, voltage_v) - model.simulate(steps_s, voltage_v)
print(f"the reading errs by up to {1e3 * np.max(np.abs(error_um)):.2f} nm")
print(read.to_mapping()["interferometer_error"])
print(Compensator(read))

"""What an identification of several axes came to, and how sure each number is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fomrc_core.compute.arrays import Array
from fomrc_core.identification.axes.parameters import AxesParameters
from fomrc_core.identification.axes.standard_errors import AxesStandardErrors, mode_gains
from fomrc_core.model.axes import AxesModel


@dataclass(frozen=True, eq=False)
class AxesIdentification:
    """What came out.

    Attributes:
        model: the model.
        parameters: what was fitted.
        n_parameters: free numbers of the model, thresholds of plays included, less what scales leave undetermined.
        broken: names of the records left out.
        errors: relative error of each record learnt from and output [1].
        names: of these records.
        standard_errors: how sure each number is.
    """

    model: AxesModel
    parameters: AxesParameters
    n_parameters: int
    broken: tuple[str, ...]
    errors: Array
    names: tuple[str, ...]
    standard_errors: AxesStandardErrors

    @property
    def worst_error(self) -> float:
        """Relative error of the worst record, mean over its outputs [1]."""
        return float(np.max(self.errors.mean(axis=1)))

    @property
    def gains(self) -> Array:
        """Gain of each mode: the root of the squares of its residues' sum over outputs and inputs [um/um]."""
        return mode_gains(self.parameters)

    def __str__(self) -> str:
        lines = [f"{self.n_parameters} parameters; error {100.0 * self.errors.mean():.2f} % of the displacement"]
        if self.broken:
            lines.append("left out, periods disagree: " + ", ".join(self.broken))
        return "\n".join([*lines, *self._modes_told(), *self._rest_told()])

    def _modes_told(self) -> list[str]:
        modes, sure, told = self.model.modes, self.standard_errors, []
        if modes is None:
            return []
        soft, _, damping_change, gain_change = modes.changes
        for m in np.argsort(modes.frequency_hz):
            line = (
                f"mode {modes.frequency_hz[m]:9.3f} +- {sure.frequency_hz[m]:.2g} Hz, "
                f"damping {100.0 * modes.damping[m]:.4f} +- {100.0 * sure.damping[m]:.2g} %, "
                f"gain {self.gains[m]:.4g} +- {sure.gain[m]:.2g}"
            )
            for what, value, error in (
                ("softening", soft[m], sure.softening[m]),
                ("damping change", damping_change[m], sure.damping_change[m]),
                ("gain change", gain_change[m], sure.gain_change[m]),
            ):
                if np.isfinite(error):
                    line += f", {what} {100.0 * value:.3f} +- {100.0 * error:.2g} %"
            told.append(line)
        return told

    def _rest_told(self) -> list[str]:
        sure = self.standard_errors
        told = [f"delay {1e6 * self.model.delay_s:.4g} +- {1e6 * sure.delay_s:.2g} us"]
        if self.model.level is not None and np.isfinite(sure.exponent):
            told.append(f"exponent of the level law {self.model.level.exponent:.4g} +- {sure.exponent:.2g}")
        for p, (weights, errors) in enumerate(zip(self.parameters.play_weights, sure.play_weights, strict=True), 1):
            pairs = ", ".join(f"{value:.4g} +- {error:.2g}" for value, error in zip(weights, errors, strict=True))
            told.append(f"hysteresis weight {p} of each input: {pairs}")
        return told

"""What an identification comes to: the model, how good it is, and what it rests on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fomrc_core.compute.notebook import CurvePanel, curves_figure, shown_as_html
from fomrc_core.fitting.long_records import Thinning
from fomrc_core.model.piezo_model import PiezoModel
from fomrc_core.records.quality import DataQuality

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

Array = NDArray[np.float64]

# Of the noise floor: what a fit with some dozens of parameters leaves at the noise lies within a few percent of it, and
# the floor itself is known to some ten.
_NOISE_REACHED = 1.2


class FitOutcome(Enum):
    """How good an identification is."""

    GOOD = "good"
    COARSE = "coarse"
    UNDETERMINED = "undetermined"


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of an identification.

    Attributes:
        model: the identified model.
        outcome: how good it is.
        reason: the same in a sentence.
        rms_um: forward error on the training records, offset removed [um].
        nrmse_percent: the same in percent of the measured range.
        noise_um: noise floor of the records [um].
        test_nrmse_percent: error on the held-out record; nan without one.
        offsets_um: offset of each training record [um].
        residuals_um: measured minus predicted per training record, or thinned record [um].
        creep_order_standard_error: standard error of the creep order [1].
        relative_standard_errors: of slope, weights and thresholds of the play form, shape (2 n + 1,).
        undetermined_elements: elements (by ascending threshold) whose weight or threshold the data leave open.
        starts: how each record was found to begin: "relaxed" or "rested at its first voltage".
        data_quality: what is wrong with the samples of each training record, and of the held-out one.
        thinning: how long records were thinned, and what that loses; None where they were not.
    """

    model: PiezoModel
    outcome: FitOutcome
    reason: str
    rms_um: float
    nrmse_percent: float
    noise_um: float
    test_nrmse_percent: float
    offsets_um: tuple[float, ...]
    residuals_um: tuple[Array, ...]
    creep_order_standard_error: float
    relative_standard_errors: Array
    undetermined_elements: tuple[int, ...]
    starts: tuple[str, ...]
    data_quality: tuple[DataQuality, ...] = ()
    thinning: Thinning | None = None

    def __str__(self) -> str:
        lines = [
            f"{self.outcome.value}: {self.reason}",
            f"creep order {self.model.creep_order:.5g} +- {self.creep_order_standard_error:.2g}, "
            f"{self.model.n_elements} elements",
            f"NRMSE {self.nrmse_percent:.4g} % (rms {1e3 * self.rms_um:.4g} nm, noise {1e3 * self.noise_um:.4g} nm)",
        ]
        if not math.isnan(self.test_nrmse_percent):
            lines.append(f"NRMSE {self.test_nrmse_percent:.4g} % held out")
        lines[1:1] = [str(quality) for quality in self.data_quality if quality.faults]
        lines[1:1] = self.thinning.sentences() if self.thinning is not None else ()
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return shown_as_html("Fit", f"{self}\n{self.model}")

    def to_dataframe(self) -> DataFrame:
        """Return the elements as a pandas DataFrame, a row each; pandas has to be there.

        Columns: threshold [V] and weight [um/V] of each play, and the relative standard errors of both [1].
        """
        from pandas import DataFrame

        n = self.model.n_elements
        columns = {
            "threshold_v": self.model.play_form.thresholds,
            "threshold_error": self.relative_standard_errors[n + 1 :],
            "weight_um_per_v": self.model.play_form.weights,
            "weight_error": self.relative_standard_errors[1 : n + 1],
        }
        return DataFrame(columns)

    def plot(self) -> Figure:
        """Return a figure of what the fit leaves of each training record, sample by sample."""
        panels = (
            CurvePanel(
                f"record {k}: what is left",
                "sample",
                "residual [nm]",
                np.arange(r.size, dtype=np.float64),
                {"left": 1e3 * r},
            )
            for k, r in enumerate(self.residuals_um, 1)
        )
        return curves_figure(tuple(panels))


def judged(error_um: float, noise_um: float, n_undetermined: int, n_elements: int) -> tuple[FitOutcome, str]:
    """Return how good a fit of this error and noise [um rms] is, and the same in a sentence."""
    if n_undetermined:
        return FitOutcome.UNDETERMINED, (
            f"{n_undetermined} of {n_elements} elements are not determined by this drive: "
            "use more amplitudes or fewer elements"
        )
    if error_um <= _NOISE_REACHED * noise_um:
        return FitOutcome.GOOD, f"error {1e3 * error_um:.3g} nm rms, at the noise of {1e3 * noise_um:.3g} nm"
    ratio = error_um / max(noise_um, 1e-12)
    return FitOutcome.COARSE, (
        f"error {1e3 * error_um:.3g} nm rms is {ratio:.3g} times the noise: diagnose the record, something is "
        "not in the model"
    )
